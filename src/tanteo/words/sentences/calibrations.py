"""Sentences of a calibration of range sensors by planes."""

from __future__ import annotations

import math

from tanteo.words import findings as f
from tanteo.words.figures import listed, millimetres, p_equals
from tanteo.words.sentences.base import Words, words_of

_PARAMETERS = {
    "x": "the origin across the beam (x)",
    "y": "the origin across the beam (y)",
    "offset": "the offset along the beam",
    "rx": "the beam's direction (rotation about x)",
    "ry": "the beam's direction (rotation about y)",
    "scale": "the scale",
    "z": "the origin along the axis (z)",
    "tilt": "the tilt",
    "rz": "the rotation about the axis",
}
"""Text of the parameters of a beam."""

_TURN = "Turn the hand about two axes across the beam between readings, by 20 degrees or more, and change the range."

_DISTANCES = "Take known distances that differ more, over the ranges that you will use."


def parameter_words(one: f.Undetermined) -> str:
    """Return the parameters of a combination as text, without the sensor."""
    first, *others = (_PARAMETERS[name] for name in one.parameters)
    return f"{first} apart from {' and '.join(others)}" if others else first


def _of_sensors(undetermined: tuple[f.Undetermined, ...]) -> str:
    """Return all combinations by sensor."""
    names = dict.fromkeys(one.sensor for one in undetermined)
    each = [(name, [parameter_words(one) for one in undetermined if one.sensor == name]) for name in names]
    return "; ".join(f"{listed(words)} of '{name}'" for name, words in each)


@words_of.register
def _(one: f.Undetermined) -> Words:
    return f"The log does not determine {_of_sensors((one,))}.", _TURN


@words_of.register
def _(one: f.Calibrated) -> Words:
    text = f"Calibrated {', '.join(one.sensors)}."
    if not one.undetermined:
        return text, ""
    return (
        f"{text} This log adds little on {_of_sensors(one.undetermined)}, which keep their prior.",
        _DISTANCES if one.by_distances else _TURN,
    )


@words_of.register
def _(one: f.BeamsUndetermined) -> Words:
    what = _of_sensors(one.undetermined)
    return f"This log does not determine {what}.", _DISTANCES if one.by_distances else _TURN


@words_of.register
def _(one: f.NotPlanes) -> Words:
    return (
        "No beams explain these readings on planes, the stated target or at the known distances better than chance."
    ), "Check labels, hand poses, distances and units, the stated target, and take more places."


@words_of.register
def _(one: f.ManyOutliers) -> Words:
    return (
        f"{one.outliers} of {one.count} places contradict the others, so that the result is not reliable."
    ), "Check the labels of the planes, and frame, units and quaternions of the hand poses."


@words_of.register
def _(one: f.PlacesScatter) -> Words:
    return (
        f"'{one.sensor}' scatters {one.factor:.0f} times as much from place to place as at one place."
    ), "Check labels and hand poses."


@words_of.register
def _(one: f.OffRig) -> Words:
    off = f"{millimetres(one.distance, 3)} and {math.degrees(one.angle):.2g} deg"
    return (
        f"'{one.sensor}' is {off} away from its place on the rig, more than the rig allows ({p_equals(one.p_value)})."
    ), "Check whether this is the rig of the log."
