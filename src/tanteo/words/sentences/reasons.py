"""Sentences on why a policy chose a reading."""

from __future__ import annotations

from tanteo.words import findings as f
from tanteo.words.figures import excluded
from tanteo.words.sentences.base import Words, words_of


@words_of.register
def _(one: f.MostInformation) -> Words:
    gives = f"expected to exclude {excluded(one.gain)} of the possible parts and poses"
    if not one.feature:
        return f"It is {gives}.", ""
    return f"With {one.others} more of {one.feature} it is {gives}.", ""


@words_of.register
def _(one: f.ViewFirst) -> Words:
    text = (
        f"A view first: it is expected to exclude {excluded(one.gain)} of the possible parts and poses in "
        f"{one.seconds:.1f} s, the best reading {excluded(one.other_gain)} in {one.other_seconds:.1f} s."
    )
    left = ", ".join(f"{count} {reason}" for reason, count in one.excluded)
    return f"{text} Excluded views: {left}." if left else text, ""


@words_of.register
def _(one: f.RepeatMisfit) -> Words:
    return "An earlier reading of this beam does not fit; a repeat shows whether the sensor erred.", ""


@words_of.register
def _(one: f.DrawnAtRandom) -> Words:
    return "It was drawn at random.", ""


@words_of.register
def _(one: f.NearestPlace) -> Words:
    return "It is the nearest new place.", ""


@words_of.register
def _(one: f.LargestFaceLeast) -> Words:
    text = f"It is on {one.face}, which has the largest area for each of its readings."
    return f"{text} A similar part would differ there." if one.confirms else text, ""


@words_of.register
def _(one: f.Rule321) -> Words:
    return f"It is reading {one.number} of the 3-2-1 rule.", ""


@words_of.register
def _(one: f.ChosenByUser) -> Words:
    return "You chose it.", ""


@words_of.register
def _(one: f.NextTouch) -> Words:
    place = ", ".join(f"{1e3 * v:.1f}" for v in one.point)
    along = ", ".join(f"{round(v, 2) + 0.0:.2f}" for v in one.direction)
    slowly = "" if one.clear else " Approach slowly: the part may be in the path."
    return "", f"Sense {one.face} of {one.part} next, at ({place}) mm along ({along}) in the world.{slowly}"
