"""The only thing with memory: what was asked, what was told, and the belief that came of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from tanteo.defaults import SIGNIFICANCE, TOP
from tanteo.errors import check_kind
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
from tanteo.planning.session.worth import enough, once_more, worth_acquiring, worth_making
from tanteo.planning.start import Start
from tanteo.planning.state import SensingState, begin, update
from tanteo.planning.stopping import Stop
from tanteo.planning.whole import Offers
from tanteo.posterior import Answer, PosePrior
from tanteo.sensors import Readings, check_readings_kind, concatenate, find_stuck
from tanteo.words.findings import NoPartLeft, NoPlaceReached, Stuck

_CANDIDATES = 500
"""Readings among which one is chosen."""


@dataclass(slots=True, eq=False)
class Session:
    """Belief, readings and questions of one part being sensed.

    Attributes:
        start: what is assumed beforehand.
        probe: what senses, and where it may come from.
        sensing: how readings are made into measurements.
        policy: which reading is chosen.
        stop: when to end.
        seed: of everything that draws: the same seed and readings give the same questions and answers.
        able: which candidates can be made ``(C,)``, where the probe does not say it all: a hand has a body.
        whole: features that can be acquired whole, where something can do that: a hand over the rim of a bore.
        significance: significance level of the tests of an answer.

    Example:
        >>> import numpy as np
        >>> part = tanteo.read_part("parts/bracket_left.step")
        >>> place = tanteo.around([part], np.eye(4), np.diag([1e-4] * 3 + [1e-2] * 3))
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
    _asked: Action | None = field(init=False, default=None)
    _questions: int = field(init=False, default=0)
    _refused: list[Action] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        check_kind("start", self.start, Start, "tanteo.planning.around(parts, T, covariance) makes one.")
        check_kind("probe", self.probe, Probe, "tanteo.planning.probe_of(name) makes one.")
        check_kind("sensing", self.sensing, Sensing, "Say Sensing(sensor=name), or Sensing(sd=0.3e-3).")
        check_count("seed", self.seed, 0)
        check_significance(self.significance)
        if self.stop.feature is not None:
            check_feature(self.stop.feature, [target.part for target in self.start.targets])
        self._state = begin(self.start)

    @property
    def state(self) -> SensingState:
        """What is known now."""
        return self._state

    @property
    def readings(self) -> Readings | None:
        """All that was told; None before the first."""
        return self._joined

    @property
    def prior(self) -> PosePrior:
        """The prior pose of the start that the best hypothesis comes from; the likeliest before the first reading."""
        row = int(self._state.rows[0]) if self._state.modes else -1
        row = row if row >= 0 else int(np.argmax(self.start.weights))
        return PosePrior(self.start.Ts[row], self.start.covariances[row])

    @property
    def tells(self) -> tuple[Readings, ...]:
        """The same, as it came."""
        return tuple(self._readings)

    @property
    def steps(self) -> tuple[Step, ...]:
        """What each of them told."""
        return tuple(self._steps)

    @property
    def asked(self) -> Action | None:
        """The question that waits for its answer; None if there is none."""
        return self._asked

    @property
    def refused(self) -> tuple[Action, ...]:
        """The questions that could not be answered; none like them is asked again."""
        return tuple(self._refused)

    @property
    def observations(self) -> tuple[Observation, ...]:
        """All that has to be kept to :meth:`resume` from here."""
        readings = iter(self._readings)
        return tuple(Observation(s.action, next(readings) if s.ids else None, s.findings) for s in self._steps)

    @property
    def count(self) -> int:
        """Readings told."""
        return 0 if self._joined is None else len(self._joined)

    @property
    def questions(self) -> int:
        """The largest number of a question so far; what is drawn for the next one depends on it."""
        return self._questions

    def ask(self) -> Action | Done:
        """The next reading to make, or why there is none.

        A question waits until it is answered, refused or replaced, and is given again until then: whoever was sent may
        be on the way. Other readings that are told meanwhile may show that enough is known; else they do not change the
        question. ``put(None)`` drops it, and the next one is chosen by all that is known.
        """
        if end := enough(self.stop, self._state, self.count, self.significance):
            return self._explained(end.adding(self._stuck()))
        if self._asked is not None:
            return self._asked
        if not len(self._state.weights):
            return Done(False, (NoPartLeft(),))
        candidates = self._open(propose(self._state, self.probe, _CANDIDATES, self.seed * 1000 + self._questions))
        context = self._context(candidates)
        chosen = self._chosen(context) if len(candidates) else Done(False, (NoPlaceReached(),))
        better = worth_acquiring(self.stop, context, self._offers(chosen), chosen)
        if better is None and isinstance(chosen, Done):
            return self._explained(chosen) if len(candidates) else chosen
        self._questions += 1
        if better is not None:
            self._asked = whole_action(self._state, *better, self._questions)
        elif not isinstance(chosen, Done):
            self._asked = action_of(*chosen, self._questions)
        assert self._asked is not None
        return self._asked

    def _chosen(self, context: DecisionContext) -> tuple[DecisionContext, Choice] | Done:
        """The reading to make, or that none is worth it."""
        repeats = self._open(once_more(self._state, self._steps))
        return worth_making(self.stop, context, self.policy.choose(context), repeats)

    def _offers(self, chosen: tuple[DecisionContext, Choice] | Done) -> Offers:
        """Features that can be acquired whole, none twice; where no policy would take one, none is looked for."""
        if self.whole is None or not (isinstance(chosen, Done) or chosen[1].seconds is not None):
            return ()
        before = [*self._refused, *(step.action for step in self._steps if step.action is not None)]
        asked = {(a.acquires, a.part, a.face) for a in before}
        part = [target.part.name for target in self.start.targets]
        offers = self.whole(self._state)
        return [one for one in offers if (one.kind, part[self._state.part[one.mode]], one.name) not in asked]

    def _context(self, candidates: Candidates) -> DecisionContext:
        """What the policy decides on."""
        stop, state = self.stop, self._state
        part_only = stop.tolerance is None and stop.probability is not None
        known = stop.knows_part(state)
        values = state, candidates, self.probe, self._place(), stop.tolerance, self.count, self.seed
        shared = shared_of(self.sensing, self.probe, self._joined, state)
        return DecisionContext(*values, part_only=part_only, part_open=not known, feature=stop.feature, shared=shared)

    def _explained(self, end: Done) -> Done:
        """Return the end with the shared error that prevents the goal, if one does."""
        if end.reached or self.stop.tolerance is None:
            return end
        return end.adding(limits(self.sensing, self.probe, self._joined, self._state))

    def refuse(self, action: Action) -> None:
        """The reading cannot be made, or was in vain: readings near it are not asked for again.

        The question that waits is dropped only if it is this one.
        """
        self._refused.append(action)
        self._questions = max(self._questions, action.number)
        if is_same(action, self._asked):
            self._asked = None

    def put(self, action: Action | None) -> None:
        """A question that somebody else chose, in place of the one that waits: the next :meth:`ask` gives it.

        Args:
            action: the question; None only drops the one that waits, so that another is chosen.
        """
        self._asked = action
        if action is not None:
            self._questions = max(self._questions, action.number)

    def tell(self, readings: Readings, action: Action | None = None) -> Step:
        """Take readings into the belief: the answer to a question, or any others, at any time.

        A name that was told before with the same values is left out; with others, it gets a new name. The question
        that waits is answered by readings of about its beam or of its name, as :meth:`Action.read` makes them, and by
        what is said to answer it; it waits on after all others, and where nothing is new.

        Args:
            readings: what came of it.
            action: the question that they answer, where they do not show it themselves. It may be an earlier one, to
                which the answer comes late.

        Raises:
            InputError: the readings cannot be made into measurements; nothing has changed then.
        """
        check_readings_kind("readings", readings)
        fresh, remarks = new_readings(self._readings, readings)
        asked = self._asked
        if action is None and fresh is not None and asked is not None and answers(fresh, asked):
            action = asked
        return self._take(Observation(action, fresh, remarks))

    def resume(
        self,
        observations: Iterable[Observation],
        asked: Action | None = None,
        refused: Iterable[Action] = (),
        questions: int = 0,
    ) -> None:
        """Take what another session was told, in its order: belief and next question are then the same as there.

        Args:
            observations: of that session, see :attr:`observations`.
            asked: its question that waited for an answer.
            refused: its questions that could not be answered, see :attr:`refused`.
            questions: the largest number of its questions, see :attr:`questions`.
        """
        for action in refused:
            self.refuse(action)
        for one in observations:
            self._take(one)
        self.put(asked)
        self._questions = max(self._questions, questions)

    def _take(self, observation: Observation) -> Step:
        state, joined, fresh, action = self._state, self._joined, observation.readings, observation.action
        if fresh is not None:
            joined = fresh if joined is None else concatenate([joined, fresh])
            state = update(state, *self.sensing.touches(joined, self.probe))
        step = step_of(state, self.stop, observation)
        # only now, all of it: who interrupts the long work above finds the session as it was before
        self._state, self._joined = state, joined
        self._readings += [] if fresh is None else [fresh]
        self._steps.append(step)
        if action is not None:
            self._questions = max(self._questions, action.number)
        if fresh is not None and is_same(action, self._asked):
            self._asked = None
        return step

    def answer(self, top: int = TOP, significance: float | None = None) -> Answer:
        """The answer as of now, with status and message, as :func:`tanteo.identify` gives it.

        Args:
            top: hypotheses to report.
            significance: significance level of the joint test; that of the session if not given.
        """
        level = self.significance if significance is None else significance
        answer = answered(self._state, self.stop, self.seed, top, level)
        stuck = self._stuck()
        return answer if stuck is None else answer.adding(stuck)

    def _stuck(self) -> Stuck | None:
        """Return a sensor that gave the same range again and again; None if there is none."""
        return find_stuck(self.readings) if self.readings is not None else None

    def _open(self, candidates: Candidates) -> Candidates:
        """The candidates that can be made and are not like one that was refused."""
        candidates = unlike(candidates, self._refused)
        if self.able is None or not len(candidates):
            return candidates
        return candidates.take(self.able(self._state, candidates))

    def _place(self) -> Vectors | None:
        asked = [s.action for s in self._steps if s.action is not None]
        return asked[-1].origin if asked else None
