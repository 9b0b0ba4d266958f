"""Sentences of verdicts on readings."""

from __future__ import annotations

from tanteo.defaults import SIGNIFICANCE
from tanteo.words import findings as f
from tanteo.words.figures import from_surface, listed, millimetres, p_equals, percent, readings
from tanteo.words.sentences.base import Words, words_of


def _sure(probability: float) -> str:
    return "" if probability != probability else f" ({percent(probability)})"  # NaN


def _or_else(others: tuple[f.Share, ...]) -> str:
    """Return what else it may be."""
    return f" It may also be {listed([f'{name} ({percent(P)})' for name, P in others], 'or')}." if others else ""


@words_of.register
def _(one: f.Located) -> Words:
    located = f"located to {millimetres(one.corner_sd)} (largest corner sd)"
    return f"{one.part}{_sure(one.probability)}, {located}.{_or_else(one.others)}", ""


@words_of.register
def _(one: f.SeveralEqual) -> Words:
    """Name each part with its readings."""
    number = _NUMBERS.get(len(one.readings), str(len(one.readings)))
    each = [
        f"{k} at x {1e3 * x:z.2f} y {1e3 * y:z.2f} z {1e3 * z:z.2f} mm to {millimetres(sd)}, from {_runs(ids)}"
        f"{'' if status == 'recognized' else f' ({status})'}"
        for k, ((x, y, z), sd, ids, status) in enumerate(
            zip(one.positions, one.corner_sds, one.readings, one.statuses, strict=True), start=1
        )
    ]
    left = f" On none of them: {_runs(one.left)}." if one.left else ""
    return f"The readings are of {number} equal parts, {number} of {one.part}: {'; '.join(each)}.{left}", (
        "Use --count 1 if only one part was sensed. With --wcs or --as choose one by --which."
    )


_NUMBERS = {2: "two", 3: "three", 4: "four"}


def _runs(ids: tuple[str, ...]) -> str:
    """Return ids as text, with consecutive numbers as runs."""
    shown = list[str]()
    first = 0
    for k in range(len(ids)):
        follows = k + 1 < len(ids) and ids[k].isdecimal() and ids[k + 1] == str(int(ids[k]) + 1)
        if not follows:
            shown += [f"{ids[first]} to {ids[k]}"] if k - first > 1 else list(ids[first : k + 1])
            first = k + 1
    more = f" and {len(shown) - _SHOWN_RUNS} more" if len(shown) > _SHOWN_RUNS else ""
    return f"readings {', '.join(shown[:_SHOWN_RUNS])}{more}"


_SHOWN_RUNS = 12


@words_of.register
def _(one: f.PoseWithin) -> Words:
    what = f"The possible places of {one.feature} differ" if one.feature else "Its possible poses differ"
    within = f"less than the tolerance of {millimetres(one.tolerance, 3)}"
    return f"It is {one.part}{_sure(one.probability)}. {what} by {within}.{_or_else(one.others)}", ""


@words_of.register
def _(one: f.SeveralPoses) -> Words:
    if one.poses:
        text = f"The part is {one.part}{_sure(one.probability)}. Its pose is one of {one.poses}."
    else:
        text = f"It is {one.part}{_sure(one.probability)}, in one of several poses."
    text += _or_else(one.others)
    return text, "Sense a face that is at different places in these poses."


@words_of.register
def _(one: f.SeveralParts) -> Words:
    names = [*one.parts, *([f"one of {one.more} others"] if one.more else [])] or ["any part"]
    text = f"It may be {listed(names, 'or')}."
    if one.equal:
        text += f" {names[0]} and {one.equal} have the same shape: if they are one part, remove one of them."
    if one.mirror:
        text += f" {names[0]} and {one.mirror} are mirror images of each other, and the readings fit both."
    return text, "Sense a face where they differ."


@words_of.register
def _(one: f.GivenTwice) -> Words:
    return f"{one.part} is more than once among the parts.", "Remove the copies."


@words_of.register
def _(one: f.MayBeUnknown) -> Words:
    text = f"{one.part} fits, but an unknown part may fit, too ({percent(one.unknown)})."
    if one.outliers:
        few, many = len(one.outliers) in (1, *_NUMBERS), len(one.outliers) > 1
        which = f"{'Readings' if many else 'Reading'} {listed(list(one.outliers))}"
        text += f" {which if few else readings(len(one.outliers))} {'are' if many else 'is'} not on it."
        text += " Expect outliers (--outlier-rate 10%), or state what else was touched (--furniture)."
    return text, "Sense one more place."


