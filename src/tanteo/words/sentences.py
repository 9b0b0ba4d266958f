"""Sentences of findings: what is found, its value, and what to do."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import singledispatch

from tanteo.words import findings as f

_MOST_NAMES = 3
"""Number of readings that a sentence names; more are counted."""

_LESSENED = {
    "robot base": "; more readings do not lessen it, but the same robot, when it goes back, is off by the same",
    "tip offset": ", or turn the hand more between readings",
    "mounting": ", or turn the hand more between readings",
    "bias": ", or sense from more sides, opposite ones best",
    "scale": ", or sense from nearer, or from opposite sides",
}
"""What else lessens an error that all readings share, by the beginning of its name."""


def message_of(findings: Iterable[f.Finding]) -> str:
    """Return the message of an answer: the sentences of its findings in order, without its questions."""
    return " ".join(sentence(one) for one in findings if one.role != "question")


@singledispatch
def sentence(finding: f.Finding) -> str:
    """Return a finding in words."""
    raise TypeError(f"no words for {type(finding).__name__}")


def _sure(probability: float) -> str:
    return "" if math.isnan(probability) else f" (P = {probability:.2f})"


def _or_else(others: tuple[f.Share, ...]) -> str:
    """Return what else it may be."""
    return f"; it may also be {_listed([f'{name} (P = {P:.2f})' for name, P in others], 'or')}" if others else ""


def _listed(names: list[str], word: str = "and") -> str:
    """Return names as ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}" if names else ""


def _readings(count: int) -> str:
    return "1 reading" if count == 1 else f"{count:,} readings"


@sentence.register
def _(one: f.Located) -> str:
    located = f"located to {1e3 * one.corner_sd:.2g} mm (largest corner sd)"
    return f"{one.part}{_sure(one.probability)}, {located}{_or_else(one.others)}."


@sentence.register
def _(one: f.PoseWithin) -> str:
    what = f"the places that {one.feature} may have differ" if one.feature else "the poses that it may have differ"
    within = f"less than the tolerance of {1e3 * one.tolerance:.3g} mm"
    return f"{one.part}{_sure(one.probability)}; {what} by {within}{_or_else(one.others)}."


@sentence.register
def _(one: f.SeveralPoses) -> str:
    advice = "sense a face that is not where its others would put it"
    return f"It is {one.part}{_sure(one.probability)}, in one of several poses: {advice}{_or_else(one.others)}."


@sentence.register
def _(one: f.SeveralParts) -> str:
    names = [*one.parts, *([f"one of {one.more} others"] if one.more else [])] or ["any part"]
    equal = f" {names[0]} and {one.equal} fit exactly alike: if they are one part, leave one out." if one.equal else ""
    return f"It may be {_listed(names, 'or')}: sense a face where they differ.{equal}"


@sentence.register
def _(one: f.GivenTwice) -> str:
    return f"{one.part} was given more than once, and no reading can tell it from itself: leave the others out."


@sentence.register
def _(one: f.MayBeUnknown) -> str:
    return f"{one.part} fits, but so may an unknown part (P = {one.unknown:.2f}): sense one more place."


@sentence.register
def _(one: f.FreeMotions) -> str:
    stays = "stays" if len(one.motions) == 1 else "stay"
    advice = one.face or "sense a face or an edge that resists it"
    return f"{one.part} fits, but {' and '.join(one.motions) or 'a direction'} {stays} free: {advice}."


@sentence.register
def _(one: f.NoPart) -> str:
    return "None of the parts explains the readings: add the part's file, or check units and standard deviations."


@sentence.register
def _(one: f.UnknownObject) -> str:
    return (
        f"None of the parts is the best explanation (P = {one.unknown:.2f}); the closest is {one.part} "
        f"(P = {one.probability:.2f}): sense more of it, or add the part's file."
    )


