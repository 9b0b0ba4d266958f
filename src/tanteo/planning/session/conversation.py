"""Session: actions, observations and the posterior that results from them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from tanteo.defaults import SIGNIFICANCE, TOP
from tanteo.errors import InputError, check_kind
from tanteo.geometry.limits import check_count, check_significance
from tanteo.geometry.typing import BoolArray, Vectors
from tanteo.planning.candidates import Candidates, propose
from tanteo.planning.context import Choice, DecisionContext, Policy
from tanteo.planning.places import check_feature
from tanteo.planning.policies import POLICIES
from tanteo.planning.probe import Probe
from tanteo.planning.session.action import Action
from tanteo.planning.session.ahead import limits, shared_of
from tanteo.planning.session.answer import answered, step_of
from tanteo.planning.session.questions import action_of, answers, is_same, new_readings, unlike, whole_action
from tanteo.planning.session.values import Done, Observation, Sensing, Step
from tanteo.planning.session.worth import enough, information_of_repeat, once_more, worth_acquiring, worth_making
from tanteo.planning.start import Start
from tanteo.planning.state import SensingState, begin, confirmed, update
from tanteo.planning.stopping import Stop
from tanteo.planning.unreached import no_place
from tanteo.planning.whole import Offers
from tanteo.posterior import Answer, PosePrior
from tanteo.sensors import Readings, check_readings_kind, concatenate
from tanteo.sensors.anomalies import find_stuck
from tanteo.values import Value
from tanteo.words.findings import NoPartLeft, NoPlaceReached, RepeatMisfit, Stuck

_CANDIDATES = 500
"""Number of candidate readings for each choice."""


@dataclass(slots=True, eq=False, repr=False)
class Session(Value):
    """Sequential sensing of one object: posterior, readings and actions.

    :meth:`ask` and :meth:`tell` are the ask-and-tell interface of sequential optimizers.

    Attributes:
        start: prior poses of the possible parts.
        probe: sensor model with the limits of its approach.
        sensing: noise model of the readings.
        policy: policy that chooses the next reading.
        stop: goal of the session.
        seed: seed of all random numbers; the same seed and readings give the same actions and answers.
        able: function that returns flags of the feasible candidates ``(C,)``, for limits that the probe does not model,
            such as the body of a hand; None for no further limits.
        whole: function that returns features which a hand can acquire completely; None without a hand.
        significance: significance level of the tests of an answer.

    Example:
        >>> import numpy as np
        >>> part = tanteo.read_part("parts/bracket_left.step")
        >>> place = tanteo.at_place([part], np.eye(4), np.diag([1e-4] * 3 + [1e-2] * 3))
        >>> session = tanteo.Session(place, tanteo.probe_of("keyence_il300"))
        >>> action = session.ask()
        >>> isinstance(action, tanteo.Action)
        True
    """

    start: Start
    probe: Probe
    sensing: Sensing = field(default_factory=Sensing)
    policy: Policy = POLICIES["information"]
    stop: Stop = field(default_factory=Stop)
    seed: int = 0
    able: Callable[[SensingState, Candidates], BoolArray] | None = None
    whole: Callable[[SensingState], Offers] | None = None
    significance: float = SIGNIFICANCE
    _state: SensingState = field(init=False)
    _readings: list[Readings] = field(init=False, default_factory=list)
    _joined: Readings | None = field(init=False, default=None)
    _steps: list[Step] = field(init=False, default_factory=list)
    _pending: Action | None = field(init=False, default=None)
    _last_number: int = field(init=False, default=0)
    _refused: list[Action] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        check_kind("start", self.start, Start, "tanteo.planning.at_place(parts, T, covariance) makes one.")
        check_kind("probe", self.probe, Probe, "tanteo.planning.probe_of(name) makes one.")
        check_kind("sensing", self.sensing, Sensing, "Use Sensing(sensor=name), or Sensing(sd=0.3e-3).")
        check_count("seed", self.seed, 0)
        check_significance(self.significance)
        if self.stop.feature is not None:
            check_feature(self.stop.feature, [target.part for target in self.start.targets])
        self._state = begin(self.start)

    @property
    def state(self) -> SensingState:
        """Posterior of all readings so far."""
        return self._state

    @property
    def readings(self) -> Readings | None:
        """All readings so far; None before the first."""
        return self._joined

    @property
    def prior(self) -> PosePrior:
        """Prior pose with the largest density at the best hypothesis; before the first reading, the most probable."""
        row = int(self._state.rows[0]) if self._state.modes else -1
        row = row if row >= 0 else int(np.argmax(self.start.weights))
        return PosePrior(self.start.Ts[row], self.start.covariances[row])

    @property
    def steps(self) -> tuple[Step, ...]:
        """Posterior after each observation."""
        return tuple(self._steps)

    @property
    def pending(self) -> Action | None:
        """Action whose readings are awaited; None if there is none."""
        return self._pending

    @property
    def refused(self) -> tuple[Action, ...]:
        """Actions that could not be carried out or had no result; similar ones are not chosen again."""
        return tuple(self._refused)

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Observations that :meth:`resume` needs to restore this state."""
        readings = iter(self._readings)
        return tuple(Observation(s.action, next(readings) if s.ids else None, s.findings) for s in self._steps)

    @property
    def count(self) -> int:
        """Number of readings so far."""
        return 0 if self._joined is None else len(self._joined)

    @property
    def questions(self) -> int:
        """Largest number of an action so far, which seeds the candidates of the next one."""
        return self._last_number

    def ask(self) -> Action | Done:
        """Return the next reading to make, or the end of the session.

        A pending action is returned again until its readings arrive, or until it is refused or replaced. Other readings
        do not change it, unless they reach the goal. ``put(None)`` discards the pending action, so that the next call
        chooses by the current posterior. A goal counts only if every reading that does not fit was made once more: it
        was an outlier, or the object is only similar to the part.
        """
        end = enough(self.stop, self._state, self.count, self.significance)
        doubted = self._misfits_to_repeat() if end is not None and end.reached else None
        if end is not None and doubted is None:
            return self._explained(end.adding(self._stuck()))
        if self._pending is not None:
            return self._pending
        if doubted is not None:
            self._last_number += 1
            again = Choice(0, information_of_repeat(self._state), RepeatMisfit())
            self._pending = action_of(self._context(doubted), again, self._last_number)
            return self._pending
        if not len(self._state.weights):
            return Done(False, (NoPartLeft(),))
        reached = propose(self._state, self.probe, _CANDIDATES, self.seed * 1000 + self._last_number)
        candidates = self._open(reached)
        context = self._context(candidates)
        chosen = self._chosen(context) if len(candidates) else Done(False, (self._no_place(len(reached)),))
        better = worth_acquiring(self.stop, context, self._offers(chosen), chosen)
        if better is None and isinstance(chosen, Done):
            return self._explained(chosen) if len(candidates) else chosen
        self._last_number += 1
        if better is not None:
            self._pending = whole_action(self._state, *better, self._last_number)
        elif not isinstance(chosen, Done):
            self._pending = action_of(*chosen, self._last_number)
        assert self._pending is not None
        return self._pending

    def _misfits_to_repeat(self) -> Candidates | None:
        """Return the misfits that were made once only; None if there are none, or if no reading is left."""
        if self.count >= self.stop.max_measurements:
            return None
        repeats = self._open(once_more(self._state, self._steps))
        return repeats if len(repeats) else None

    def _no_place(self, reached: int) -> NoPlaceReached:
        """Return why no candidate is left; those that the probe reaches were refused, or the machine is unable."""
        return NoPlaceReached() if reached else no_place(self._state, self.probe, self.seed, anywhere=True)

    def _chosen(self, context: DecisionContext) -> tuple[DecisionContext, Choice] | Done:
        """Return the chosen reading with its context, or the end of the session."""
        repeats = self._open(once_more(self._state, self._steps))
        return worth_making(self.stop, context, self.policy.choose(context), repeats)

    def _offers(self, chosen: tuple[DecisionContext, Choice] | Done) -> Offers:
        """Return the complete features that were not tried yet; none if the policy does not consider durations."""
        if self.whole is None or not (isinstance(chosen, Done) or chosen[1].seconds is not None):
            return ()
        before = [*self._refused, *(step.action for step in self._steps if step.action is not None)]
        tried = {(a.acquires, a.part, a.face) for a in before}
        part = [target.part.name for target in self.start.targets]
        offers = self.whole(self._state)
        return [one for one in offers if (one.kind, part[self._state.part[one.mode]], one.name) not in tried]

    def _context(self, candidates: Candidates) -> DecisionContext:
        """Return the input of the policy for some candidates."""
        stop, state = self.stop, self._state
        part_only = stop.tolerance is None and stop.probability is not None
        known = stop.is_part_known(state)
        tolerance = stop.left_for_noise(state)
        values = state, candidates, self.probe, self._place(), tolerance, self.count, self.seed
        shared = shared_of(self.sensing, self.probe, self._joined, state)
        return DecisionContext(*values, part_only=part_only, part_open=not known, feature=stop.feature, shared=shared)

    def _explained(self, end: Done) -> Done:
        """Return the end of the session with the shared error that prevents the tolerance, if one does."""
        if end.reached or self.stop.tolerance is None:
            return end
        return end.adding(limits(self.sensing, self.probe, self._joined, self._state))

    def refuse(self, action: Action) -> None:
        """Mark an action as impossible or without result; similar actions are not chosen again.

        The pending action is discarded only if it is the same.

        Args:
            action: the refused action.
        """
        self._refused.append(action)
        self._last_number = max(self._last_number, action.number)
        if is_same(action, self._pending):
            self._pending = None

    def put(self, action: Action | None) -> None:
        """Replace the pending action by one that the user chose; the next :meth:`ask` returns it.

        Args:
            action: new pending action; None to discard the pending one.
        """
        self._pending = action
        if action is not None:
            self._last_number = max(self._last_number, action.number)

    def tell(self, readings: Readings, action: Action | None = None) -> Step:
        """Add readings to the posterior, whether an action requested them or not.

        A reading with a known name and the same values does not count again. With other values it gets a new name.
        Readings with the name of the pending action or near its beam complete this action. It stays pending after other
        readings, and if no reading is new.

        Args:
            readings: the new readings.
            action: action that requested the readings, if names and beams do not identify it; it may be an earlier one.

        Returns:
            Summary of the posterior after the readings.

        Raises:
            InputError: the readings cannot be converted into measurements; the session is unchanged then.
        """
        check_readings_kind("readings", readings)
        fresh, remarks = new_readings(self._readings, readings)
        pending = self._pending
        if action is None and fresh is not None and pending is not None and answers(fresh, pending):
            action = pending
        return self._take(Observation(action, fresh, remarks))

    def resume(
        self,
        observations: Iterable[Observation],
        pending: Action | None = None,
        refused: Iterable[Action] = (),
        questions: int = 0,
    ) -> None:
        """Restore the state of another session with the same start, so that posterior and next action are the same.

        Args:
            observations: observations of that session, see :attr:`observations`.
            pending: pending action of that session; None if there was none.
            refused: refused actions of that session, see :attr:`refused`.
            questions: largest number of an action of that session, see :attr:`questions`.
        """
        for action in refused:
            self.refuse(action)
        for one in observations:
            self._take(one)
        self.put(pending)
        self._last_number = max(self._last_number, questions)

    def _take(self, observation: Observation) -> Step:
        state, joined, fresh, action = self._state, self._joined, observation.readings, observation.action
        if fresh is not None:
            joined = fresh if joined is None else concatenate([joined, fresh])
            state = self._updated(state, joined)
            if self.stop.reached(state) is not None:
                state = confirmed(self._updated(state, joined), self.stop.is_clear)
        step = step_of(state, self.stop, observation)
        # all changes at once: an interrupt during the long work above leaves the session unchanged
        self._state, self._joined = state, joined
        self._readings += [] if fresh is None else [fresh]
        self._steps.append(step)
        if action is not None:
            self._last_number = max(self._last_number, action.number)
        if fresh is not None and is_same(action, self._pending):
            self._pending = None
        return step

    def _updated(self, state: SensingState, readings: Readings) -> SensingState:
        """Return the posterior of all readings; an earlier one assigns them to the faces of a made part."""
        return update(state, *self.sensing.touches(readings, self.probe, state))

    def restart(self, start: Start) -> Step:
        """Replace the start by one with further images; the readings so far stay. The pending action is discarded.

        Args:
            start: start with the same parts.

        Returns:
            Summary of the posterior.

        Raises:
            InputError: the start has other parts.
        """
        if start.targets != self.start.targets:
            raise InputError("start: expected the parts of the session, got others. Begin another session.")
        state = begin(start)
        if self._joined is not None:
            state = self._updated(state, self._joined)
        self.start, self._state, self._pending = start, state, None
        return step_of(state, self.stop, Observation(None, None, ()))

    def answer(self, top: int = TOP, significance: float | None = None) -> Answer:
        """Return the current answer, like that of :func:`tanteo.identify`.

        Args:
            top: largest number of hypotheses to report.
            significance: significance level of the joint test; None for that of the session.
        """
        level = self.significance if significance is None else significance
        answer = answered(self._state, self.stop, self.seed, top, level)
        stuck = self._stuck()
        return answer if stuck is None else answer.adding(stuck)

    def _stuck(self) -> Stuck | None:
        """Return the finding that a sensor reports a constant range, or None."""
        touches = self.probe.contact  # their ranges are lengths of travel, often equal
        return find_stuck(self.readings) if self.readings is not None and not touches else None

    def _open(self, candidates: Candidates) -> Candidates:
        """Return the candidates that are feasible and not similar to a refused action."""
        candidates = unlike(candidates, self._refused)
        if self.able is None or not len(candidates):
            return candidates
        return candidates.take(self.able(self._state, candidates))

    def _place(self) -> Vectors | None:
        made = [s.action for s in self._steps if s.action is not None]
        return made[-1].origin if made else None
