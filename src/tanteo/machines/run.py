"""Carry a session out with a machine: move to each question's start, touch, store the reading, retract, update."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tanteo import io
from tanteo.machines.contact_watch import ContactWatch
from tanteo.machines.journal import Journal, reading_of, take_up_rows
from tanteo.machines.protocol import ContactError, RefusedError, Sensed, StoppedError
from tanteo.machines.safe import SafeMachine
from tanteo.machines.signals import stop_on_signals
from tanteo.machines.ways import Ways
from tanteo.planning import Action, Done, Session, Step
from tanteo.planning.stopping import largest_corner_sd
from tanteo.words.findings import BeamsFree, NoClearPath, Stated

_REFUSED = 25
"""Number of consecutive questions without an answer after which the run ends."""
_SDS, _LEAST_OVERTRAVEL = 3.0, 2e-3
"""Search distance beyond the expected contact: multiple of the largest corner sd, and smallest distance [m]."""


class Turn(NamedTuple):
    """One question and its result.

    Attributes:
        action: question.
        sensed: result of the motion; None if there was none.
        step: step of the session; None if the question was not answered.
        note: message about the result; empty for a contact.
    """

    action: Action
    sensed: Sensed | None
    step: Step | None
    note: str


@dataclass(frozen=True, slots=True, eq=False)
class Probed:
    """Result of a run.

    Attributes:
        end: reason for the end of the session.
        turns: questions with their results, in order.
        stopped: reason for which the machine stopped; empty if it can still move.
        resumed: number of stored readings of an earlier run that the session received at the start.
    """

    end: Done
    turns: tuple[Turn, ...]
    stopped: str = ""
    resumed: int = 0


def probe_part(
    session: Session,
    machine: SafeMachine,
    record: str | Path | None = None,
    watch: Callable[[Turn], None] = lambda turn: None,
) -> Probed:
    """Sense a part with a machine until the session ends.

    The record stores every question before the machine moves, and a journal stores every reading before the session
    uses it. After a power failure, :func:`tanteo.io.read_record` and this function continue the run. A signal that
    would end the process stops and closes the machine (:func:`tanteo.machines.stop_on_signals`).

    Args:
        session: session that chooses the readings.
        machine: machine that takes them.
        record: file of the session record; None to store nothing.
        watch: function that is called after every question.
    """
    with stop_on_signals(machine):
        return _probed(session, machine, record, watch)


def _probed(session: Session, machine: SafeMachine, record: str | Path | None, watch: Callable[[Turn], None]) -> Probed:
    run = _Run(session, machine, record)
    resumed = run.take_up()
    turns, in_vain, stopped = list[Turn](), 0, ""
    while isinstance(action := session.ask(), Action):
        try:
            turn = run.answer(action)
        except StoppedError as error:
            stopped, turn = str(error), Turn(action, run.sensed, None, str(error))
        turns.append(turn)
        stopped = stopped or run.missed
        watch(turn)
        in_vain = in_vain + 1 if turn.step is None else 0
        if stopped or in_vain >= _REFUSED:
            end = Stated(stopped) if stopped else NoClearPath("machine", last=True, reason=turns[-1].note)
            return Probed(Done(False, (end,)), tuple(turns), stopped, resumed)
    return Probed(action, tuple(turns), "", resumed)


@dataclass(slots=True, eq=False)
class _Run:
    session: Session
    machine: SafeMachine
    record: str | Path | None
    before: Action | None = None
    sensed: Sensed | None = None
    missed: str = ""
    contacts: ContactWatch = field(default_factory=ContactWatch)

    def take_up(self) -> int:
        """Pass the stored readings of an earlier run to the session; return their number."""
        if self.record is None:
            return 0
        journal = Journal(self.record)
        count = take_up_rows(self.session, journal.rows())
        if count:
            self._save()
        return count

    def answer(self, action: Action) -> Turn:
        """Move to the start of a question, sense, and update the session."""
        self.sensed = None
        self._save()
        try:
            self._go(action)
            with self.machine.touching():
                sensed = self.machine.sense(action.direction, self._reach(action))
                if self.machine.dry_run:
                    sensed = Sensed(sensed.start, sensed.direction, action.expected, sensed.reach)
                elif self.record is not None:
                    Journal(self.record).keep(action, sensed)
                self.sensed = sensed
        except (RefusedError, ContactError) as error:
            self.session.refuse(action)
            return Turn(action, None, None, str(error))
        except StoppedError:
            if self.sensed is not None:  # the machine stopped during retraction; the reading is valid
                self._report(action, self.sensed)
            raise
        return Turn(action, sensed, self._report(action, sensed), "" if sensed.hit else BeamsFree().message)

    def _report(self, action: Action, sensed: Sensed) -> Step:
        if self.machine.facts.contact and not self.machine.facts.recorded and not self.machine.dry_run:
            self.missed = self.missed or self.contacts.missed(self.session, sensed)
            if self.missed:
                self.machine.forbid(self.missed)
        step = self.session.tell(reading_of(action, sensed, self.session), action)
        if not sensed.hit or not step.ids:  # the session would choose the same question again without a refusal
            self.session.refuse(action)
        self._save()
        return step

    def _go(self, action: Action) -> None:
        ways = Ways.from_start(self.session.start, self.session.probe, turns=self.machine.facts.turns)
        here = self.machine.place()
        way = ways.to(action, self.before, here)
        self.before = None  # after a failed motion the machine is not at the start of a question
        for T in way:
            self.machine.move(T)
        self.before = action

    def _reach(self, action: Action) -> float:
        """Return the largest distance of a touch [m]; for a range sensor its largest range."""
        if not self.machine.facts.contact:
            return action.max_range
        beyond = max(_LEAST_OVERTRAVEL, _SDS * largest_corner_sd(self.session.state))
        reach = min(action.expected + beyond, action.max_range, self.machine.limits.reach)
        return float(np.maximum(reach, 1e-4))

    def _save(self) -> None:
        if self.record is None or self.machine.dry_run:
            return
        try:
            io.write_record(self.session, self.record)
        except OSError as error:
            self.machine.abort("the record could not be written")
            raise StoppedError(
                f"{self.record}: expected a file that can be written, got: {error.strerror}. Free disk space, then "
                "resume."
            ) from None
        Journal(self.record).forget()
