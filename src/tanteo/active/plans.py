"""Plans: the fewest readings that place a part within a tolerance, known beforehand.

About the expected pose everything is linear: a reading adds information along one direction of the pose. The plan is
chosen by exchanges (Fedorov) from the last plan with a reading more and from sets drawn at random, for the mean square
error of the corners, or of the feature, the worst counting most. What readings share does not average out in it: a bias
is a state of its own, and the robot's absolute error is added at the end.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.active.design import Design, design_of
from tanteo.active.places import check_feature, places_of
from tanteo.active.plan_words import aim, from_too_rough, in_doubt, what_it_brings
from tanteo.active.probe import Probe
from tanteo.active.start import Start
from tanteo.errors import InputError
from tanteo.matching.verdict import corner_sd, observed_covariance
from tanteo.typing import Covariances, IntArray, Transforms, Vectors

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
        within: chance that all corners, or the feature, are within the tolerance after it.
        feature_sd: of the feature that the plan is for, where it is worst known, after it [m]; NaN without one.
    """

    origin: Vectors
    direction: Vectors
    point: Vectors
    face: str
    covariance: Covariances
    worst_corner_sd: float
    within: float
    feature_sd: float = float("nan")

    @property
    def sd(self) -> float:
        """Of what has to keep the tolerance, where it is worst known [m]."""
        return self.worst_corner_sd if np.isnan(self.feature_sd) else self.feature_sd


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Readings in the order in which they help most.

    Attributes:
        part: name of the part.
        T_world_part: expected pose ``(4, 4)``.
        readings: the plan.
        before: standard deviation of the worst corner, or of the feature, before the first [m].
        reached: the tolerance is kept with the confidence, by readings that meet their faces at half or more of the
            places where the part may be; also without any, if enough is known before.
        message: one sentence.
        feature: name of the one that has to keep the tolerance; None for all corners of the part's box.
    """

    part: str
    T_world_part: Transforms
    readings: tuple[PlannedReading, ...]
    before: float
    reached: bool
    message: str
    feature: str | None = None


def plan(
    start: Start,
    probe: Probe,
    tolerance: float,
    confidence: float = 0.95,
    most: int = 30,
    seed: int = 0,
    feature: str | None = None,
) -> Plan:
    """The fewest readings after which all corners, or a feature, are within a tolerance with a confidence.

    Args:
        start: one part at one rough pose (``at_pose``).
        probe: what senses.
        tolerance: of the corners of the part's box [m].
        confidence: with which they keep it.
        most: readings at most.
        seed: of the places that are tried.
        feature: ``face 3``, ``edge 4`` or ``vertex 2`` to place instead of the corners: a face along its normal, an
            edge across itself.

    Raises:
        InputError: more than one part or pose, figures that make no sense, or a feature that the part does not have.
    """
    if len(start) != 1:
        raise InputError(f"plan: expected one part at one rough pose, got {len(start)}. Plan for each.")
    if not (np.isfinite(tolerance) and tolerance > 0 and 0 < confidence < 1 and most >= 1):
        raise InputError("plan: expected a positive tolerance, a confidence between 0 and 1 and a reading at least.")
    part = start.targets[0].part
    if feature is not None:
        check_feature(feature, [part])
    design = design_of(start, probe, seed, feature)
    if design is None:
        message = f"The probe reaches no place of {part.name}: give it more room, or another approach."
        before = places_of(part, feature).sd(observed_covariance(part, start.covariances[0]))
        return Plan(part.name, start.Ts[0], (), before, False, message, feature)
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
        sd = float("nan") if design.places.feature is None else design.places.sd(pose)
        readings.append(PlannedReading(*place, pose, corner_sd(part, pose), design.chance(C, tolerance), sd))
    reached, before = readings[-1].within >= confidence, design.places.sd(design.pose(design.prior))
    last, doubt = readings[-1], in_doubt(design.meets[chosen])
    message = what_it_brings(design, len(readings), last.sd, last.within, tolerance, confidence)
    if reached and doubt:
        reached, message = False, doubt
    return Plan(part.name, start.Ts[0], tuple(readings), before, reached, message, design.places.feature)


def _nothing_to_do(start: Start, design: Design, tolerance: float, within: float) -> Plan:
    """The plan where enough is known before the first reading."""
    message = f"No reading is needed: {aim(design, tolerance)} from the beginning (P = {within:.3f})."
    name, before = design.target.part.name, design.places.sd(design.pose(design.prior))
    return Plan(name, start.Ts[0], (), before, True, message, design.places.feature)


def _too_rough(start: Start, probe: Probe, design: Design, tolerance: float, confidence: float, seed: int) -> str:
    """That from so rough a start no readings do, where they would if it were better known; empty otherwise."""
    if _does(design, tolerance, confidence) or design.chance(design.limit, tolerance) < confidence:
        return ""
    finer = replace(start, covariances=start.covariances / _BETTER**2)
    better = design_of(finer, probe, seed, design.places.feature)
    if better is None or not _does(better, tolerance, confidence):
        return ""
    return from_too_rough(design, tolerance)


def _does(design: Design, tolerance: float, confidence: float) -> bool:
    """Whether all that can be sensed, together, keeps the tolerance."""
    return design.chance(design.after(np.arange(len(design.rows))), tolerance) >= confidence
