"""Plans: the fewest readings that place a part within a tolerance, known beforehand.

About the expected pose everything is linear: a reading adds information along one direction of the pose. The plan is
chosen by exchanges (Fedorov) from the last plan with a reading more and from sets drawn at random, for the mean square
error of the corners, the worst counting most. What readings share does not average out in it: a bias is a state of its
own, and the robot's absolute error is added at the end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.active.design import Design, design_of
from tanteo.active.probe import Probe
from tanteo.active.start import Start
from tanteo.errors import InputError
from tanteo.matching.verdict import corner_sd, observed_covariance
from tanteo.typing import Covariances, FloatArray, IntArray, Transforms, Vectors

_DOUBTFUL = 0.5
"""A plan with a reading that meets its face at a smaller share of them keeps nothing."""

_BETTER = 10.0
"""Times better that the start would be known, to see whether it is what stands in the way."""

_SWEEPS, _STARTS = 6, 12
"""Rounds of exchanges, and sets drawn at random that are exchanged as well: one alone may end at a poor one."""


@dataclass(frozen=True, slots=True, eq=False)
class PlannedReading:
    """One reading of a plan.

    Attributes:
        origin: from where to look or move, world ``(3,)`` [m].
        direction: in which, unit, world ``(3,)``.
        point: expected on the surface, world ``(3,)`` [m].
        face: name of the face.
        covariance: of the pose after it ``(6, 6)``, part frame [m, rad].
        worst_corner_sd: after it [m].
        within: chance that all corners are within the tolerance after it.
    """

    origin: Vectors
    direction: Vectors
    point: Vectors
    face: str
    covariance: Covariances
    worst_corner_sd: float
    within: float


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Readings in the order in which they help most.

    Attributes:
        part: name of the part.
        T_world_part: expected pose ``(4, 4)``.
        readings: the plan.
        before: worst corner's standard deviation before the first [m].
        reached: the tolerance is kept with the confidence, by readings that meet their faces at half or more of the
            places where the part may be; also without any, if enough is known before.
        message: one sentence.
    """

    part: str
    T_world_part: Transforms
    readings: tuple[PlannedReading, ...]
    before: float
    reached: bool
    message: str


def plan(start: Start, probe: Probe, tolerance: float, confidence: float = 0.95, most: int = 30, seed: int = 0) -> Plan:
    """The fewest readings after which all corners are within a tolerance with a confidence.

    Args:
        start: one part at one rough pose (``at_pose``).
        probe: what senses.
        tolerance: of the corners of the part's box [m].
        confidence: with which they keep it.
        most: readings at most.
        seed: of the places that are tried.

    Raises:
        InputError: more than one part or pose, or figures that make no sense.
    """
    if len(start) != 1:
        raise InputError(f"plan: expected one part at one rough pose, got {len(start)}. Plan for each.")
    if not (np.isfinite(tolerance) and tolerance > 0 and 0 < confidence < 1 and most >= 1):
        raise InputError("plan: expected a positive tolerance, a confidence between 0 and 1 and a reading at least.")
    design = design_of(start, probe, seed)
    if design is None:
        part = start.targets[0].part
        message = f"The probe reaches no place of {part.name}: give it more room, or another approach."
        return Plan(
            part.name, start.Ts[0], (), corner_sd(part, observed_covariance(part, start.covariances[0])), False, message
        )
    if (within := design.chance(design.prior, tolerance)) >= confidence:
        return _nothing_to_do(start, design, tolerance, within)
    chosen = _chosen(design, tolerance, confidence, most)
    found = _as_plan(start, design, chosen, tolerance, confidence)
    if not found.reached and (why := _too_rough(start, probe, design, tolerance, confidence, seed)):
        return replace(found, message=why)
    return found


def _chosen(design: Design, tolerance: float, confidence: float, most: int) -> IntArray:
    """The fewest candidates that keep the tolerance, or the best of the most that are allowed."""
    chosen: list[int] = []
    while len(chosen) < min(most, len(design.rows)):
        starts = [_extended(design, chosen), *_drawn(len(design.rows), len(chosen) + 1)]
        chosen = min((_exchanged(design, start) for start in starts), key=design.cost_of)
        if design.chance(design.after(np.array(chosen)), tolerance) >= confidence:
            break
        if design.chance(design.limit, tolerance) < confidence:
            break  # the robot's own error is too large for any number of readings
    return _ordered(design, chosen)


def _drawn(count: int, n: int) -> list[list[int]]:
    """Sets of ``n`` candidates, the same every time."""
    rng = np.random.default_rng((1991, n))
    return [rng.choice(count, n, replace=False).tolist() for _ in range(_STARTS)]


def _extended(design: Design, chosen: list[int]) -> list[int]:
    cost = design.with_each(design.after(np.array(chosen, dtype=np.int64)))
    cost[chosen] = np.inf
    return [*chosen, int(np.argmin(cost))]