@sentence.register
def _(one: f.MostlyOnPart) -> str:
    return (
        f"The closest part is {one.part}, but {len(one.outliers)} of {_readings(one.count)} are not on it: it may be "
        f"another part (P = {one.unknown:.2f}); add its file, check the sensor's standard deviation, or expect more "
        "outliers (--outlier-rate)."
    )


def _worst(one: f.WorstReading) -> str:
    return f"{'the normal of ' if one.normal else ''}reading {one.reading}, {one.sds:.1f} sd off"


@sentence.register
def _(one: f.WorstReading) -> str:
    return f"The worst is {_worst(one)}."


@sentence.register
def _(one: f.Contradicted) -> str:
    most = f", most of all {_worst(one.worst)}" if one.worst is not None else ""
    return (
        f"The closest part is {one.part}, but the readings contradict it (p = {one.p_value:.2g}){most}: "
        "check the sensor's standard deviation, the tolerance and the units."
    )


@sentence.register
def _(one: f.PriorContradicted) -> str:
    return (
        f"The closest part is {one.part}, but it is not where it was said to be (p = {one.p_value:.2g}): "
        "check the prior pose beforehand, or leave it out and compare."
    )


@sentence.register
def _(one: f.LabelsContradicted) -> str:
    return (
        f"{one.part} fits best, but {one.outliers} of {one.count} labelled readings are not on it, more than expected: "
        "it may be another part. Check these labels, and sense more of it."
    )


@sentence.register
def _(one: f.AmongUnsearched) -> str:
    best = f"It may be {one.part}, or" if one.part else "It may be"
    return (
        f"{best} one of {one.count:,} parts that were not searched, as the readings hardly discriminate them "
        f"(up to P = {one.probability:.2f}): sense more places, with normals or labels if the sensor gives them."
    )


@sentence.register
def _(one: f.CutShort) -> str:
    return "The search was cut short: sense fewer, better spread features."


@sentence.register
def _(one: f.CloseTogether) -> str:
    return (
        "The readings lie so close together that other places may look like it: sense farther apart, or say "
        "--pose-prior."
    )


@sentence.register
def _(one: f.SharedErrorLimits) -> str:
    what = f"{one.error}, which all readings share: {1e3 * one.share:.2g} mm of the {1e3 * one.corner_sd:.2g} mm"
    limits = one.share > one.without
    says = f"What limits it is not the readings but {what}" if limits else f"Part of it is {what}"
    lessened = next((advice for source, advice in _LESSENED.items() if one.source.startswith(source)), "")
    return f"{says}. Calibrate it ({1e3 * one.without:.2g} mm are left then){lessened}."


@sentence.register
def _(one: f.Outliers) -> str:
    n = len(one.readings)
    if not n:
        return f"All of {_readings(one.count)} are on it."
    some = f"{n} of {_readings(one.count)} {'is' if n == 1 == one.count else 'are'} not on it"
    if not one.expected:
        return f"{some}, more than expected: check them, and the order of their columns."
    if n > _MOST_NAMES:
        return f"{some}."
    named = [f"{name} ({1e3 * abs(off):.2g} mm off)" for name, off in zip(one.readings, one.distances, strict=True)]
    if n == 1:
        return f"Reading {named[0]} is not on it, and was left aside: check it."
    return f"Readings {_listed(named)} are not on it, and were left aside: check them."


@sentence.register
def _(one: f.FaceDisplaced) -> str:
    agree = f"{one.count} readings agree" if one.count > 1 else "One reading says"
    where = "out" if one.offset > 0 else "in"
    return f"{agree} that {one.face} of {one.part} is {1e3 * abs(one.offset):.2g} mm farther {where}."


@sentence.register
def _(one: f.OnFurniture) -> str:
    on = [f"{count} on the {name}" for name, count in one.on] or ["none on the furniture"]
    return f"Of {_readings(one.count)} {' and '.join(on)}."


@sentence.register
def _(one: f.MissedPoses) -> str:
    return (
        f"{100 * one.probability:.0f} % of the probability is in poses that the search met only once: others may fit."
    )


