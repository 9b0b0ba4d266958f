"""Sentences on oddities of the input, and on what the user may have meant otherwise."""

from __future__ import annotations

import math

from tanteo.words import findings as f
from tanteo.words.figures import listed, millimetres, percent, readings
from tanteo.words.sentences.base import Words, sentence, words_of

_MOST_NAMES = 3
"""Number of readings that a sentence names; more are counted."""


@words_of.register
def _(one: f.Repeated) -> Words:
    if not one.sets:
        return "No two readings are equal.", ""
    names = [listed(list(ids)) for ids in one.sets[:_MOST_NAMES]]
    rest = len(one.sets) - _MOST_NAMES
    more = f" (and {rest} more such set{'s' * (rest > 1)})" if rest > 0 else ""
    return (
        f"Readings {'; '.join(names)}{more} are equal in place, direction and standard deviation, and each counts."
    ), "If they are one reading under several names, keep one, or the covariance is too small."


@words_of.register
def _(one: f.RepeatedPlaces) -> Words:
    if not one.sets:
        return "No place was touched several times.", ""
    named = [f"{ids[0]} to {ids[-1]} ({len(ids)} touches)" for ids in one.sets[:_MOST_NAMES]]
    rest = len(one.sets) - _MOST_NAMES
    more = f" (and {rest} more)" if rest > 0 else ""
    many = len(one.sets) > 1
    return (
        f"Readings {'; '.join(named)}{more} repeat {'their places' if many else 'one place'}, and the first of each "
        f"counts. They scatter by {millimetres(one.spread)}, and drift by {millimetres(one.drift)} a touch. The noise "
        "between places is not shown by repeats."
    ), ""


@words_of.register
def _(one: f.Stuck) -> Words:
    who = f" of '{one.sensor}'" if one.sensor else ""
    return (
        f"The {one.count} ranges {one.first} to {one.last}{who} are all {1e3 * one.range:.6g} mm, from different "
        "places."
    ), "Check whether the sensor is stuck."


@words_of.register
def _(one: f.TooFarApart) -> Words:
    return (
        f"Half of the readings are more than {one.distance:.3g} m from their middle, and the largest part measures "
        f"{one.widest:.3g} m."
    ), "Check the units: lengths are in metres."


_SPOKEN = {"in": "inches"}
"""Words for units that are also other words."""


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 0.1 else f"{1e3 * metres:.3g} mm"


@words_of.register
def _(one: f.UnitsQuestion) -> Words:
    guesses = [f"--units {u}" for u in one.files] + [f"columns in {_SPOKEN.get(u, u)} (x_{u})" for u in one.columns]
    return (
        f"The {'largest ' if one.parts > 1 else ''}part is {_length(one.widest)} wide and the readings span about "
        f"{_length(one.span)}."
    ), f"Did you mean {' or '.join(guesses)}?"


def size_advice(units: f.UnitsQuestion | None) -> str:
    """Return what to check where readings and parts differ in size."""
    advice = "Check the units in the names of the columns and of the parts (--units)."
    return advice if units is None else f"{advice} {sentence(units)}"


@words_of.register
def _(one: f.TooNarrow) -> Words:
    return (
        f"All readings lie within {1e3 * one.within:.3g} mm, and the smallest part measures "
        f"{1e3 * one.smallest:.4g} mm."
    ), size_advice(one.units)


@words_of.register
def _(one: f.SpreadQuestion) -> Words:
    size = "finer than any sensor" if math.isnan(one.widest) else f"{one.sd / one.widest:.0%} of the largest part"
    return (
        f"One standard deviation of the readings is {1e3 * one.sd:.3g} mm, which is {size}."
    ), "Is its unit right (column sd_mm, sd_m, sd_um; --sd)?"


@words_of.register
def _(one: f.DirectionsQuestion) -> Words:
    return (
        f"The directions (dx, dy, dz) of {one.share:.0%} of the readings lead away from the middle of all. They have "
        "to point into the material, along the beam or the motion of the tip."
    ), "Did you mean the opposite?"


@words_of.register
def _(one: f.NormalsQuestion) -> Words:
    return (
        f"The normals (nx, ny, nz) of {one.share:.0%} of the readings point along the beam (dx, dy, dz). They have to "
        "point out of the material."
    ), "Did you mean the opposite?"


HANDED = (
    "Is the part's file mirrored, are two of the columns x, y, z exchanged, or is one reversed? tanteo takes "
    "right-handed frames."
)
"""What to check where a mirror image fits."""


@words_of.register
def _(one: f.MirrorQuestion) -> Words:
    return f"The mirror image of {one.part} fits all readings ({percent(one.probability)}).", HANDED


def _fitting(one: f.Convention | f.OffsetQuestion | f.ScaleQuestion) -> str:
    n, fits = one.count, one.fitting
    some = ("The reading fits" if n == 1 else f"All {n} readings fit") if n == fits else f"{fits} of {n} readings fit"
    return f"{some} {one.part}"


def _tried(one: f.Convention | f.OffsetQuestion | f.ScaleQuestion) -> str:
    return f" ({one.count} of the {readings(one.given)} were tried.)" if one.given else ""


