"""Conversion of a session's state to an answer like that of :func:`tanteo.identify`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import comb

import numpy as np

from tanteo.errors import InputError
from tanteo.factors import ContactPoints
from tanteo.geometry.limits import SUSPECT
from tanteo.geometry.typing import BoolArray
from tanteo.planning.places import places_of
from tanteo.planning.session.values import Observation, Step
from tanteo.planning.state import SensingState
from tanteo.planning.stopping import Stop, largest_corner_sd
from tanteo.posterior import (
    Answer,
    Hypothesis,
    PosePrior,
    Status,
    as_hypothesis,
    face_elsewhere,
    p_of_prior,
    verdict,
    worst_reading,
)
from tanteo.posterior.answers import CONFIDENCE, doubt, prior_residuals
from tanteo.posterior.fit_at_mode import GoodnessOfFit, goodness_of_fit
from tanteo.words.findings import (  # fmt: skip
    EmptySpace,
    Finding,
    MovedMeanwhile,
    NoContact,
    NoPartLeft,
    PoseWithin,
    SeveralPoses,
    WiderPrior,
    WorstReading,
)

_FEW, _BY_CHANCE = 2, 0.05
"""Smallest number of misfits that may indicate a motion, and largest probability of their grouping in time by
chance."""


def moved(ids: Sequence[str], misfit: BoolArray) -> MovedMeanwhile | None:
    """Return the finding that part or robot may have moved, or None if the misfits may be grouped in time by chance.

    If misfits occur at random times, the probability that all are among the first or the last ``k`` readings is the
    fraction of all subsets of the same size that are.

    Args:
        ids: names of the readings, in order of time.
        misfit: flags of the readings that do not fit the most probable hypothesis ``(n,)``.
    """
    rows, n = np.flatnonzero(misfit), len(misfit)
    if len(rows) < _FEW:
        return None
    first, last = int(rows[0]), int(rows[-1])
    span = min(last + 1, n - first)
    if 2 * comb(span, len(rows)) >= _BY_CHANCE * comb(n, len(rows)):
        return None
    early = last + 1 <= n - first
    some = len(rows) if len(rows) < last - first + 1 else 0
    return MovedMeanwhile(ids[first], ids[last], some, ids[last if early else first], early)


_HALF = 0.5


def answered(state: SensingState, stop: Stop, seed: int, top: int, significance: float) -> Answer:
    """Return the answer of a session, in which poses that differ by less than the goal's tolerance are equivalent.

    The goal may require less confidence than :func:`tanteo.identify`. The findings then have the probability and the
    alternatives.

    Args:
        state: state of the session.
        stop: goal of the session.
        seed: seed of the session.
        top: largest number of hypotheses to report.
        significance: significance level of the tests.

    Raises:
        InputError: ``top`` is less than 1.
    """
    if top < 1:
        raise InputError(f"top: expected 1 or more, got {top}. Use 5.")
    touches, start = state.touches, state.start
    if touches is None or not len(touches):
        status: Status = "unknown" if state.unknown > _HALF else "insufficient"
        nothing = NoContact() if status == "insufficient" else EmptySpace()
        gone = 1.0 - float(state.weights.sum())
        return Answer(status, (nothing,), (), gone, seed=seed, significance=significance)
    if not state.modes:
        return Answer("unknown", (NoPartLeft(),), (), state.unknown, seed=seed, significance=significance)
    found = [goodness_of_fit(mode) for mode in state.modes[:top]]
    hypotheses = tuple(
        as_hypothesis(touches, one, start.stated(row), state.unstated)
        for one, row in zip(found, state.rows, strict=False)
    )
    shares = [(mode.prepared.part.name, mode.probability) for mode in state.modes]
    enough = bool(stop.reached(state))
    least = _least(stop, float(state.of_parts().max(initial=0.0)) if enough else 1.0)
    prior_p = p_of_start(state)
    status, finding = verdict(
        hypotheses, state.unknown, significance,
        worst=_worst(touches, found[0], prior_p), shares=shares, prior_p=prior_p, least=least, known=enough,
    )  # fmt: skip
    placed = stop.tolerance is not None and (enough or stop.chance(state) >= CONFIDENCE)
    if status == "ambiguous" and (placed or enough):
        status = "recognized" if placed else "ambiguous"
        finding = _in_some_pose(hypotheses[0], state, stop, shares)
    more = (
        face_elsewhere(touches, found[0], state.unknown, start.priors),
        WiderPrior() if status == "unknown" and prior_p < significance else None,
        moved_meanwhile(state),
    )
    findings = (finding, *(one for one in more if one is not None))
    return Answer(status, findings, hypotheses, state.unknown, seed=seed, significance=significance)


def contradiction(state: SensingState, stop: Stop, significance: float, *, reached: bool) -> tuple[Finding, ...]:
    """Return the findings of an answer that the tests reject; none if they accept it.

    Before the goal is reached, only the contradiction between a certain part and its prior pose counts, because more
    readings do not correct the prior. When the goal is reached, the joint test counts, too.

    Args:
        state: state of the session.
        stop: goal of the session.
        significance: significance level of the tests.
        reached: whether the goal is reached.
    """
    known = reached or (state.of_parts().max(initial=0.0) > CONFIDENCE and p_of_start(state) < SUSPECT)
    answer = answered(state, stop, 0, 1, significance) if known else None
    return answer.findings if answer is not None and answer.status == "unknown" else ()


def p_of_start(state: SensingState) -> float:
    """Return the p-value of the prior pose given the readings.

    Of several prior poses the nearest counts. The value is 1 if no pose is probable, or if the pose comes from factors.

    Args:
        state: posterior of the session.
    """
    start = state.start
    if not state.modes or state.modes[0].probability < _HALF:
        return 1.0
    if start.stated(int(state.rows[0])) is None:
        return 1.0
    best, own = state.modes[0], start.suggested + np.flatnonzero(start.part[start.suggested :] == state.part[0])
    there = np.repeat(state.poses[:1], len(own), axis=0)
    row = own[np.argmin(np.sum(prior_residuals(start.prior(own), best.prepared.part, there) ** 2, axis=1))]
    pose = PosePrior(start.Ts[row], start.covariances[row])
    return p_of_prior(best, replace(start.priors, pose=pose))


def _worst(points: ContactPoints, best: GoodnessOfFit, prior_p: float) -> WorstReading | None:
    """Return the reading that contradicts the best hypothesis most; None if the prior pose contradicts it more."""
    contradicted = best.misfit().with_more(0.0, len(best.free)).p_value < prior_p
    return worst_reading(points, best) if contradicted else None


def moved_meanwhile(state: SensingState) -> MovedMeanwhile | None:
    """Return the finding that the misfits of the most probable hypothesis are grouped in time, or None.

    Args:
        state: posterior of the session.
    """
    if state.touches is None or not state.modes:
        return None
    return moved(state.touches.ids, ~state.on_part())


def _least(stop: Stop, part: float) -> float:
    """Return the smallest probability of a pose that counts as the answer, given the probability of its part."""
    required = CONFIDENCE if stop.probability is None else stop.probability
    return part * min(CONFIDENCE, max(required, _HALF))


def _in_some_pose(
    best: Hypothesis, state: SensingState, stop: Stop, shares: list[tuple[str, float]]
) -> PoseWithin | SeveralPoses:
    """Return the finding that a part has several possible poses, and whether they differ by less than the tolerance."""
    sure, others = doubt(best, state.unknown, shares, any_pose=True)
    if stop.tolerance is None:
        return SeveralPoses(best.part, sure, others)
    feature = places_of(state.target(0).part, stop.feature).feature
    return PoseWithin(best.part, sure, stop.tolerance, "" if feature is None else str(feature), others)


def step_of(state: SensingState, stop: Stop, observation: Observation) -> Step:
    """Return the summary of the posterior after an observation.

    Args:
        state: posterior after the observation.
        stop: goal of the session.
        observation: readings that were added last.
    """
    if not len(state.weights):
        nowhere = np.full((4, 4), np.nan), -1, np.full((6, 6), np.nan), 0.0
        T, part, C, inside = nowhere
    else:
        k = int(np.argmax(state.weights))
        T, part, C = state.poses[k], int(state.part[k]), state.whole_covariance(k)
        inside = stop.chance(state)
    ids = () if observation.readings is None else observation.readings.ids
    known = state.of_parts(), state.unknown, T, part, C, largest_corner_sd(state), float(inside)
    return Step(ids, observation.action, *known, observation.findings)