@sentence.register
def _(one: f.NotSearched) -> str:
    return (
        f"{one.count:,} parts were not searched, which together may explain the readings with a probability "
        f"of up to {100 * one.probability:.0f} %: more readings, or labelled ones, tell."
    )


@sentence.register
def _(one: f.Scatter) -> str:
    says = (
        f"The readings scatter {one.scale:.2g} times as much as stated (95 %: {one.low:.2g} to {one.high:.2g}), and "
        "the covariance is of that."
    )
    if one.scale < 1:
        return says
    says += (
        " If an error that all of them share is behind it (tip, radius, calibration), the pose is less sure: state it."
    )
    return f"{says} The worst is {_worst(one.worst)} even so." if one.worst is not None else says


@sentence.register
def _(one: f.EstimatedNoise) -> str:
    sd, low, high = 1e3 * one.sd, 1e3 * one.low, 1e3 * one.high
    return f"No standard deviation was stated; the readings tell {sd:.2g} mm (95 %: {low:.2g} to {high:.2g} mm)."


@sentence.register
def _(one: f.NoNoiseStated) -> str:
    return "No standard deviation was stated: say --sd."


@sentence.register
def _(one: f.CheckPrior) -> str:
    return "The prior of the pose beforehand counts, too: check it, or leave it out and compare."


@sentence.register
def _(one: f.ThinnedReadings) -> str:
    return f"{one.used:,} of the {_readings(one.given)} were used, spread evenly over all of them."


@sentence.register
def _(one: f.WholeMismatch) -> str:
    said = []
    if one.volumes:
        stated, own = (f"{1e6 * v:.4g} cm3" for v in one.volumes)
        said.append(f"Its mass says {stated}, {one.part} has {own}: check mass, density and parts.")
    if one.sides:
        stated, own = (" x ".join(f"{1e3 * v:.4g}" for v in box) for box in one.sides)
        said.append(f"The box about it is stated as {stated} mm, that of {one.part} is {own} mm: check size and parts.")
    return " ".join(said)


@sentence.register
def _(one: f.FreeSpaceCrossed) -> str:
    off = list(zip(one.readings, one.lengths, strict=True))
    named = ", ".join(f"{name} (it ends {1e3 * length:.2g} mm further)" for name, length in off[:_MOST_NAMES])
    rest = f" and {len(off) - _MOST_NAMES} more" if len(off) > _MOST_NAMES else ""
    which = f": {named}{rest}" if named else ""
    return f"{one.part} is in the way of {len(off)} of {one.count} paths on which nothing was met{which}."


@sentence.register
def _(one: f.Repeated) -> str:
    if not one.sets:
        return "No two readings are equal."
    names = [_listed(list(ids)) for ids in one.sets[:_MOST_NAMES]]
    rest = len(one.sets) - _MOST_NAMES
    more = f" (and {rest} more such set{'s' * (rest > 1)})" if rest > 0 else ""
    return (
        f"Readings {'; '.join(names)}{more} are equal in place, direction and spread, and each counts: if they are one "
        "reading under several names, keep one, or the covariance is too small."
    )


@sentence.register
def _(one: f.Stuck) -> str:
    who = f" of '{one.sensor}'" if one.sensor else ""
    return (
        f"The {one.count} ranges {one.first} to {one.last}{who} are all {1e3 * one.range:.6g} mm, from different "
        "places: is the sensor stuck?"
    )


@sentence.register
def _(one: f.TooFarApart) -> str:
    return (
        f"Half of the readings are more than {one.distance:.3g} m from their middle, and the largest part measures "
        f"{one.widest:.3g} m: lengths are in metres."
    )


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 0.1 else f"{1e3 * metres:.3g} mm"


@sentence.register
def _(one: f.UnitsQuestion) -> str:
    guesses = [f"--units {u}" for u in one.files] + [f"columns in {u} (x_{u})" for u in one.columns]
    return (
        f"The {'largest ' if one.parts > 1 else ''}part is {_length(one.widest)} wide and the readings span about "
        f"{_length(one.span)}: did you mean {' or '.join(guesses)}?"
    )


