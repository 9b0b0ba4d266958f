"""Plans: the fewest readings that place a part within a tolerance, known beforehand.

About the expected pose everything is linear: a reading adds information along one direction of the pose. The plan is
chosen by exchanges (Fedorov) from the last plan with a reading more and from sets drawn at random, for the mean square
error of the corners, or of the feature, the worst counting most. What readings share does not average out in it: a bias
is a state of its own, and the robot's absolute error is added at the end. Then placements are drawn from what is known
beforehand, at each of which only the readings count that meet their faces: readings are exchanged and added until the
tolerance is kept over all of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import Covariances, IntArray, Transforms, Vectors
from tanteo.planning.choosing import choose
from tanteo.planning.design import Design, design_of
from tanteo.planning.placements import Promise
from tanteo.planning.places import check_feature, places_of
from tanteo.planning.probe import Probe
from tanteo.planning.start import Start
from tanteo.posterior import corner_sd, observed_covariance
from tanteo.words import Finding, message_of
from tanteo.words.findings import (
    FaceOftenMissed,
    NoPlaceReached,
    NoReadingNeeded,
    PlanGoal,
    PlanResult,
    PriorTooWide,
    RobotErrorLimits,
    StartTooClose,
)

_BETTER = 10.0
"""Times better that the start would be known, to see whether it is what stands in the way."""

_LESS_STEADY = (0.8, 0.95), (0.5, 0.9)
"""Shares of the placements at which a reading must meet its face, and have room, where steadier ones do not do."""

_WORTH = 0.02
"""Chance that those must add, if they do not do either."""

_DOUBTFUL = 0.5
"""Probability of the tolerance, and fraction of placements at which a reading meets its face. A plan with less of both
does not count."""

_FREE = 0.99
"""Fraction of placements with free starts above which no remark is made."""

_LESS = 0.5, 0.25, 0.1
"""Clearances that are tried where no place is reached, in stand-offs."""


@dataclass(frozen=True, slots=True, eq=False)
class PlannedReading:
    """One reading of a plan.

    Attributes:
        origin: from where to look or move, world ``(3,)`` [m].
        direction: in which, unit, world ``(3,)``.
        point: expected on the surface, world ``(3,)`` [m].
        face: name of the face.
        covariance: of the pose after it ``(6, 6)``, part frame [m, rad].
        corner_sd: after it [m].
        within: chance that all corners, or the feature, are within the tolerance after it, wherever the part turns
            out to lie: only those of the readings count that meet their faces there.
        within_if_met: the same if it and all before meet their faces, as the covariance has it.
        meets: share of the placements at which it meets its face.
        feature_sd: of the feature that the plan is for, where it is worst known, after it [m]; NaN without one.
    """

    origin: Vectors
    direction: Vectors
    point: Vectors
    face: str
    covariance: Covariances
    corner_sd: float
    within: float
    within_if_met: float
    meets: float
    feature_sd: float = float("nan")

    @property
    def sd(self) -> float:
        """Of what has to keep the tolerance, where it is worst known [m]."""
        return self.corner_sd if np.isnan(self.feature_sd) else self.feature_sd


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Readings in the order in which they help most.

    Attributes:
        part: name of the part.
        T_world_part: expected pose ``(4, 4)``.
        readings: the plan.
        before: standard deviation of the largest corner sd, or of the feature, before the first [m].
        reached: the tolerance is kept with the confidence wherever the part turns out to lie, by readings that meet
            their faces at half or more of the placements; also without any, if enough is known before.
        findings: what the plan achieves, or why there is none.
        feature: name of the one that has to keep the tolerance; None for all corners of the part's box.
        all_meet: share of the placements at which every reading meets its face.
        room: share of the placements at which all starts, and the ways there, are clear of the part.
    """

    part: str
    T_world_part: Transforms
    readings: tuple[PlannedReading, ...]
    before: float
    reached: bool
    findings: tuple[Finding, ...]
    feature: str | None = None
    all_meet: float = 1.0
    room: float = 1.0

    @property
    def message(self) -> str:
        """The findings in words."""
        return message_of(self.findings)


def plan(
    start: Start,
    probe: Probe,
    tolerance: float,
    confidence: float = 0.95,
    max_measurements: int = 30,
    seed: int = 0,
    feature: str | None = None,
) -> Plan:
    """The fewest readings after which all corners, or a feature, are within a tolerance with a confidence.

    Args:
        start: one part at one prior pose (``at_pose``).
        probe: what senses.
        tolerance: of the corners of the part's box [m].
        confidence: with which they keep it, wherever the part turns out to lie.
        max_measurements: readings at most.
        seed: of the places that are tried.
        feature: ``face 3``, ``edge 4`` or ``vertex 2`` to place instead of the corners: a face along its normal, an
            edge across itself.

    Raises:
        InputError: more than one part or pose, figures that make no sense, or a feature that the part does not have.

    Example:
        >>> import numpy as np
        >>> part = tanteo.read_part("parts/block.step")
        >>> place = tanteo.around([part], np.eye(4), np.diag([1e-6] * 3 + [1e-4] * 3))
        >>> found = tanteo.plan(place, tanteo.probe_of("keyence_il300"), tolerance=0.5e-3)
        >>> len(found.readings) >= 6
        True
    """
    if len(start) != 1:
        raise InputError(f"plan: expected one part at one prior pose, got {len(start)}. Plan for each.")
    if not (np.isfinite(tolerance) and tolerance > 0 and 0 < confidence < 1 and max_measurements >= 1):
        raise InputError("plan: expected a positive tolerance, a confidence between 0 and 1 and a reading at least.")
    part = start.targets[0].part
    if feature is not None:
        check_feature(feature, [part])
    design = design_of(start, probe, seed, feature)
    if design is None:
        before = places_of(part, feature).sd(observed_covariance(part, start.covariances[0]))
        return Plan(part.name, start.Ts[0], (), before, False, (_no_place(start, probe, seed),), feature)
    if (within := design.chance(design.prior, tolerance)) >= confidence:
        return _nothing_to_do(start, design, tolerance, within)
    design, chosen, can = _steadiest(start, probe, tolerance, confidence, max_measurements, seed, design)
    found = _as_plan(start, design, chosen, tolerance, confidence)
    if not (found.reached or can) and (
        wide := _too_wide_a_prior(start, probe, design, found, tolerance, confidence, seed)
    ):
        found = replace(found, findings=(wide,))
    if found.room <= _FREE:
        close = StartTooClose(1 - found.room, design.probe.clearance)
        found = replace(found, findings=(*found.findings, close))
    return found


