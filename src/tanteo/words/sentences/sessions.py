"""Sentences of a session."""

from __future__ import annotations

import math

from tanteo.words import findings as f
from tanteo.words.figures import excluded, listed, millimetres, percent, readings
from tanteo.words.sentences.base import Words, words_of


@words_of.register
def _(one: f.NoContact) -> Words:
    return "No reading has hit a part yet.", ""


@words_of.register
def _(one: f.EmptySpace) -> Words:
    return "Beams had no echo at every place where the part may be.", "Check the prior pose and the parts."


@words_of.register
def _(one: f.NoPartLeft) -> Words:
    return "No part explains the readings.", "Check the readings, the prior pose and the parts."


@words_of.register
def _(one: f.WiderPrior) -> Words:
    return "", "Start a new session with a wider prior pose; it can use the same readings."


@words_of.register
def _(one: f.MovedMeanwhile) -> Words:
    span = f"{one.first} to {one.last}"
    which = f"{one.outliers} of the readings {span}" if one.outliers else f"Readings {span}"
    others = f"all {'after' if one.after else 'before'} {one.fitting}"
    return f"{which} do not fit, {others} do. Did the part or the sensor move?", ""


@words_of.register
def _(one: f.GoalReached) -> Words:
    part = "" if math.isnan(one.probability) else f"It is {one.part} ({percent(one.probability)}). "
    pose = ""
    if not math.isnan(one.tolerance):
        what = f"{one.feature} of {one.part} is" if one.feature else f"All corners of {one.part} are"
        tolerance = millimetres(one.tolerance, 3)
        pose = f"{what[0].upper()}{what[1:]} within {tolerance} of the estimated place ({percent(one.within)})."
    return f"The goal is reached. {part}{pose}".rstrip(), ""


@words_of.register
def _(one: f.ReadingLimit) -> Words:
    allowed, made = ("1 was" if n == 1 else f"{n:,} were" for n in (one.allowed, one.made))
    return f"The limit of readings is reached: {allowed} allowed, and {made} made.", ""


@words_of.register
def _(one: f.NotWorthCost) -> Words:
    share = excluded(one.gain)
    return f"No reading is worth its cost: the best one is expected to exclude {share} of the possible poses.", ""


_LIMITS = {
    "": (
        "",
        "Give a smaller clearance and stand-off (--clearance, --standoff), another approach direction, or a better "
        "prior pose.",
    ),
    "workspace": (
        " Every start or path to it is outside the workspace or in a forbidden box.",
        "Enlarge the workspace (--workspace, --forbid), or move the part.",
    ),
    "obstacles": (" The table or furniture is in the way.", "Correct --table or --furniture, or move the part."),
    "tool": (
        " Stylus or tool would hit the part, the table or furniture.",
        "Use a longer stylus or a slimmer tool (--tool-body).",
    ),
    "directions": (
        " The allowed directions reach no surface.",
        "Allow others (--approach, --tool-tilt, --axis-parallel).",
    ),
}
"""Sentence and advice by the limit that prevents every reading."""


@words_of.register
def _(one: f.NoPlaceReached) -> Words:
    where = listed(list(one.parts)) if one.parts else "the part at its possible poses"
    text = f"The probe reaches no place of {where}."
    if one.limit in _LIMITS:
        why, advice = _LIMITS[one.limit]
        return text + why, advice
    value, smaller = millimetres(one.value, 3), millimetres(one.possible)
    option = f"(--{one.limit} {smaller.replace(' ', '')})"
    if one.limit == "standoff":
        return f"{text} It starts {value} before the surface.", f"A stand-off of {smaller} is enough {option}."
    return f"{text} It needs {value} of clearance.", f"It reaches some with a clearance of {smaller} {option}."


@words_of.register
def _(one: f.NoClearPath) -> Words:
    if one.last:
        return (
            f"The {one.device} finds no clear path to the readings that are worth making."
            + (f" The last one: {one.reason}" if one.reason else ""),
            "A smaller --standoff lowers the height of its travel; otherwise clear some space for it.",
        )
    return f"There is no clear path for the {one.device}.", ""


@words_of.register
def _(one: f.NoPriorPose) -> Words:
    return "No reading has arrived, and no prior pose is given.", "Give a prior pose (--pose-prior), or a reading."


@words_of.register
def _(one: f.EndedByUser) -> Words:
    return "You ended the session.", ""


def _named(names: tuple[str, ...], verb: str, rest: str) -> str:
    noun, form = (
        ("Reading", {"is": "is", "has": "has"}) if len(names) == 1 else ("Readings", {"is": "are", "has": "have"})
    )
    return f"{noun} {listed(list(names))} {form[verb]} {rest}."


@words_of.register
def _(one: f.RepeatedNames) -> Words:
    text = []
    if one.known:
        text.append(_named(one.known, "is", "known already and not counted again"))
    if one.corrected:
        text.append(_named(one.corrected, "is", "known with other errors, radius or normal, which stay"))
    if one.renamed:
        text.append(_named(one.renamed, "has", "a new name, because another reading has the old one"))
    return " ".join(text), ""


@words_of.register
def _(one: f.NoEcho) -> Words:
    return "No sensor had an echo.", ""


@words_of.register
def _(one: f.BeamsFree) -> Words:
    return "No surface is within the range.", ""


@words_of.register
def _(one: f.FurnitureHit) -> Words:
    return f"{readings(one.count)} hit furniture.", ""


@words_of.register
def _(one: f.NothingToAcquire) -> Words:
    return "The feature is not expected there any more.", ""


@words_of.register
def _(one: f.Stated) -> Words:
    return one.text, ""


@words_of.register
def _(one: f.AccuracyNeeded) -> Words:
    verdict = "The needed accuracy is reached" if one.reached else "The needed accuracy is NOT reached"
    error, need = millimetres(one.error, 3), millimetres(one.need, 3)
    return f"{verdict}: the farthest corner of {one.part} is within {error} (95 %), needed {need}.", ""
