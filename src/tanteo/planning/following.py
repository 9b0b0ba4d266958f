"""Next reading after an answer: where to sense so that an ambiguous or insufficient answer becomes decided.

The hypotheses of the answer are the state of a session, and the policy of sessions chooses the reading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.limits import LARGEST, LEAST_SD
from tanteo.geometry.typing import Covariances, Transforms
from tanteo.parts import Part, part_named
from tanteo.planning.candidates import propose
from tanteo.planning.context import Choice, DecisionContext
from tanteo.planning.plans import Plan, PlannedReading
from tanteo.planning.policies import POLICIES
from tanteo.planning.predictions import predict
from tanteo.planning.probe import Probe
from tanteo.planning.samples import draw
from tanteo.planning.session.action import Action
from tanteo.planning.session.questions import action_of
from tanteo.planning.session.worth import information_of_repeat
from tanteo.planning.start import Start, from_hypotheses
from tanteo.planning.state import begin
from tanteo.planning.stopping import chance_within
from tanteo.planning.unreached import no_place
from tanteo.posterior import Answer, Hypothesis, Priors
from tanteo.words.findings import (
    AccuracyNeeded,
    ExpectedReading,
    GoalReached,
    NextTouch,
    NoPlaceReached,
    OutlierOrVariant,
    RepeatMisfit,
)

_CANDIDATES = 500
"""Number of candidates, as in a session."""

_SDS, _LEAST_OVERTRAVEL = 3.0, 2e-3
"""Standard deviations of the farthest contact, and smallest search distance beyond the expected one [m]."""

_REACHED = 0.95
"""Probability of the goal at which no further reading is needed, and of an error that is reported."""

_HALVINGS = 10
"""Numerical: halvings of the interval in which an error is searched, to 0.1 % of it."""


@dataclass(frozen=True, slots=True, eq=False)
class NextReading:
    """Reading that an answer lacks, and what each hypothesis expects of it.

    Attributes:
        action: reading to make: start, direction, face and expected information.
        finding: the same as a typed finding, with the expected reading of each hypothesis.
        T_world_part: pose of the part at which the reading aims ``(4, 4)``.
        covariance: covariance of that pose, part frame ``(6, 6)`` [m, rad].

    Example:
        >>> part = tanteo.read_part("parts/block.step")
        >>> answer = tanteo.locate(tanteo.read_readings("readings/too_few.csv"), part)
        >>> from tanteo.planning.following import next_reading
        >>> next_reading(answer, [part], tanteo.probe_of(1e-4)) is None
        True
    """

    action: Action
    finding: NextTouch
    T_world_part: Transforms
    covariance: Covariances

    @property
    def overtravel(self) -> float:
        """Distance beyond the expected contact within which every hypothesis expects a contact [m]."""
        ends = [e.distance + _SDS * e.sd for e in self.finding.expected if np.isfinite(e.distance)]
        farthest = min(max(ends, default=0.0), self.action.max_range)
        return float(max(farthest - self.action.expected, _LEAST_OVERTRAVEL))

    @property
    def plan(self) -> Plan:
        """The reading as a plan with one touch, for a probing program."""
        one, nan = self.action, float("nan")
        reading = PlannedReading(
            one.origin, one.direction, np.array(self.finding.point), one.face, self.covariance, nan, nan, nan, 1.0
        )
        return Plan(one.part, self.T_world_part, (reading,), nan, False, (self.finding,))


def next_reading(
    answer: Answer, parts: Sequence[Part], probe: Probe, goal: float | None = None, seed: int = 0
) -> NextReading | NoPlaceReached | GoalReached | None:
    """Return the reading with the most information about an answer's hypotheses.

    Without a goal, an ambiguous answer needs a reading that discriminates its hypotheses, and an insufficient one a
    reading of the motion that is free. Where readings contradict the part, the one that is farthest off is repeated
    near its place: it is an outlier, or the object is a variant. The approach is clear of the part at every
    hypothesis that matters.

    Args:
        answer: answer of :func:`tanteo.identify` or :func:`tanteo.locate`; with more hypotheses (``top``) fewer poses
            are neglected.
        parts: candidate parts of the answer.
        probe: model of the sensor, with the limits of its approach.
        goal: largest allowed displacement of the part's corners [m], beyond which accuracy has no value; None for the
            status alone.
        seed: seed of the candidate positions.

    Returns:
        The reading; the finding that no place can be reached, or that the goal is reached; or None if the answer has no
        hypothesis, or the object is none of the parts.

    Raises:
        InputError: the goal is not a positive length, or a part of the answer is missing.
    """
    if goal is not None and not (np.isfinite(goal) and goal >= LEAST_SD):
        raise InputError(f"goal: expected a length of {LEAST_SD:g} m or more, got {goal:g} m. Use 0.5e-3.")
    if not answer.hypotheses or answer.status == "unknown":
        return None
    if goal is not None and answer.status == "recognized":
        within = chance_within(begin(_start(answer, parts, relative=False)), goal)
        if within >= _REACHED:
            return GoalReached(answer.hypotheses[0].part, tolerance=goal, within=within)
    start = _start(answer, parts)
    state = begin(start)
    candidates = propose(state, probe, _CANDIDATES, seed)
    clear = bool(len(candidates))
    if not clear:  # very uncertain poses leave no path that is clear of all of them
        candidates = propose(state, probe, _CANDIDATES, seed, anywhere=False)
    names = tuple(target.part.name for target in start.targets)
    if not len(candidates):
        return no_place(state, probe, seed, names)
    open_part = len(start.targets) > 1
    enough = goal
    if goal is None and answer.status == "ambiguous":  # only the choice among the hypotheses has a value
        enough = max(target.part.diagonal for target in start.targets)
    context = DecisionContext(state, candidates, probe, None, enough, 0, seed, part_open=open_part)
    doubted = next((one for one in answer.findings if isinstance(one, OutlierOrVariant)), None)
    choice = POLICIES["information"].choose(context) if doubted is None else _repeat(context, doubted)
    action = action_of(context, choice, 1)
    finding = NextTouch(
        action.part, action.face, tuple(map(float, action.origin)), tuple(map(float, candidates.aims[choice.index])),
        tuple(map(float, action.direction)), action.gain, _expected(start, action, probe), clear,
    )  # fmt: skip
    mode = int(candidates.mode[choice.index])
    return NextReading(action, finding, state.poses[mode], state.covariances[mode])


def _repeat(context: DecisionContext, doubted: OutlierOrVariant) -> Choice:
    """Return the candidate nearest to the worst contradicting reading, on its face if one of the candidates is."""
    state, candidates = context.state, context.candidates
    rows = np.flatnonzero(candidates.mode == int(np.argmax(state.weights)))
    rows = rows if len(rows) else np.arange(len(candidates))
    names = [state.target(int(candidates.mode[k])).part.faces[int(candidates.face[k])].name for k in rows]
    same = rows[np.array([name == doubted.faces[0] for name in names])]
    rows = same if len(same) else rows
    away = np.linalg.norm(candidates.aims[rows] - np.array(doubted.places[0]), axis=1)
    return Choice(int(rows[np.argmin(away)]), information_of_repeat(state), RepeatMisfit())


def _start(answer: Answer, parts: Sequence[Part], *, relative: bool = True) -> Start:
    """Return the hypotheses as prior poses, by default without errors that a further reading shares."""
    named = {(h.part, h.file) for h in answer.hypotheses}
    some = [part for part in parts if (part.name, part.source) in named]
    hypotheses = [_relative(h) if relative else h for h in answer.hypotheses if h.probability > 0]
    unknown = float(np.clip(answer.unknown_probability, LEAST_SD, 0.5))
    return from_hypotheses(hypotheses, some, Priors(unknown=unknown))


def _relative(one: Hypothesis) -> Hypothesis:
    return one if one.covariance_relative is None else replace(one, covariance=one.covariance_relative)


def _expected(start: Start, action: Action, probe: Probe) -> tuple[ExpectedReading, ...]:
    """Return what each hypothesis expects of the reading."""
    state = begin(start)
    here = draw(state, 1)  # the mean of every mode
    seen = predict(here, action.origin[None], action.direction[None], probe)
    found = []
    for mode, weight in enumerate(state.weights):
        rows = np.flatnonzero(here.mode == mode)
        if not len(rows):
            continue
        k = int(rows[0])
        distance, cosine = float(seen.ranges[0, k]), float(seen.cosines[0, k])
        part = state.target(mode).part
        if not (np.isfinite(distance) and 0 <= distance <= probe.max_range and cosine > 0):
            found.append(ExpectedReading(part.name, float(weight), "", float("inf"), float("nan")))
            continue
        own = probe.own_variance(np.array(max(distance, 0.0)), np.array(cosine)) + seen.scatter[0, k]
        sd = float(np.sqrt(seen.spreads[0, k] + own))
        found.append(ExpectedReading(part.name, float(weight), part.faces[int(seen.faces[0, k])].name, distance, sd))
    return tuple(found)


def corner_error(best: Hypothesis, part: Part, probability: float = _REACHED) -> float:
    """Return the error that the part's farthest corner exceeds with the complement of a probability [m].

    Symmetric poses are equivalent.

    Args:
        best: hypothesis that counts as right.
        part: its part.
        probability: probability that all corners are within the result.
    """
    state = begin(from_hypotheses([replace(best, probability=1.0)], [part]))
    low, high = 0.0, _SDS * best.corner_sd + LEAST_SD
    certain = 1 - state.unknown
    while chance_within(state, high) < probability * certain and high < LARGEST:
        high *= 2
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if chance_within(state, middle) >= probability * certain else (middle, high)
    return high


def accuracy_needed(answer: Answer, parts: Sequence[Part], need: float) -> AccuracyNeeded | None:
    """Return whether an answer is as accurate as needed; None without a hypothesis.

    Args:
        answer: the answer.
        parts: candidate parts of the answer.
        need: largest allowed error of the part's farthest corner [m].
    """
    best = answer.best
    part = None if best is None else part_named(parts, best.part)
    if best is None or part is None or answer.status == "unknown":
        return None
    error = corner_error(best, getattr(part, "part", part))
    return AccuracyNeeded(best.part, need, error, answer.status == "recognized" and error <= need)
