"""Plans: the smallest set of readings, chosen beforehand, that locates a part within a tolerance.

Near the expected pose the problem is linear: each reading adds information along one direction of the pose. An exchange
algorithm (Fedorov 1972) chooses the set. It starts from the previous set with one more reading, and from random sets.
It minimizes the mean square error of the corners or of the feature, with most weight on the worst point. The bias of
the sensor, the error of the robot base and the offsets of the made part's faces are states of the problem, because
readings that share them do not average them out.

Then placements of the part are sampled from the prior. At each of them only the readings that hit their faces count.
Readings are exchanged and added until the tolerance holds over all placements.
"""

from __future__ import annotations

from collections.abc import Sequence
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
from tanteo.planning.state import begin
from tanteo.planning.unreached import no_place
from tanteo.posterior.answers import corner_sd, observed_covariance
from tanteo.sensors.error_states import ErrorState
from tanteo.values import Value
from tanteo.words import Finding, message_of
from tanteo.words.findings import (
    FaceOftenMissed,
    NoReadingNeeded,
    PlanGoal,
    PlanResult,
    PriorTooWide,
    ReachLimits,
    StartTooClose,
    SystematicErrorLimits,
)

_BETTER = 10.0
"""Factor by which the prior standard deviations are divided to test whether the prior prevents the goal."""

_LESS_STEADY = (0.8, 0.95), (0.5, 0.9)
"""Pairs of fractions of the placements at which a reading must hit its face and be clear, tried in this order after the
stricter defaults."""

_WORTH = 0.02
"""Smallest gain of probability that justifies the weaker fractions if they do not reach the goal either."""

_DOUBTFUL = 0.5
"""A plan does not count as reached if the probability of the tolerance and the smallest fraction of hits are below
this."""

_FREE = 0.99
"""Fraction of placements with clear approaches above which no remark is made."""


@dataclass(frozen=True, slots=True, eq=False)
class PlannedReading:
    """One reading of a plan.

    Attributes:
        origin: start of the beam or motion, world frame ``(3,)`` [m].
        direction: unit direction, world frame ``(3,)``.
        point: point expected on the surface, world frame ``(3,)`` [m].
        face: name of the face.
        covariance: covariance of the pose after this and all earlier readings, part frame ``(6, 6)`` [m, rad].
        corner_sd: largest corner sd after this reading [m].
        within: probability of the tolerance after this reading, over all placements; only readings that hit their
            faces count.
        within_if_hit: probability of the tolerance if this and all earlier readings hit their faces, as the covariance
            assumes.
        meets: fraction of the placements at which the reading hits its face.
        feature_sd: largest sd of the plan's feature after this reading [m]; NaN without a feature.
    """

    origin: Vectors
    direction: Vectors
    point: Vectors
    face: str
    covariance: Covariances
    corner_sd: float
    within: float
    within_if_hit: float
    meets: float
    feature_sd: float = float("nan")

    @property
    def sd(self) -> float:
        """Largest sd of the points to which the tolerance applies: the corners or the feature [m]."""
        return self.corner_sd if np.isnan(self.feature_sd) else self.feature_sd


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plan(Value):
    """Planned readings, in the order of their benefit.

    Attributes:
        part: name of the part.
        T_world_part: expected pose of the part ``(4, 4)``.
        readings: planned readings; empty if none are needed, or if no number of readings reaches the goal.
        before: largest corner sd, or sd of the feature, before the first reading [m].
        reached: whether the tolerance has the required confidence over all placements, and each reading hits its face
            at half of the placements or more. It is also true if the prior pose suffices.
        findings: what the plan achieves, or why there is none.
        feature: feature to which the tolerance applies; None for all corners of the part's box.
        all_meet: fraction of the placements at which every reading hits its face.
        all_clear: fraction of the placements at which all starts and approach paths are clear of the part.
    """

    part: str
    T_world_part: Transforms
    readings: tuple[PlannedReading, ...]
    before: float
    reached: bool
    findings: tuple[Finding, ...]
    feature: str | None = None
    all_meet: float = 1.0
    all_clear: float = 1.0

    @property
    def message(self) -> str:
        """Text of the findings."""
        return message_of(self.findings)