def size_advice(units: f.UnitsQuestion | None) -> str:
    """Return what to check where readings and parts differ in size."""
    advice = "Check the units in the names of the columns and of the parts (--units)."
    return advice if units is None else f"{advice} {units.message}"


@sentence.register
def _(one: f.TooNarrow) -> str:
    return (
        f"all readings lie within {1e3 * one.within:.3g} mm, and the smallest part measures "
        f"{1e3 * one.smallest:.4g} mm. {size_advice(one.units)}"
    )


@sentence.register
def _(one: f.SpreadQuestion) -> str:
    size = "finer than any sensor" if math.isnan(one.widest) else f"{one.sd / one.widest:.0%} of the largest part"
    return (
        f"one standard deviation of the readings is {1e3 * one.sd:.3g} mm, which is {size}. Is its unit right "
        "(column sd_mm, sd_m, sd_um; --sd)?"
    )


@sentence.register
def _(one: f.DirectionsQuestion) -> str:
    return (
        f"The directions (dx, dy, dz) of {one.share:.0%} of the readings lead away from the middle of all: "
        "they are meant to point into the material, as the sensor looks or the tip moves. Did you mean the opposite?"
    )


@sentence.register
def _(one: f.NormalsQuestion) -> str:
    return (
        f"The normals (nx, ny, nz) of {one.share:.0%} of the readings point as the sensor looks (dx, dy, dz): "
        "normals are meant to point out of the material. Did you mean the opposite?"
    )


HANDED = "Are two of the columns x, y, z exchanged, or is one reversed? tanteo takes right-handed frames."
"""What to check where a mirror image fits."""


@sentence.register
def _(one: f.MirrorQuestion) -> str:
    return (
        f"The mirror image of {one.part} fits better (P = {one.probability:.3f}), with no reading left aside. {HANDED}"
    )


def _fitting(one: f.Convention | f.OffsetQuestion) -> str:
    n, fits = one.count, one.fitting
    some = ("The reading fits" if n == 1 else f"All {n} readings fit") if n == fits else f"{fits} of {n} readings fit"
    return f"{some} {one.part}"


def _tried(one: f.Convention | f.OffsetQuestion) -> str:
    return f" ({one.count} of the {_readings(one.given)} were asked about.)" if one.given else ""


@sentence.register
def _(one: f.Convention) -> str:
    return f"{_fitting(one)} if {one.meant}. {one.advice}{_tried(one)}"


@sentence.register
def _(one: f.OffsetQuestion) -> str:
    where = "farther from" if one.offset > 0 else "nearer to"
    what = "tip" if one.touched else "sensor"
    check = "check radius_mm (a radius, not a diameter) and the trigger point" if one.touched else "check its zero"
    return (
        f"{_fitting(one)} if the surface is {1e3 * abs(one.offset):.2g} mm {where} the {what} than it was read: "
        f"{check}, or state the offset as an error that all readings share (--bias-sd).{_tried(one)}"
    )


@sentence.register
def _(one: f.NothingMet) -> str:
    return "No reading has met a part yet."


@sentence.register
def _(one: f.EmptySpace) -> str:
    return "Beams went free where the part may be: check the prior pose and the parts."


@sentence.register
def _(one: f.NoPartLeft) -> str:
    return "No part explains the readings: check them, the prior pose and the parts."


@sentence.register
def _(one: f.WiderPrior) -> str:
    return "A new session with a wider prior pose can be told the same readings."


@sentence.register
def _(one: f.MovedMeanwhile) -> str:
    span = f"{one.first} to {one.last}"
    which = f"{one.outliers} of the readings {span}" if one.outliers else f"Readings {span}"
    others = f"all {'after' if one.after else 'before'} {one.fitting}"
    return f"{which} do not fit, {others} do: did the part or the sensor move?"
