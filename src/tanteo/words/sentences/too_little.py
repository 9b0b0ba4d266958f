"""Sentences on readings that any part fits."""

from __future__ import annotations

from tanteo.words import findings as f
from tanteo.words.figures import listed, millimetres, readings
from tanteo.words.sentences.base import Words, words_of

_SIDES = "Sense three places or more, better eight, on several sides."
"""Three points of different surfaces are the fewest that fix a pose; eight leave some redundancy."""


@words_of.register
def _(one: f.AllOnFurniture) -> Words:
    return f"All {readings(one.count)} are on the {one.name}.", "Sense the part, on several sides."


@words_of.register
def _(one: f.NothingSensed) -> Words:
    return "No reading met anything.", _SIDES


@words_of.register
def _(one: f.OneCentre) -> Words:
    slides = " It can also slide along its axis." if one.slides else ""
    return (
        f"One centre fits every hole, boss or sphere of its size, and the part can tilt and turn about it.{slides}"
    ), "Sense a second centre, and a face."


@words_of.register
def _(one: f.TwoCentres) -> Words:
    slides = " and slide along its holes" if one.slides else ""
    return (
        f"With two centres the part can still turn about the line through them{slides}."
    ), "Sense a face at three places, or a third centre that is not on this line."


@words_of.register
def _(one: f.TooFewReadings) -> Words:
    return f"{readings(one.count)} {'fits' if one.count == 1 else 'fit'} any part.", _SIDES


@words_of.register
def _(one: f.OnOneLine) -> Words:
    return "The readings lie on one line within their noise.", "Sense places beside it, on several sides."


@words_of.register
def _(one: f.NoiseTooLarge) -> Words:
    what = "the standard deviation, the tolerance" if one.tolerance else "the standard deviation"
    noise = f"{millimetres(one.sd, 4)}{' with the tolerance' if one.tolerance else ''}"
    return (
        f"The noise of the readings (sd {noise}) is as large as the distances between them."
    ), f"Check {what} and the units, or sense places farther apart."


@words_of.register
def _(one: f.NoFeatures) -> Words:
    return "No feature can be fitted to the readings.", ""


@words_of.register
def _(one: f.LabelsRejected) -> Words:
    if len(one.readings) == 1:
        return f"Reading {one.readings[0]} disagrees with its label and is excluded.", ""
    return f"Readings {listed(list(one.readings)) or '-'} disagree with their labels and are excluded.", ""


@words_of.register
def _(one: f.LabelNotes) -> Words:
    notes = [f"{note[0].upper()}{note[1:].rstrip('.')}." for note in one.notes] or ["No label met anything."]
    more = [f"The same holds for {one.more} more label{'s' * (one.more > 1)}."] if one.more else []
    return " ".join([*notes, *more]), ""