def plan(
    start: Start,
    probe: Probe,
    tolerance: float,
    confidence: float = 0.95,
    max_measurements: int = 30,
    seed: int = 0,
    feature: str | None = None,
    shared_errors: Sequence[ErrorState] = (),
) -> Plan:
    """Plan the smallest set of readings that locates all corners of a part, or one feature, within a tolerance.

    Args:
        start: one part at one prior pose, see :func:`at_pose`.
        probe: sensor model.
        tolerance: largest deviation of the corners of the part's box [m].
        confidence: required probability of the tolerance over all placements.
        max_measurements: largest number of readings.
        seed: seed of the random surface points.
        feature: ``face 3``, ``edge 4`` or ``vertex 2`` to which the tolerance applies instead of the corners: for a
            face along its normal, for an edge across its direction.
        shared_errors: further errors that the readings share, such as ``Scale(1e-4)``; see
            :mod:`tanteo.sensors.error_states`. They replace those that :func:`tanteo.locate` assumes.

    Raises:
        InputError: there is more than one part or pose, a number is invalid, or the part lacks the feature.

    Example:
        >>> import numpy as np
        >>> part = tanteo.read_part("parts/block.step")
        >>> place = tanteo.at_place([part], np.eye(4), np.diag([1e-6] * 3 + [1e-4] * 3))
        >>> found = tanteo.plan(place, tanteo.probe_of("keyence_il300"), tolerance=0.5e-3)
        >>> len(found.readings) >= 6
        True
    """
    if len(start) != 1:
        raise InputError(f"plan: expected one part at one prior pose, got {len(start)}. Plan for each.")
    if not (np.isfinite(tolerance) and tolerance > 0 and 0 < confidence < 1 and max_measurements >= 1):
        raise InputError("plan: expected a positive tolerance, a confidence between 0 and 1, and at least one reading.")
    part = start.targets[0].part
    if feature is not None:
        check_feature(feature, [part])
    stated = tuple(shared_errors)
    design = design_of(start, probe, seed, feature, stated)
    if design is None:
        before = places_of(part, feature).sd(observed_covariance(part, start.covariances[0]))
        return Plan(
            part.name, start.Ts[0], (), before, False, (no_place(begin(start), probe, seed, (part.name,)),), feature
        )
    if (within := design.chance(design.prior, tolerance)) >= confidence:
        return _nothing_to_do(start, design, tolerance, within)
    design, chosen, can = _steadiest(start, probe, tolerance, confidence, max_measurements, seed, design)
    if not len(chosen):
        before = design.places.sd(design.pose(design.prior))
        rarely_hit = design_of(start, probe, seed, feature, stated, steady=0.0, clear=0.0) or design
        return Plan(part.name, start.Ts[0], (), before, False, (_limit(rarely_hit, tolerance, confidence),), feature)
    found = _as_plan(start, design, chosen, tolerance, confidence)
    if not (found.reached or can) and (
        wide := _too_wide_a_prior(start, probe, design, found, tolerance, confidence, seed)
    ):
        found = replace(found, findings=(wide,))
    if found.all_clear <= _FREE:
        close = StartTooClose(1 - found.all_clear, design.probe.clearance)
        found = replace(found, findings=(*found.findings, close))
    return found


