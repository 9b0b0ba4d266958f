"""Drive GRBL and FluidNC controllers: ``G38.3`` for guarded motions, ``?`` for status, ``!`` and ctrl-x to stop.

Source: GRBL 1.1, ``doc/markdown/interface.md``, ``commands.md`` and ``grbl/motion_control.c`` (gnea/grbl). The ``ok``
of a ``G38`` arrives when the motion has ended. A probe cycle that begins in contact ends in ``ALARM:4``. After ``!``, a
cycle continues with ``~`` until a reset cancels it; the reset keeps the position once the state is ``Hold:0``.
"""

from __future__ import annotations

import queue
import re
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines import offsets
from tanteo.machines.gcode_machine import UNITS, GcodeMachine
from tanteo.machines.grbl_words import (
    ALARMS,
    MODES,
    STATES,
    Report,
    acting,
    deceleration_of,
    in_inches,
    modes_of,
    offsets_of,
    probed,
    report_of,
)
from tanteo.machines.link import Link
from tanteo.machines.offsets import WorkFrame
from tanteo.machines.protocol import LinkLostError, MachineStatus, StoppedError, quoted
from tanteo.machines.row_reader import RowReader

_T = TypeVar("_T")
_HOLD, _RESET, _QUERY = b"!", b"\x18", b"?"
_PERIOD = 0.2
"""Time between two status requests [s]: GRBL recommends at most 5 Hz."""
_UNANSWERED = 2.0
"""Time for which a controller rests without an 'ok' before the line or its 'ok' counts as lost [s].

A controller acknowledges a motion when it is queued, and a probe when it ends, both within one status period of rest;
this is ten of them (``_PERIOD``).
"""
_HOLDS = 0.5
"""Time from a feed hold to the reset if the controller does not report the hold [s]."""
_WITH_OFFSET = 12
"""Number of status requests at the start: GRBL reports the sum of the offsets at least in every tenth of them."""
_ROUNDED = {UNITS["MM"]: 2.5e-3, UNITS["INCH"]: 2.5e-4}
"""Largest difference between the sum of three rounded offsets and the rounded sum: 2 of the last digits of GRBL."""
_MOST_ROWS = 1000
"""Largest number of rows of one answer; the longest of GRBL, ``$$``, has 34."""