@words_of.register
def _(one: f.FreeMotions) -> Words:
    stays = "stays" if len(one.motions) <= 1 else "stay"
    text = f"{one.part} fits, but {' and '.join(one.motions) or 'a direction'} {stays} free."
    advice = one.face or "sense a face or an edge that resists it"
    return text, f"{advice[0].upper()}{advice[1:].rstrip('.')}."


_CENTRED = {
    "centre": ("no hole and no boss", "Its holes and bosses are of kind circle or cylinder."),
    "sphere_centre": ("no ball and no hollow", "Its balls and hollows are of kind sphere."),
    "apex": ("no cone", "Its cones are of kind cone."),
}
"""What a part without a kind of centre lacks, and the kind of rows for one that has it."""


@words_of.register
def _(one: f.OutlierOrVariant) -> Words:
    if not one.readings:
        return f"{one.part} fits, but readings contradict it.", "Touch there again."
    first, off = one.readings[0], from_surface(one.distances[0])
    if len(one.readings) == 1:
        text = f"reading {first} ({off}) contradicts it. It is an outlier"
    else:
        others = readings(len(one.readings) - 1)
        text = f"reading {first} ({off}) and {others} more contradict it. They are outliers"
    advice = f"Touch near reading {first} again."
    return f"{one.part} fits, but {text}, or the object is a variant of the part.", advice


@words_of.register
def _(one: f.TooCoarse) -> Words:
    text = f"{one.part} fits, but its corners are known to {millimetres(one.corner)} only (95 %)"
    return (
        f"{text}, more than {one.what} ({millimetres(one.limit)}).",
        "Sense places that are farther apart, or more of them.",
    )


@words_of.register
def _(one: f.NoPart) -> Words:
    if one.missing:
        lacks = " and ".join(_CENTRED.get(kind, (f"nothing of kind {kind}", ""))[0] for kind in one.missing)
        text = f"{one.part} has {lacks}." if one.part else f"The parts have {lacks}."
        there = " ".join(_CENTRED[name][1] for name in one.present if name in _CENTRED)
        mesh = " A round face of a mesh may be read as free form: use STEP." if one.freeform else ""
        return f"{text}{f' {there}' if there else ''}", f"Check the column kind, or add the part's file.{mesh}"
    return "None of the parts explains the readings.", "Check units and standard deviations, or add the part's file."


@words_of.register
def _(one: f.UnknownObject) -> Words:
    return (
        f"An unknown object explains the readings best ({percent(one.unknown)}). The closest part is {one.part} "
        f"({percent(one.probability)})."
    ), "Sense more places on it, or add the part's file."


@words_of.register
def _(one: f.MostlyOnPart) -> Words:
    return (
        f"The closest part is {one.part}, but {len(one.outliers)} of {readings(one.count)} are not on it. It may be "
        f"another part ({percent(one.unknown)})."
    ), "Add its file, check the sensor's standard deviation, or expect more outliers (--outlier-rate)."


def worst_words(one: f.WorstReading) -> str:
    """Return the reading that agrees least, as a clause."""
    return f"{'the normal of ' if one.normal else ''}reading {one.reading}, {one.sds:.1f} sd off"


@words_of.register
def _(one: f.WorstReading) -> Words:
    return f"The worst is {worst_words(one)}.", ""


def _level(p_value: float, significance: float) -> str:
    return f"{p_equals(p_value)}, significance level {significance:g}"


@words_of.register
def _(one: f.Contradicted) -> Words:
    text = (
        f"The closest part is {one.part}, but the readings contradict it ({_level(one.p_value, one.significance)})."
        f"{'' if one.worst is None else f' The worst is {worst_words(one.worst)}.'}"
    )
    lower = f", or lower the significance level (--significance {SIGNIFICANCE:g})"
    usual = one.p_value < SIGNIFICANCE
    return text, f"Check the sensor's standard deviation, the tolerance and the units{'' if usual else lower}."


@words_of.register
def _(one: f.PriorContradicted) -> Words:
    return (
        f"The closest part is {one.part}, but it is not at the prior pose ({_level(one.p_value, one.significance)})."
    ), "Check the prior pose, or omit it and compare."


@words_of.register
def _(one: f.LabelsContradicted) -> Words:
    return (
        f"{one.part} fits best, but {one.outliers} of {one.count} labelled readings are not on it, more than expected. "
        "It may be another part."
    ), "Check these labels, and sense more places."


@words_of.register
def _(one: f.AmongUnsearched) -> Words:
    best = f"It may be {one.part}, or" if one.part else "It may be"
    return (
        f"{best} one of {one.count:,} parts that were not searched (up to {percent(one.probability)}). The readings "
        "hardly discriminate them."
    ), "Sense more places, with normals or labels if the sensor gives them."
