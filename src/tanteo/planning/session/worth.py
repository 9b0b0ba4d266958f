"""Decisions of a session: whether it ends, whether a reading is worth its cost, and which misfits to repeat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.special import entropy
from tanteo.planning.candidates import Candidates
from tanteo.planning.context import Choice, DecisionContext
from tanteo.planning.policies import POLICIES, most_information
from tanteo.planning.session.action import Action
from tanteo.planning.session.answer import contradiction, moved_meanwhile
from tanteo.planning.session.values import Done, Step
from tanteo.planning.state import SensingState
from tanteo.planning.stopping import Stop
from tanteo.planning.whole import Offers, WholeFeature, whole_information, whole_seconds
from tanteo.words.findings import LargestFaceLeast, NotWorthCost, ReadingLimit, RepeatMisfit


def once_more(state: SensingState, steps: Sequence[Step]) -> Candidates:
    """Return candidates that repeat actions whose readings do not fit the most probable hypothesis.

    Each action is repeated at most once.

    Args:
        state: posterior of the session.
        steps: steps of the session.
    """
    if state.touches is None or not state.modes:
        return _candidates(state, [])
    tried = [s.action for s in steps if s.action is not None and not s.action.acquires]
    misfits = {i for i, on in zip(state.touches.ids, state.on_part(), strict=True) if not on}
    doubted = [s.action for s in steps if s.action in tried and misfits.intersection(s.ids)]
    return _candidates(state, [a for a in doubted if a is not None and sum(_is_like(a, b) for b in tried) == 1])


def information_of_repeat(state: SensingState) -> float:
    """Return the expected information of a repeated misfit about whether the object is unknown [nats].

    If the part is present, the repetition is again a misfit with the outlier rate. If the object is unknown, it is one
    with the complement of that rate.

    Args:
        state: posterior of the session.
    """
    c, u = state.start.priors.outlier_rate, state.unknown
    off = u * (1 - c) + (1 - u) * c
    return float(entropy(off) + entropy(1 - off) - entropy(c) - entropy(1 - c))


def _is_like(one: Action, other: Action) -> bool:
    return np.array_equal(one.origin, other.origin) and np.array_equal(one.direction, other.direction)


def _candidates(state: SensingState, actions: Sequence[Action]) -> Candidates:
    """Return the beams of actions as candidates of the most probable hypothesis, without beams that miss it."""
    origins = np.array([a.origin for a in actions]).reshape(-1, 3)
    directions = np.array([a.direction for a in actions]).reshape(-1, 3)
    if not len(actions):
        return Candidates(origins, directions, np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0))
    target, to_part = state.target(0), SE3.inverse(state.poses[0])
    hits = target.surface.cast(SE3.apply(to_part, origins), directions @ to_part[:3, :3].T)
    faces = target.part.triangle_face[hits.triangles]
    reached = hits.distances < [a.max_range for a in actions]
    return Candidates(origins, directions, np.zeros(len(actions), dtype=int), faces, hits.distances).take(reached)


_LEAST_GAIN = 0.1
"""Smallest information of a feature for which it is acquired completely [nats], because this takes more than a
minute."""


def enough(stop: Stop, state: SensingState, count: int, significance: float) -> Done | None:
    """Return the end of a session if its goal or limit is reached, or its answer is contradicted; otherwise None.

    Args:
        stop: goal of the session and its limits.
        state: posterior of the session.
        count: number of readings so far.
        significance: significance level of the tests.
    """
    goal = stop.reached(state)
    if against := contradiction(state, stop, significance, reached=goal is not None):
        return Done(False, against)
    if goal is not None:
        return Done(True, (goal,)).adding(moved_meanwhile(state))
    limit = stop.max_measurements
    return Done(False, (ReadingLimit(limit, count),)) if count >= limit else None


def worth_making(
    stop: Stop, context: DecisionContext, choice: Choice, repeats: Candidates
) -> tuple[DecisionContext, Choice] | Done:
    """Return the reading to make with its context, or the end of the session if no reading is worth its cost.

    It is the choice of the policy, the repetition of a misfit if that has more information, or a reading that confirms
    the answer. If the policy computes no information, that of the best candidate decides.

    Args:
        stop: goal of the session and its limits.
        context: input of the policy.
        choice: choice of the policy.
        repeats: misfits to repeat.
    """
    state, best = context.state, choice.gain
    if np.isnan(best) and stop.least_gain > 0:
        best = most_information(context)
    gain = information_of_repeat(state) if len(repeats) else 0.0
    if gain > 0 and gain >= stop.least_gain and gain >= best:
        return replace(context, candidates=repeats), Choice(0, gain, RepeatMisfit())
    if not best < stop.least_gain or stop.many_small_gains_suffice(state, best, stop.max_measurements - context.count):
        return context, choice
    if stop.confirms(state):
        return context, _to_confirm(context)
    return Done(False, (NotWorthCost(best),))


def worth_acquiring(
    stop: Stop, context: DecisionContext, offers: Offers, chosen: tuple[DecisionContext, Choice] | Done
) -> tuple[WholeFeature, float] | None:
    """Return the feature to acquire completely instead of the chosen reading, and its information [nats]; or None.

    If the policy considers durations, a feature replaces the reading if it has more information per time. Otherwise it
    does so if no reading is worth its cost.

    Args:
        stop: goal of the session and its limits.
        context: input of the policy.
        offers: features that the hand can acquire.
        chosen: chosen reading with its context, or the end of the session.
    """
    if not offers:
        return None
    gains = whole_information(offers, context)
    rates = gains / whole_seconds(offers, context)
    k = int(np.argmax(rates))
    if isinstance(chosen, Done):
        worth = gains[k] >= max(stop.least_gain, _LEAST_GAIN)
    else:
        choice = chosen[1]
        worth = choice.seconds is not None and rates[k] > choice.gain / choice.seconds
    return (offers[k], float(gains[k])) if worth else None


def _to_confirm(context: DecisionContext) -> Choice:
    """Return a reading on the face with the fewest readings, where a near variant of the part may differ."""
    choice = POLICIES["largest-face"].choose(context)
    assert isinstance(choice.reason, LargestFaceLeast)
    return replace(choice, reason=replace(choice.reason, confirms=True))