_RIG = "Check the sensor's pose in the rig."
_POSES = "Check the columns of the hand's pose."

_RESPONSE = 'State response = "{}" in the rig, if the data sheet or a test over an edge confirms it.'

_CONVENTIONS = {
    "quaternion_xyzw": ("the hand's quaternions are in the order x y z w", _POSES),
    "quaternion_wxyz": ("the hand's quaternions are in the order w x y z", _POSES),
    "pose_inverted": ("the hand's poses are inverted (they have to take hand to world)", _POSES),
    "rotation_transposed": ("the hand's rotations are transposed", _POSES),
    "rotation_vector": ("the hand's angles are a rotation vector, not roll, pitch and yaw", _POSES),
    "roll_pitch_yaw": ("the hand's angles are roll, pitch and yaw, not a rotation vector", _POSES),
    "radians": ("the hand's angles are in radians, not degrees", _POSES),
    "beam_along_x": (
        "the beam is along x of the sensor's frame, as in ROS; in a rig it is along z",
        "Correct the quaternion in the rig, or give the file of ROS itself, as --rig robot.urdf#link.",
    ),
    "mount_inverted": ("the sensor's pose in the rig is inverted (it has to take sensor to hand)", _RIG),
    "mount_inverted_along_x": (
        "the sensor's pose in the rig is inverted and its beam along x, as in ROS (it has to take sensor to hand)",
        _RIG,
    ),
    "mount_quaternion_xyzw": ("the sensor's quaternion in the rig is in the order x y z w", _RIG),
    "response_nearest": ("the device reports the nearest point in its cone", _RESPONSE.format("nearest")),
    "response_mean": ("the device reports the mean over its cone", _RESPONSE.format("mean")),
    "response_strongest": (
        "the device reports the face that returns most of its cone",
        _RESPONSE.format("strongest"),
    ),
    "directions_reversed": (
        "the directions (dx, dy, dz) are reversed",
        "They have to point into the material, along the beam or the motion of the tip.",
    ),
    "directions_wrong": (
        "the directions (dx, dy, dz or --direction) are omitted, which contradict them",
        "Check them, or omit them.",
    ),
    "normals_reversed": (
        "the normals (nx, ny, nz) are reversed",
        "The normals have to point out of the material.",
    ),
    "inches_not_millimetres": ("lengths are in inches, not millimetres", "State their unit in the name (x_in)."),
    "millimetres_not_inches": ("lengths are in millimetres, not inches", "State their unit in the name (x_mm)."),
    "millimetres_not_metres": ("lengths are in millimetres, not metres", "State their unit in the name (x_mm)."),
    "metres_not_millimetres": ("lengths are in metres, not millimetres", "State their unit in the name (x_m)."),
    "mirrored": ("they are mirrored", HANDED),
}
"""Other conventions by name, after "if", and what to do."""


@words_of.register
def _(one: f.Convention) -> Words:
    meant, advice = _CONVENTIONS[one.mistake]
    return f"{_fitting(one)} if {meant}.{_tried(one)}", advice


@words_of.register
def _(one: f.OffsetQuestion) -> Words:
    rows = zip(one.faces or one.groups, one.offsets, one.sds, strict=True)
    each = listed(
        [f"{1e3 * value:.2f} +- {1e3 * sd:.2g} mm {'on' if one.faces else 'of'} {name}" for name, value, sd in rows]
    )
    if one.groups:
        return (
            f"{_fitting(one)} if each group of readings has an offset along its approach: {each}.{_tried(one)}",
            f"Omit the groups that are off, or state the offset (--bias-sd group={1e3 * abs(one.offset):.2g}mm).",
        )
    if one.faces:
        return (
            f"{_fitting(one)} if its faces carry stock: {each}.{_tried(one)}",
            f"State it (--stock {1e3 * one.offset:.2g}mm): the pose is then as uncertain as the stock.",
        )
    where = "farther from" if one.offset > 0 else "nearer to"
    what = "tip" if one.touched else "sensor"
    size = f"{1e3 * abs(one.offset):.2g}mm"
    check = "Check its zero" if not one.touched else "Check radius_mm (a radius, not a diameter) and the trigger point"
    stock = f" If the surface carries stock, state it (--stock {size})." if one.touched and one.offset > 0 else ""
    return (
        f"{_fitting(one)} if the surface is {1e3 * abs(one.offset):.2g} mm {where} the {what} than "
        f"measured.{_tried(one)}"
    ), f"{check}.{stock} Otherwise state the offset (--bias-sd {'' if one.touched else 'common='}{size})."


@words_of.register
def _(one: f.ScaleQuestion) -> Words:
    digits = max(4, -math.floor(math.log10(one.sd)))
    text = f"{_fitting(one)} at a scale of {one.scale:.{digits}f} +- {one.sd:.1g}.{_tried(one)}"
    return text, (
        "Check units, steps per millimetre, shrinkage and temperature (11.5 ppm/K of steel), or state the scale "
        f"(--scale-sd {abs(one.scale - 1):.1g})."
    )