class GrblMachine(GcodeMachine):
    """Driver of a GRBL or FluidNC controller with a touch probe.

    Attributes:
        facts: constant properties of the machine.

    Raises:
        StoppedError: the controller is in an alarm state; the driver never unlocks or homes it.
        LinkLostError: no controller answers.
    """

    def __init__(self, link: Link, seconds: float = 5.0) -> None:
        super().__init__(link, "GRBL", "grbl")
        self._answers, self._busy, self._ready = queue.SimpleQueue[str](), threading.Lock(), False
        self._pending = False
        self._report: Report | None = None
        self._rests_since = np.inf  # time of the first of the statuses that report rest
        self._polled_at, self._hold_sent_at, self._reset_sent = 0.0, 0.0, False
        self._reader = RowReader(link, self._latch, self._hear, self._turn)
        self._open(time.monotonic() + seconds)

    def status(self) -> MachineStatus:
        """Return the most recent status."""
        report, now = self._report, time.monotonic()
        if report is None:
            return MachineStatus(self._latch.state("idle"))
        state = self._latch.state(STATES.get(report.state.partition(":")[0], "stopped"))
        return MachineStatus(state, self._unit * report.machine, report.tripped, now - report.at, report.state)

    def _halt(self) -> None:
        """Send a feed hold; the reader thread sends the reset when the machine is at rest."""
        self._hold_sent_at = self._hold_sent_at or time.monotonic()
        self._latch.send(self._link, _HOLD)

    def _finish_stop(self) -> None:
        """Wait until the reset that cancels a held cycle is sent, and a moment until the controller has taken it."""
        if not self._hold_sent_at:
            return
        while not self._reset_sent and self._latch.lost is None:
            if time.monotonic() > self._hold_sent_at + 2 * _HOLDS:  # the reader thread has ended
                self._reset()
            time.sleep(0.005)
        time.sleep(0.05)

    def _reset(self) -> None:
        self._reset_sent = True
        self._latch.send(self._link, _RESET)

    def _hang_up(self) -> None:
        self._reader.close()

    def _begin(self, deadline: float) -> None:
        """Read name, unit and offsets; set millimetres, absolute coordinates and ``G54``."""
        self._latch.send(self._link, b"\r\n")
        while self._report is None:
            self._latch.check()
            if time.monotonic() > deadline:
                raise LinkLostError(f"{self._link.name}: expected a GRBL status, got none. Check port and baud rate.")
            self._latch.send(self._link, _QUERY)
            time.sleep(0.05)
        time.sleep(0.1)  # the controller sends its banner after a reset
        state = self._report.state
        if not state.startswith("Idle"):
            raise StoppedError(
                f"{self._link.name}: expected an idle controller, got {state}. Clear it there ($H homes, $X unlocks)."
            )
        version = self._synchronize(deadline)
        self.facts = replace(self.facts, name=f"GRBL {version}".rstrip())
        self._latch.name = self.facts.name
        settings = self._command("$$", deadline)
        self._unit = UNITS["INCH" if self._parsed(in_inches, settings) else "MM"]
        deceleration = deceleration_of(settings)
        self.facts = replace(self.facts, deceleration=deceleration or self.facts.deceleration)
        self._command(" ".join(MODES), deadline)
        self._read_frames((), deadline)
        for _ in range(_WITH_OFFSET):
            self._compare_offset(self._fresh(deadline))
        self._verify(deadline)

    def _synchronize(self, deadline: float) -> str:
        """Request the version; rows before its answer belong to earlier lines, and every later one must be expected."""
        self._link.write(b"$I\n")
        version: str | None = None
        while (row := self._next(deadline, "$I")) != "ok" or version is None:
            if row.startswith("[VER:"):
                version = row[5:].rstrip("]").split(":")[0]
        self._ready = True
        return version

    def _parsed(self, parse: Callable[[Sequence[str]], _T], rows: Sequence[str]) -> _T:
        """Return the content of an answer, or raise the error of one that cannot be read."""
        try:
            return parse(rows)
        except ValueError as error:
            expected, reply = error.args
            raise self._latch.bent(reply, expected) from None

    def _read_frames(self, slots: Iterable[str], deadline: float) -> dict[str, Vectors]:
        """Request all work offsets at once by ``$#``, in the controller's unit; GRBL has no rotated frames."""
        found = self._parsed(offsets_of, self._command("$#", deadline))
        self._frame = WorkFrame(self._unit * acting(found))
        unknown = np.full(3, np.nan)
        return {slot: offsets.padded(1e3 * self._unit * found.get(slot, unknown)) for slot in slots}

    def _verify(self, deadline: float) -> None:
        """Compare the state, ``$G`` and ``$#`` with what this driver has set."""
        self._latch.check()
        state = self._fresh(deadline).state
        if not state.startswith("Idle"):
            raise self._latch.changed(f"the state {state} in place of Idle")
        modes = self._parsed(modes_of, self._command("$G", deadline))
        if missing := [mode for mode in MODES if mode not in modes]:
            raise self._latch.changed(f"{' '.join(modes)} without {' '.join(missing)}")
        if "M3" in modes or "M4" in modes:
            raise self._latch.changed("a spindle that turns")
        now = WorkFrame(self._unit * acting(self._parsed(offsets_of, self._command("$#", deadline))))
        if what := offsets.changes(self._frame, now):
            raise self._latch.changed(what)
        self._compare_offset(self._fresh(deadline))

    def _compare_offset(self, report: Report) -> None:
        """Compare the sum of the offsets in a status, if it contains one, with the frame of this driver."""
        if report.offset is None:
            return
        off = np.abs(report.offset - self._frame.offset / self._unit)
        if not (off <= _ROUNDED[self._unit]).all():
            raise self._latch.changed(f"offsets (WCO) of {report.offset.tolist()} in its status")

    def _contact(self, rows: Sequence[str], deadline: float) -> tuple[bool, Vectors]:
        """Return contact and position from the controller's ``[PRB:...]`` row."""
        place, hit = self._parsed(probed, rows)
        return hit, self._unit * place

    def _at_rest(self, deadline: float) -> bool:
        return self._fresh(deadline).state.startswith("Idle")

    def _command(self, line: str, deadline: float) -> list[str]:
        """Send one line; return the rows that arrive before ``ok``."""
        with self._busy:
            self._latch.check()
            self._forget()
            self._pending = True
            self._link.write(line.encode("ascii") + b"\n")
            rows = list[str]()
            while True:
                row = self._next(deadline, line)
                if row == "ok":
                    return rows
                if row.startswith("error"):
                    raise self._latch.failed(f"{quoted(row)} for '{line}'")
                rows.append(row)
                if len(rows) > _MOST_ROWS:
                    raise self._latch.bent(row, f"'ok' for '{line}' within {_MOST_ROWS} rows")

    def _next(self, deadline: float, line: str) -> str:
        """Return the next row of an answer; stop early if the controller rests and does not acknowledge the line."""
        sent = time.monotonic()
        while True:
            self._latch.check()
            self._latch.late(deadline, f"'ok' for '{line}'")
            with suppress(queue.Empty):
                return self._answers.get(timeout=0.02)
            report = self._report
            if report is not None and report.at - max(sent, self._rests_since) > _UNANSWERED:
                self._latch.late(0.0, f"'ok' for '{line}' (it has rested for {_UNANSWERED:g} s)")

    def _fresh(self, deadline: float) -> Report:
        """Request a status, and return the first one that arrives from now on."""
        begun = time.monotonic()
        self._latch.send(self._link, _QUERY)
        while True:
            self._latch.check()
            report = self._report
            if report is not None and report.at >= begun:
                return report
            self._latch.late(deadline, "a status")
            time.sleep(0.001)

    def _forget(self) -> None:
        while not self._answers.empty():
            self._answers.get_nowait()

    @property
    def _bent_at_first(self) -> tuple[type[Exception], ...]:
        """Errors of a status that are ignored: a row may have begun before the connection."""
        return () if self._ready else (ValueError,)

    def _turn(self) -> None:
        """Request the status in the reader thread; after a feed hold, send the reset that clears queued lines."""
        now, report = time.monotonic(), self._report
        if now - self._polled_at > _PERIOD:
            self._polled_at = now
            self._latch.send(self._link, _QUERY)
        if not self._hold_sent_at or self._reset_sent:
            return
        stands = report is not None and report.at > self._hold_sent_at and report.state in ("Hold:0", "Idle", "Alarm")
        if stands or now - self._hold_sent_at > _HOLDS:
            self._reset()

    def _hear(self, row: str) -> None:
        """Take one row; raise ValueError with the expected reply and the row if it has another form."""
        if row.startswith("<"):
            with suppress(*self._bent_at_first):
                report = report_of(row, self._frame.offset / self._unit)
                if not report.state.startswith("Idle"):
                    self._rests_since = np.inf
                elif self._rests_since == np.inf:
                    self._rests_since = report.at
                self._report = report
        elif not self._ready:
            self._answers.put(row)
        elif row.startswith("ALARM"):
            code = row.partition(":")[2].strip()
            self._latch.stop(f"{quoted(row)}, {ALARMS.get(code, 'see the manual')}")
        elif row.startswith(("Grbl ", "GrblHAL")):
            self._latch.stop("the controller was reset")
        elif row == "ok" or re.fullmatch(r"error:\d+", row):
            if not self._pending:
                raise ValueError("an acknowledgement for each line", row)
            self._pending = False
            self._answers.put(row)
        elif row.startswith(("[", "$")):
            if self._pending:
                self._answers.put(row)
        elif row:
            raise ValueError("a message of GRBL", row)