def _steadiest(
    start: Start, probe: Probe, tolerance: float, confidence: float, max_measurements: int, seed: int, design: Design
) -> tuple[Design, IntArray, bool]:
    """The problem with readings that are as steady as may be, what is chosen, and whether all of them would do."""
    can = design.best(tolerance)
    chosen = choose(design, tolerance, confidence, max_measurements, can=can >= confidence)
    for steady, room in _LESS_STEADY:
        if (kept := design.kept(chosen, tolerance)) >= confidence:
            break
        other = design_of(start, probe, seed, design.places.feature, steady, room)
        if other is None or (best := other.best(tolerance)) < max(can, kept) + _WORTH * (best < confidence):
            continue
        now = choose(other, tolerance, confidence, max_measurements, can=best >= confidence)
        if other.kept(now, tolerance) >= min(kept + _WORTH, confidence):
            design, chosen, can = other, now, best
    return design, chosen, can >= confidence


def _as_plan(start: Start, design: Design, chosen: IntArray, tolerance: float, confidence: float) -> Plan:
    part, c, meets = design.target.part, design.candidates, design.judged_by.meets
    readings = []
    for n, k in enumerate(chosen):
        pose, brings = design.pose(design.after(chosen[: n + 1])), design.promise(chosen[: n + 1], tolerance)
        place = c.origins[k], c.directions[k], design.points[k], part.faces[design.faces[k]].name
        sd = float("nan") if design.places.feature is None else design.places.sd(pose)
        chances = brings.within, brings.if_met, float(meets[:, k].mean())
        readings.append(PlannedReading(*place, pose, corner_sd(part, pose), *chances, sd))
    reached, before = brings.within >= confidence, design.places.sd(design.pose(design.prior))
    finding: Finding = _result(design, readings, brings, tolerance, confidence)
    worst = int(np.argmin([r.meets for r in readings]))
    if brings.if_met >= confidence and max(readings[worst].meets, brings.within) < _DOUBTFUL:
        reached, finding = False, FaceOftenMissed(worst + 1, readings[worst].meets, brings.within)
    what = part.name, start.Ts[0], tuple(readings), before, reached, (finding,), design.places.feature
    return Plan(*what, brings.all_meet, brings.room)


def _goal(design: Design, tolerance: float) -> PlanGoal:
    """Return the goal of a plan."""
    return PlanGoal(design.target.part.name, design.places.feature or "", tolerance)


def _result(
    design: Design, readings: list[PlannedReading], brings: Promise, tolerance: float, confidence: float
) -> PlanResult | RobotErrorLimits:
    """Return what the readings of a plan achieve, or that the error of the robot is too large for any number."""
    goal, reached = _goal(design, tolerance), brings.within >= confidence
    if not reached and design.chance(design.limit, tolerance) < confidence:
        return RobotErrorLimits(goal, design.places.sd(design.limit))
    return PlanResult(
        goal, reached, len(readings), readings[-1].sd, brings.within, brings.if_met, brings.all_meet,
        brings.if_met >= confidence,
    )  # fmt: skip


def _nothing_to_do(start: Start, design: Design, tolerance: float, within: float) -> Plan:
    """The plan where enough is known before the first reading."""
    finding = NoReadingNeeded(_goal(design, tolerance), within)
    name, before = design.target.part.name, design.places.sd(design.pose(design.prior))
    return Plan(name, start.Ts[0], (), before, True, (finding,), design.places.feature)


def _no_place(start: Start, probe: Probe, seed: int) -> NoPlaceReached:
    """Return that no place is reached, with a smaller clearance at which some are, if there is one."""
    parts = (start.targets[0].part.name,)
    for share in _LESS:
        clearance = float(f"{share * probe.standoff:.2g}")
        if clearance < probe.clearance and design_of(start, replace(probe, clearance=clearance), seed) is not None:
            return NoPlaceReached(parts, probe.standoff, probe.clearance, clearance)
    return NoPlaceReached(parts)


def _too_wide_a_prior(
    start: Start, probe: Probe, design: Design, found: Plan, tolerance: float, confidence: float, seed: int
) -> PriorTooWide | None:
    """Return that the prior pose is too uncertain, if readings from a better known one reach the goal; else None."""
    if design.chance(design.limit, tolerance) < confidence:
        return None
    finer = replace(start, covariances=start.covariances / _BETTER**2)
    better = design_of(finer, probe, seed, design.places.feature)
    if better is None or better.best(tolerance) < confidence:
        return None
    sd = design.places.sd(design.pose(design.prior))
    return PriorTooWide(_goal(design, tolerance), sd, found.readings[-1].within)
