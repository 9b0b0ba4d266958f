"""Sentences of plans, and of a reading that discriminates two parts."""

from __future__ import annotations

import math

from tanteo.words import findings as f
from tanteo.words.figures import listed, millimetres
from tanteo.words.sentences.base import Words, words_of

_SURE = 0.6
"""Information from which a reading decides between two parts [nats]; ln 2 = 0.69 is all there is."""

_HARDLY = 0.05
"""Information below which no reading discriminates two parts [nats]."""

_SESSION = (
    "sense in a session, which evaluates each reading before it chooses the next one (tanteo probe; tanteo next for "
    "readings made by hand)"
)


def _aim(goal: f.PlanGoal) -> str:
    """Return what has to keep which tolerance."""
    what = f"{goal.feature} of {goal.part}" if goal.feature else f"all corners of {goal.part}"
    return f"{what} within {millimetres(goal.tolerance, 3 if goal.tolerance < 1 else 15)}"


def _spread(goal: f.PlanGoal, sd: float) -> str:
    """Return the uncertainty of the goal's worst place."""
    return f"sd of {goal.feature} {millimetres(sd)}" if goal.feature else f"largest corner sd {millimetres(sd)}"


_SMALLER = (
    "The readings show whether these errors are large: check the answer with --need, or use a session, which goes on "
    "until the goal is kept with them. State smaller ones with --scale-sd, --drift-sd or --warp-sd."
)
"""Advice for a plan whose goal the assumed errors may prevent."""

_NOTABLE = 0.01
"""Loss of probability by assumed errors below which no advice is given."""


def _at_least(p: float) -> str:
    """Return a probability that is rounded down, so that it does not appear to reach a demanded one."""
    return f"{math.floor(1e3 * p) / 1e3:.3f}"


def _in_session(enough: int) -> str:
    """Return how many readings suffice if none misses; empty if that is not known."""
    if not enough:
        return ""
    return (
        f" {enough} suffice where all hit; the others replace misses. A session, which aims each reading by the "
        f"results before it, needs {enough} or a few more."
    )


@words_of.register
def _(one: f.NoReadingNeeded) -> Words:
    return f"No reading is needed: the prior pose has {_aim(one.goal)} (P = {one.within:.3f}).", ""


@words_of.register
def _(one: f.PlanResult) -> Words:
    hit = f"{one.if_all_meet:.3f} if every reading hits its face, as at {one.all_meet:.0%} of the placements"
    within = f"{one.within:.3f}" if one.reached else _at_least(one.within)
    chances = f"P = {within} over all placements; {hit}"
    after = f"After them: {_spread(one.goal, one.sd)}."
    if not math.isnan(one.within_assumed):
        after += f" With a scale error, drift and warp as locate assumes them: P = {_at_least(one.within_assumed)}."
    after += _in_session(one.in_session) if one.in_session < one.count else ""
    smaller = _SMALLER if one.within_assumed < one.within - _NOTABLE else ""
    places = "1 reading places" if one.count == 1 else f"{one.count} readings place"
    if one.reached:
        return f"{places} {_aim(one.goal)} ({chances}). {after}", smaller
    text = f"{places.replace(' place', ' do not place').replace('do not places', 'does not place')} {_aim(one.goal)}"
    more = f"a better prior pose, or {_SESSION}" if one.better_start else "a better sensor, or another approach"
    return f"{text} ({chances}). {after}", f"Allow more readings, use {more}."


@words_of.register
def _(one: f.SystematicErrorLimits) -> Words:
    source, advice = _SHARED.get(
        one.source, (f"the stated error '{one.source}'", "Calibrate it, and state what is left.")
    )
    return f"{_out_of_reach(one)}, mostly by {source}.", f"{_larger(one)} {advice}"


@words_of.register
def _(one: f.ReachLimits) -> Words:
    return (
        f"{_out_of_reach(one)}, because the faces that the probe reaches leave a direction free."
    ), f"{_larger(one)} Allow more directions of approach or more space, or give a better prior pose (--pose-prior)."


_SHARED = {
    "robot": (
        "the error of robot and tip",
        "Calibrate them (--robot, --tip-sd), or sense relative to an object whose place matters.",
    ),
    "bias": ("the bias of the sensor", "Calibrate it (--bias-sd), or sense from opposite sides."),
    "form": (
        "the form error of the part",
        "Touch machined faces only, or state a smaller --form-sd if the part has one.",
    ),
}
"""Shared error that limits a plan, and advice, by source."""


def _out_of_reach(one: f.SystematicErrorLimits | f.ReachLimits) -> str:
    """Return that no number of readings reaches a goal, and what is left in the limit."""
    return f"No number of readings places {_aim(one.goal)}: {_spread(one.goal, one.sd)} is left after very many"


def _larger(one: f.SystematicErrorLimits | f.ReachLimits) -> str:
    """Return the goals that are possible."""
    return f"Plan for more than {millimetres(one.least)} (--goal)."


@words_of.register
def _(one: f.PriorTooWide) -> Words:
    return (
        f"No readings that are planned beforehand place {_aim(one.goal)}. The prior pose is too uncertain "
        f"({_spread(one.goal, one.sd)}), so that useful readings may miss their faces (P = {_at_least(one.within)})."
        f"{_in_session(one.in_session)}"
    ), f"Give a better prior pose, or {_SESSION}."


@words_of.register
def _(one: f.FaceOftenMissed) -> Words:
    return (
        f"The prior pose is too uncertain: reading {one.reading} would hit its face at {one.meets:.0%} of the "
        f"placements (P = {_at_least(one.within)})."
    ), "Give a better prior pose before you plan."


@words_of.register
def _(one: f.StartTooClose) -> Words:
    return (
        f"At {one.fraction:.0%} of the placements a start, or the path to it, is within "
        f"{millimetres(one.clearance, 3)} of the part, or inside it. These readings do not count."
    ), "Start farther away (--standoff), with less clearance (--clearance), or give a better prior pose."


@words_of.register
def _(one: f.ReadingDiscriminates) -> Words:
    first, second = one.parts
    reads = [
        ("no surface" if math.isinf(r) else f"{1e3 * r:.2f} mm") + ("" if e in (0, 1) else f", {e:.0%} of the time")
        for r, e in zip(one.ranges, one.echoes, strict=True)
    ]
    if one.information < _HARDLY:
        same = reads[0] == reads[1]
        both = f"{reads[0]} for both" if same else f"{listed(reads)}, a difference below its noise"
        return f"No single reading of this sensor discriminates {first} and {second}: the best one gives {both}.", ""
    sure = "hardly discriminates" if one.information < one.LEAST else "helps to discriminate"
    verb = "discriminates" if one.information > _SURE else sure
    return f"This reading {verb} {first} (expected: {reads[0]}) and {second} (expected: {reads[1]}).", ""
