"""Sentences on what a verdict rests on."""

from __future__ import annotations

import math

from tanteo.defaults import TIP_SD
from tanteo.words import findings as f
from tanteo.words.figures import from_surface, listed, millimetres, percent, readings
from tanteo.words.sentences.base import Words, words_of

_LESSENED = {
    "robot base": "; more readings do not lessen it, but the same robot, when it goes back, is off by the same",
    "tip offset": ", or turn the hand more between readings",
    "mounting": ", or turn the hand more between readings",
    "bias": ", or sense from more sides, opposite ones best",
    "unstated scale": "; if the machine is accurate, state it (--scale-sd 10ppm), or put the origin near the part",
    "unstated drift": "; if the machine does not drift, state it (--drift-sd 1um)",
    "unstated form": "; if the part is not bent, state it (--warp-sd 1um)",
    "unstated": "; state what is known, such as --robot, --scale-sd 10ppm, --drift-sd or --warp-sd",
    "scale": ", or sense from nearer, or from opposite sides",
}
"""What else lessens an error that all readings share, by the beginning of its name."""

_MOST_NAMES = 3
"""Number of readings that a sentence names; more are counted."""


@words_of.register
def _(one: f.CutShort) -> Words:
    return "The search was cut short.", "Sense fewer, better spread features."


@words_of.register
def _(one: f.SecondOpinion) -> Words:
    who = f"The detector's {one.part} (score {one.score:.2g})"
    if one.state == "refuted":
        return f"{who} is refuted: its probability is {percent(one.probability)}.", ""
    away = f"the answer is {millimetres(one.shift)} and {math.degrees(one.turn):.2g} deg from it"
    if one.state == "holds":
        return f"{who} holds with {percent(one.probability)}; {away}.", ""
    return f"{who} is neither confirmed nor refuted ({percent(one.probability)}); {away}.", "The next reading decides."


@words_of.register
def _(one: f.CloseTogether) -> Words:
    return (
        "The readings lie close together, and other places of the parts may look the same."
    ), "Sense places farther apart, or give a prior pose (--pose-prior)."


@words_of.register
def _(one: f.SharedErrorLimits) -> Words:
    of_faces = one.source == "face offset"
    what = (
        "the form error, which the readings of a face share" if of_faces else f"{one.error}, which all readings share"
    )
    size = f"{millimetres(one.share)} of the {millimetres(one.corner_sd)}"
    most = one.share > one.without
    text = f"{'Most' if most else 'Part'} of the uncertainty is {what}: {size}."
    if of_faces:
        return text, f"Touch other faces, or machined ones ({millimetres(one.without)} are left without this error)."
    lessened = next((advice for source, advice in _LESSENED.items() if one.source.startswith(source)), "")
    return text, f"Calibrate it ({millimetres(one.without)} are left then){lessened}."


@words_of.register
def _(one: f.Outliers) -> Words:
    n = len(one.readings)
    if not n:
        return f"All of {readings(one.count)} are on it.", ""
    some = f"{n} of {readings(one.count)} {'is' if n == 1 == one.count else 'are'} not on it"
    if not one.expected:
        return f"{some}, more than expected.", "Check them, and the order of their columns."
    if n > _MOST_NAMES:
        return f"{some}.", ""
    named = [f"{name} ({from_surface(off)})" for name, off in zip(one.readings, one.distances, strict=True)]
    if n == 1:
        return f"Reading {named[0]} is not on it, and is excluded.", "Check it."
    return f"Readings {listed(named)} are not on it, and are excluded.", "Check them."


@words_of.register
def _(one: f.FaceDisplaced) -> Words:
    agree = f"{one.count} readings agree" if one.count > 1 else "One reading states"
    where = "out" if one.offset > 0 else "in"
    return f"{agree} that {one.face} of {one.part} is {millimetres(abs(one.offset))} farther {where}.", ""


@words_of.register
def _(one: f.OnFurniture) -> Words:
    on = [f"{count} on the {name}" for name, count in one.on] or ["none on the furniture"]
    return f"Of {readings(one.count)} {' and '.join(on)}.", ""


@words_of.register
def _(one: f.OutliersOnPlane) -> Words:
    n = len(one.readings)
    named = f" ({listed(list(one.readings))})" if 0 < n <= _MOST_NAMES else ""
    return (
        f"{n} of {readings(one.count)}{named} lie on one plane beside the part: a table or a jaw?"
    ), "State it (--table, --furniture), or omit these readings."


@words_of.register
def _(one: f.OnOtherSide) -> Words:
    if not one.probability:
        nearest = f"{math.degrees(one.tilt):.3g} deg from the nearest"
        return f"{one.part} is in none of its stable poses on the table, but {nearest}.", "Check the table."
    sides = f"one with {percent(one.probability)}, not on its most probable side with {percent(one.most)}"
    return f"{one.part} lies on another side than usual: on {sides}.", ""


@words_of.register
def _(one: f.OneRegion) -> Words:
    return (
        f"All touches are in one region of {millimetres(one.extent)}; the part has a size of {millimetres(one.size)}."
    ), "Touch places far from it."


@words_of.register
def _(one: f.MissedPoses) -> Words:
    return (
        f"The search found some poses only once, so it may have missed others ({percent(one.probability)}). The "
        "probabilities contain this."
    ), ""