def _exchanged(design: Design, chosen: list[int]) -> list[int]:
    """No swap of one reading makes it better."""
    cost = design.cost_of(chosen)
    for _ in range(_SWEEPS):
        before = cost
        for k in range(len(chosen)):
            others = chosen[:k] + chosen[k + 1 :]
            costs = design.with_each(design.after(np.array(others, dtype=np.int64)))
            costs[others] = np.inf
            j = int(np.argmin(costs))
            if costs[j] < cost * (1 - 1e-9):
                chosen, cost = [*chosen[:k], j, *chosen[k + 1 :]], float(costs[j])
        if cost > before * (1 - 1e-3):
            break
    return chosen


def _ordered(design: Design, chosen: list[int]) -> IntArray:
    """The reading that helps most first."""
    order: list[int] = []
    left = list(chosen)
    while left:
        cost = design.with_each(design.after(np.array(order, dtype=np.int64)))
        order.append(min(left, key=lambda k: cost[k]))
        left.remove(order[-1])
    return np.array(order, dtype=np.int64)


def _as_plan(start: Start, design: Design, chosen: IntArray, tolerance: float, confidence: float) -> Plan:
    part, c = design.target.part, design.candidates
    readings = []
    for n, k in enumerate(chosen):
        C = design.after(chosen[: n + 1])
        pose = design.pose(C)
        place = c.origins[k], c.directions[k], design.points[k], part.faces[design.faces[k]].name
        readings.append(PlannedReading(*place, pose, corner_sd(part, pose), design.chance(C, tolerance)))
    reached, before = readings[-1].within >= confidence, corner_sd(part, design.pose(design.prior))
    message = _message(design, readings, tolerance, confidence, reached)
    if reached and (doubt := _doubt(design.meets[chosen])):
        reached, message = False, doubt
    return Plan(part.name, start.Ts[0], tuple(readings), before, reached, message)


def _nothing_to_do(start: Start, design: Design, tolerance: float, within: float) -> Plan:
    """The plan where enough is known before the first reading."""
    part = design.target.part
    message = f"No reading is needed: {_aim(design, tolerance)} from the beginning (P = {within:.3f})."
    return Plan(part.name, start.Ts[0], (), corner_sd(part, design.pose(design.prior)), True, message)


def _doubt(meets: FloatArray) -> str:
    """Why the plan keeps nothing, where a reading may well miss its face; empty where none does."""
    k = int(np.argmin(meets))
    if meets[k] >= _DOUBTFUL:
        return ""
    return (
        f"The part may be anywhere: reading {k + 1} would meet its face in {meets[k]:.0%} of the cases. Find out "
        "better where it is before you plan."
    )


def _too_rough(start: Start, probe: Probe, design: Design, tolerance: float, confidence: float, seed: int) -> str:
    """That from so rough a start no readings do, where they would if it were better known; empty otherwise."""
    if _does(design, tolerance, confidence) or design.chance(design.limit, tolerance) < confidence:
        return ""
    better = design_of(replace(start, covariances=start.covariances / _BETTER**2), probe, seed)
    if better is None or not _does(better, tolerance, confidence):
        return ""
    before = corner_sd(design.target.part, design.pose(design.prior))
    return (
        f"No readings that are chosen beforehand bring {_aim(design, tolerance)}: with a start so rough (worst corner "
        f"{1e3 * before:.2g} mm, 1 sd) those that would help may miss their faces. Find out better where it is, or "
        "sense in a session, which chooses each reading by those before."
    )


def _does(design: Design, tolerance: float, confidence: float) -> bool:
    """Whether all that can be sensed, together, keeps the tolerance."""
    return design.chance(design.after(np.arange(len(design.rows))), tolerance) >= confidence


def _aim(design: Design, tolerance: float) -> str:
    return f"all corners of {design.target.part.name} within {1e3 * tolerance:.{3 if tolerance < 1 else 15}g} mm"


def _message(design: Design, readings: list[PlannedReading], tolerance: float, confidence: float, reached: bool) -> str:
    n, last, aim = len(readings), readings[-1], _aim(design, tolerance)
    if reached:
        worst = f"worst corner {1e3 * last.worst_corner_sd:.2g} mm, 1 sd"
        count = "1 reading brings" if n == 1 else f"{n} readings bring"
        return f"{count} {aim} (P = {last.within:.3f}); {worst}."
    if design.chance(design.limit, tolerance) < confidence:
        never = corner_sd(design.target.part, design.limit)
        return (
            f"No number of readings brings {aim}: the robot's own error moves the worst corner by "
            f"{1e3 * never:.2g} mm (1 sd). Calibrate the robot, or sense relative to something that it must meet."
        )
    count = "1 reading does" if n == 1 else f"{n} readings do"
    least = np.floor(1e3 * last.within) / 1e3  # what is not reached is not rounded up to it
    return (
        f"{count} not bring {aim} (P = {least:.3f}); worst corner {1e3 * last.worst_corner_sd:.2g} mm, "
        "1 sd. Allow more readings, a better sensor, or another approach."
    )
