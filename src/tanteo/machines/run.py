"""A session carried out by a machine: ask, go, touch, keep, go back, tell; until it is enough or it may not move."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tanteo import io
from tanteo.machines.journal import Journal, reading_of, take_up_rows
from tanteo.machines.protocol import ContactError, RefusedError, Sensed, StoppedError
from tanteo.machines.safe import SafeMachine
from tanteo.machines.ways import Ways
from tanteo.planning import Action, Done, Session, Step, largest_corner_sd
from tanteo.words.findings import BeamsFree, NoClearPath, Stated

_REFUSED = 25
"""Questions in a row that the machine cannot answer before the run ends."""
_SDS, _LEAST_OVERTRAVEL = 3.0, 2e-3
"""How far beyond the expected contact a touch goes: times the part's largest corner sd, and the least way [m]."""


class Turn(NamedTuple):
    """One question and what came of it: ``sensed`` and ``step`` are None where it was not answered."""

    action: Action
    sensed: Sensed | None
    step: Step | None
    note: str


@dataclass(frozen=True, slots=True, eq=False)
class Probed:
    """A run that has ended.

    Attributes:
        end: why.
        turns: every question.
        stopped: why the machine does not move any more; empty if it does.
        resumed: readings of an earlier run that were kept and are told now.
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
    """Sense a part with a machine until the session has enough.

    Every reading is on the disk before it counts, the question before it is asked of the machine: after a loss of
    power, :func:`tanteo.io.read_record` and this function go on where it was.

    Args:
        session: what is known and asked.
        machine: what moves.
        record: of the session; None keeps nothing.
        watch: called after every question.
    """
    run = _Run(session, machine, record)
    resumed = run.take_up()
    turns, in_vain, stopped = list[Turn](), 0, ""
    while isinstance(action := session.ask(), Action):
        try:
            turn = run.answer(action)
        except StoppedError as error:
            stopped, turn = str(error), Turn(action, run.sensed, None, str(error))
        turns.append(turn)
        watch(turn)
        in_vain = in_vain + 1 if turn.step is None else 0
        if stopped or in_vain >= _REFUSED:
            end = Stated(stopped) if stopped else NoClearPath("machine", last=True)
            return Probed(Done(False, (end,)), tuple(turns), stopped, resumed)
    return Probed(action, tuple(turns), "", resumed)


@dataclass(slots=True, eq=False)
class _Run:
    session: Session
    machine: SafeMachine
    record: str | Path | None
    before: Action | None = None
    sensed: Sensed | None = None

    def take_up(self) -> int:
        """What an earlier run kept and did not tell."""
        if self.record is None:
            return 0
        journal = Journal(self.record)
        count = take_up_rows(self.session, journal.rows())
        if count:
            self._save()
        return count

    def answer(self, action: Action) -> Turn:
        """Go there, sense, tell."""
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
            if self.sensed is not None:  # it stopped on the way back: the reading was made, and it counts
                self._tell(action, self.sensed)
            raise
        return Turn(action, sensed, self._tell(action, sensed), "" if sensed.met else BeamsFree().message)

    def _tell(self, action: Action, sensed: Sensed) -> Step:
        step = self.session.tell(reading_of(action, sensed), action)
        if not sensed.met or not step.ids:  # what brought nothing new would be asked for ever
            self.session.refuse(action)
        self._save()
        return step

    def _go(self, action: Action) -> None:
        ways = Ways.around(self.session.start, self.session.probe, turns=self.machine.facts.turns)
        here = self.machine.place()
        way = ways.to(action, self.before, here)
        self.before = None  # on the way it is nowhere in particular
        for T in way:
            self.machine.move(T)
        self.before = action

    def _reach(self, action: Action) -> float:
        """How far to look [m]; a range sensor as far as it sees."""
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
                f"{self.record}: expected a file that can be written, got: {error.strerror}. Free the disk; resume."
            ) from None
        Journal(self.record).forget()
