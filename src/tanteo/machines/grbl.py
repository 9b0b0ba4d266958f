"""Drive GRBL and FluidNC controllers: ``G38.3`` for guarded motions, ``?`` for status, ``!`` and ctrl-x to stop.

Source: GRBL 1.1, ``doc/markdown/interface.md`` and ``commands.md`` (grbl/grbl). The ``ok`` of a ``G38`` arrives when
the motion has ended. A probe cycle that begins in contact ends in ``ALARM:4``. After ``!``, a reset keeps the position
once the state is ``Hold:0``.
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

_HOLD, _RESET, _QUERY = b"!", b"\x18", b"?"
_PERIOD = 0.2
"""Time between two status requests [s]: GRBL recommends at most 5 Hz."""
_HOLDS = 0.5
"""Time from a feed hold to the reset if the controller does not report the hold [s]."""


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
        self._report: Report | None = None
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
        """Request all work offsets at once by ``$#``, in the controller's unit; GRBL has no rotated frames."""
        found = offsets_of(self._command("$#", deadline))
        acting = (found[name] for name in ("G54", "G92", "TLO") if name in found)
        self._frame = WorkFrame(self._unit * sum(acting, np.zeros(3)))
        unknown = np.full(3, np.nan)
        return {slot: offsets.padded(1e3 * self._unit * found.get(slot, unknown)) for slot in slots}

    def _contact(self, rows: Sequence[str], deadline: float) -> Vectors | None:
        """Return the contact from the controller's ``[PRB:...]`` row."""
        found = probed(rows)
        if found is None:
            raise self._latch.failed("no [PRB:...] row after a probe cycle")
        return self._unit * found[0] if found[1] else None

    def _at_rest(self, deadline: float) -> bool:
        return self._fresh(deadline).state.startswith("Idle")

    def _command(self, line: str, deadline: float) -> list[str]:
        """Send one line; return the rows that arrive before ``ok``."""
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