def _steadiest(
    start: Start, probe: Probe, tolerance: float, confidence: float, max_measurements: int, seed: int, design: Design
) -> tuple[Design, IntArray, bool]:
    """Return the problem with the strictest candidates that reach the goal, the chosen rows, and if all suffice."""
    can = design.best(tolerance)
    chosen = choose(design, tolerance, confidence, max_measurements, can=can >= confidence)
    for steady, clear in _LESS_STEADY:
        if (kept := design.kept(chosen, tolerance)) >= confidence:
            break
        other = design_of(start, probe, seed, design.places.feature, design.stated, steady=steady, clear=clear)
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
        chances = brings.within, brings.if_all_hit, float(meets[:, k].mean())
        readings.append(PlannedReading(*place, pose, corner_sd(part, pose), *chances, sd))
    reached, before = brings.within >= confidence, design.places.sd(design.pose(design.prior))
    finding: Finding = _result(design, readings, brings, tolerance, confidence)
    worst = int(np.argmin([r.meets for r in readings]))
    if brings.if_all_hit >= confidence and max(readings[worst].meets, brings.within) < _DOUBTFUL:
        reached, finding = False, FaceOftenMissed(worst + 1, readings[worst].meets, brings.within)
    what = part.name, start.Ts[0], tuple(readings), before, reached, (finding,), design.places.feature
    return Plan(*what, brings.all_meet, brings.all_clear)


def _goal(design: Design, tolerance: float) -> PlanGoal:
    """Return the goal of a plan."""
    return PlanGoal(design.target.part.name, design.places.feature or "", tolerance)


def _limit(design: Design, tolerance: float, confidence: float) -> SystematicErrorLimits | ReachLimits | PriorTooWide:
    """Return what prevents the goal with any number of readings: the largest shared error, the reach, or the prior.

    Args:
        design: the problem with all candidates, also those that seldom hit their faces.
        tolerance: tolerance [m].
        confidence: required probability of the tolerance.
    """
    goal, sd = _goal(design, tolerance), design.places.sd(design.limit)
    if design.chance(design.limit, tolerance) >= confidence:
        return PriorTooWide(goal, design.places.sd(design.pose(design.prior)), design.best(tolerance), 0)
    least = design.least_goal(design.limit, confidence)
    sources = dict.fromkeys(source for source in design.sources if source != "pose")
    if design.chance(design.limit_without(sources), tolerance) < confidence:
        return ReachLimits(goal, sd, least)
    return SystematicErrorLimits(
        goal, sd, least, min(sources, key=lambda one: design.places.sd(design.limit_without([one])))
    )


def _result(
    design: Design, readings: list[PlannedReading], brings: Promise, tolerance: float, confidence: float
) -> PlanResult:
    """Return the result of a plan."""
    goal, reached = _goal(design, tolerance), brings.within >= confidence
    return PlanResult(
        goal, reached, len(readings), readings[-1].sd, brings.within, brings.if_all_hit, brings.all_meet,
        brings.if_all_hit >= confidence, brings.within_assumed,
        _enough(readings, confidence),
    )  # fmt: skip


def _enough(readings: Sequence[PlannedReading], confidence: float) -> int:
    """Return the number of readings that suffice if all hit their faces; 0 if none does."""
    return next((n for n, one in enumerate(readings, 1) if one.within_if_hit >= confidence), 0)


def _nothing_to_do(start: Start, design: Design, tolerance: float, within: float) -> Plan:
    """Return the plan without readings for a prior pose that suffices."""
    finding = NoReadingNeeded(_goal(design, tolerance), within)
    name, before = design.target.part.name, design.places.sd(design.pose(design.prior))
    return Plan(name, start.Ts[0], (), before, True, (finding,), design.places.feature)


def _too_wide_a_prior(
    start: Start, probe: Probe, design: Design, found: Plan, tolerance: float, confidence: float, seed: int
) -> PriorTooWide | None:
    """Return the finding that the prior is too uncertain if a more certain one would reach the goal; otherwise None."""
    finer = replace(start, covariances=start.covariances / _BETTER**2)
    better = design_of(finer, probe, seed, design.places.feature, design.stated)
    if better is None or better.best(tolerance) < confidence:
        return None
    sd = design.places.sd(design.pose(design.prior))
    enough = _enough(found.readings, confidence)
    return PriorTooWide(_goal(design, tolerance), sd, found.readings[-1].within, enough)
