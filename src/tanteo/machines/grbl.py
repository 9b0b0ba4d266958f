"""GRBL and FluidNC: ``G38.3`` for every motion that should meet nothing or may meet nothing, ``?``, ``!``, ctrl-x.

Read for it: GRBL 1.1 ``doc/markdown/interface.md`` and ``commands.md`` (grbl/grbl): ``ok`` after ``G38`` comes when the
motion has ended; a probe cycle that begins in contact ends in ``ALARM:4``; after ``!`` a reset keeps the position once
the state is ``Hold:0``.
"""

from __future__ import annotations

import queue
import re
import threading
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines import offsets
from tanteo.machines.gcode_machine import UNITS, GcodeMachine
from tanteo.machines.grbl_words import ALARMS, STATES, Report, offsets_of, probed, report_of
from tanteo.machines.link import Link
from tanteo.machines.offsets import WorkFrame
from tanteo.machines.protocol import Facts, LinkLostError, MachineStatus, StoppedError
from tanteo.machines.row_reader import RowReader

_HOLD, _RESET, _ASK = b"!", b"\x18", b"?"
_PERIOD = 0.2
"""Between two questions for the status [s]: GRBL asks for 5 Hz at most."""
_HOLDS = 0.5
"""From a feed hold to the reset, if the controller does not say that it holds [s]."""


class GrblMachine(GcodeMachine):
    """A GRBL or FluidNC controller with a touch probe.

    Attributes:
        facts: what does not change.

    Raises:
        StoppedError: it is in alarm; it is never unlocked or homed from here.
        LinkLostError: nobody answers.
    """

    def __init__(self, link: Link, seconds: float = 5.0) -> None:
        super().__init__(link, "GRBL", "grbl")
        self._answers, self._busy, self._ready = queue.SimpleQueue[str](), threading.Lock(), False
        self._report: Report | None = None
        self._asked, self._held_at, self._reset_sent = 0.0, 0.0, False
        self._reader = RowReader(link, self._latch, self._hear, self._turn)
        self._open(time.monotonic() + seconds)

    def status(self) -> MachineStatus:
        """What was heard last."""
        report, now = self._report, time.monotonic()
        if report is None:
            return MachineStatus(self._latch.state("idle"))
        state = self._latch.state(STATES.get(report.state.partition(":")[0], "stopped"))
        return MachineStatus(state, self._unit * report.machine, report.tripped, now - report.at, report.state)

    def _halt(self) -> None:
        """Feed hold now, reset when it stands."""
        self._held_at = self._held_at or time.monotonic()
        self._latch.send(self._link, _HOLD)

    def _hang_up(self) -> None:
        self._reader.close()

    def _begin(self, deadline: float) -> None:
        """Its name, unit and offsets; millimetres, absolute, ``G54`` from here on."""
        self._latch.send(self._link, b"\r\n")
        while self._report is None:
            self._latch.check()
            if time.monotonic() > deadline:
                raise LinkLostError(f"{self._link.name}: expected a GRBL status, got none. Check port and baud rate.")
            self._latch.send(self._link, _ASK)
            time.sleep(0.05)
        time.sleep(0.1)  # what it says of itself after a reset
        state = self._report.state
        if not state.startswith("Idle"):
            raise StoppedError(
                f"{self._link.name}: expected an idle controller, got {state}. Clear it there ($H homes, $X unlocks)."
            )
        self._forget()
        self._ready = True
        name = next((row for row in self._command("$I", deadline) if row.startswith("[VER:")), "[VER:]")
        self.facts = Facts(f"GRBL {name[5:].split(':')[0]}".rstrip("] "), "grbl")
        self._latch.name = self.facts.name
        settings = self._command("$$", deadline)
        inches = any(re.match(r"\$(13|Report/Inches)=(1|on|true)", row, re.IGNORECASE) for row in settings)
        self._unit = UNITS["INCH" if inches else "MM"]
        self._command("G21 G90 G94 G54", deadline)
        self._read_frames((), deadline)
        self._fresh(deadline)

    def _read_frames(self, slots: Iterable[str], deadline: float) -> dict[str, Vectors]:
        """All are said at once, in the controller's unit; it knows no turn."""
        found = offsets_of(self._command("$#", deadline))
        acting = (found[name] for name in ("G54", "G92", "TLO") if name in found)
        self._frame = WorkFrame(self._unit * sum(acting, np.zeros(3)))
        unknown = np.full(3, np.nan)
        return {slot: offsets.padded(1e3 * self._unit * found.get(slot, unknown)) for slot in slots}

    def _contact(self, said: Sequence[str], deadline: float) -> Vectors | None:
        """By its ``[PRB:...]``."""
        found = probed(said)
        if found is None:
            raise self._latch.failed("no [PRB:...] after a probe cycle")
        return self._unit * found[0] if found[1] else None

    def _at_rest(self, deadline: float) -> bool:
        return self._fresh(deadline).state.startswith("Idle")

    def _command(self, line: str, deadline: float) -> list[str]:
        """What is said until ``ok``."""
        with self._busy:
            self._latch.check()
            self._forget()
            self._link.write(line.encode("ascii") + b"\n")
            rows = list[str]()
            while True:
                row = self._next(deadline, line)
                if row == "ok":
                    return rows
                if row.startswith("error"):
                    raise self._latch.failed(f"{row} for '{line}'")
                rows.append(row)

    def _next(self, deadline: float, line: str) -> str:
        while True:
            self._latch.check()
            with suppress(queue.Empty):
                return self._answers.get(timeout=0.02)
            self._latch.late(deadline, f"'ok' for '{line}'")

    def _fresh(self, deadline: float) -> Report:
        """A status that was asked for from now on."""
        begun = time.monotonic()
        self._latch.send(self._link, _ASK)
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

    def _turn(self) -> None:
        """Of the thread that reads: the status is asked for; after a feed hold, the reset forgets what is queued."""
        now, report = time.monotonic(), self._report
        if now - self._asked > _PERIOD:
            self._asked = now
            self._latch.send(self._link, _ASK)
        if not self._held_at or self._reset_sent:
            return
        stands = report is not None and report.at > self._held_at and report.state in ("Hold:0", "Idle", "Alarm")
        if stands or now - self._held_at > _HOLDS:
            self._reset_sent = True
            self._latch.send(self._link, _RESET)

    def _hear(self, row: str) -> None:
        if row.startswith("<"):
            self._report = report_of(row, self._frame.offset / self._unit) or self._report
        elif row.startswith("ALARM"):
            code = row.partition(":")[2].strip()
            self._latch.stop(f"{row}, {ALARMS.get(code, 'see the manual')}")
        elif row.startswith(("Grbl ", "GrblHAL")) and self._ready:
            self._latch.stop("the controller was reset")
        elif row:
            self._answers.put(row)