@words_of.register
def _(one: f.OpenSurface) -> Words:
    return (
        f"The surface of {one.part} is open: readings in its gaps fit no face."
    ), "Check the CAD file (tanteo part show), and export it again as a closed solid."


@words_of.register
def _(one: f.NotSearched) -> Words:
    return (
        f"{one.count:,} parts were not searched. Together they may explain it with a probability of up to "
        f"{percent(one.probability)}."
    ), "Give more readings, or label them."


@words_of.register
def _(one: f.Scatter) -> Words:
    about = f" about the closest part, {one.part}," if one.part else ""
    text = (
        f"The readings scatter{about} {one.scale:.2g} times as much as stated (95 %: {one.low:.2g} to {one.high:.2g})."
    )
    if one.part:
        return text, f"If it is {one.part}, state a larger standard deviation."
    text += " The covariance contains this factor."
    if one.scale < 1:
        return text, ""
    worst = f" The worst is reading {one.worst.reading}." if one.worst is not None else ""
    return (
        f"{text}{worst}"
    ), "If a shared error causes it (tip, scale, calibration), the pose is less certain: state that error."


@words_of.register
def _(one: f.CorrelatedReadings) -> Words:
    return (
        f"Neighbouring readings of the file have similar errors (correlation {one.correlation:.2f}): {one.count:,} are "
        f"as exact as about {one.independent} independent ones."
    ), "State what they share: each scan line (column line and --bias-sd group=), or the part's form (--warp-sd)."


@words_of.register
def _(one: f.AssumedTip) -> Words:
    why = f", because the readings contradict {millimetres(TIP_SD)}" if one.sd > TIP_SD else ""
    text = f"The error of the tip's offset is not stated: {millimetres(one.sd)} (1 sd) is assumed{why} (--tip-sd)."
    if not one.estimate:
        return text, ""
    offset = ", ".join(f"{1e3 * v:z.2f}" for v in one.estimate)
    sds = ", ".join(f"{1e3 * v:.2f}" for v in one.sds)
    return f"{text} Its estimate in the hand is ({offset}) +- ({sds}) mm.", ""


@words_of.register
def _(one: f.AssumedAngles) -> Words:
    what = f"The mounting error of {listed([*one.devices]) or 'the range sensors'} is not stated"
    angle = f"{math.degrees(one.sd):.1g} deg (1 sd)"
    return f"{what}: {angle} is assumed for each angle (mount_turn_sd_deg in the rig, or --fan-sd).", ""


@words_of.register
def _(one: f.EstimatedNoise) -> Words:
    if math.isnan(one.sd):
        return "No standard deviation is stated.", "State it (--sd)."
    sd, low, high = millimetres(one.sd), millimetres(one.low), millimetres(one.high)
    return f"No standard deviation is stated. The estimate from the readings is {sd} (95 %: {low} to {high}).", ""


@words_of.register
def _(one: f.SharedEstimates) -> Words:
    rows = zip(one.names, one.values, one.sds, one.units, one.prior_sds, strict=True)
    each = [
        _estimate(name, value, sd, unit)
        for name, value, sd, unit, prior in rows
        if 2 * sd**2 < prior**2  # the readings outweigh the prior
    ]
    if not each:
        return "", ""
    more = f" and {len(each) - _MOST_ESTIMATES} more" if len(each) > _MOST_ESTIMATES else ""
    return f"Estimates: {'; '.join(each[:_MOST_ESTIMATES])}{more}.", ""


_MOST_ESTIMATES = 8


def _estimate(name: str, value: float, sd: float, unit: str) -> str:
    """Return an estimate with its standard deviation."""
    scale, shown = {"m": (1e3, " mm"), "rad": (180 / math.pi, " deg")}.get(unit, (1.0, ""))
    digits = max(0, 1 - math.floor(math.log10(max(scale * sd, 1e-12))))
    return f"{name} {round(scale * value, digits) + 0.0:.{digits}f} +- {scale * sd:.2g}{shown}"


@words_of.register
def _(one: f.CheckPrior) -> Words:
    return "The answer depends on the prior pose, too.", "Check it, or omit it and compare."


@words_of.register
def _(one: f.ThinnedReadings) -> Words:
    return f"{one.used:,} of the {readings(one.given)} were used, spread evenly over all of them.", ""


@words_of.register
def _(one: f.WholeMismatch) -> Words:
    text, advice = [], []
    if one.volumes:
        stated, own = (f"{1e6 * v:.4g} cm3" for v in one.volumes)
        text.append(f"The mass corresponds to {stated}, the volume of {one.part} is {own}.")
        advice.append("Check mass, density and parts.")
    if one.sides:
        stated, own = (" x ".join(f"{1e3 * v:.4g}" for v in box) for box in one.sides)
        text.append(f"The stated box is {stated} mm, the box of {one.part} is {own} mm.")
        advice.append("Check size and parts.")
    return " ".join(text), " ".join(advice)


@words_of.register
def _(one: f.FreeSpaceCrossed) -> Words:
    off = list(zip(one.readings, one.lengths, strict=True))
    named = ", ".join(f"{name} (by {millimetres(length)})" for name, length in off[:_MOST_NAMES])
    rest = f" and {len(off) - _MOST_NAMES} more" if len(off) > _MOST_NAMES else ""
    which = f": {named}{rest}" if named else ""
    return f"{one.part} blocks {len(off)} of {one.count} free-space paths{which}.", ""
