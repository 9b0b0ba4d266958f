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
from contextlib import suppress

import numpy as np

from tanteo.machines import offsets
from tanteo.machines.gcode import feed_word, place_words
from tanteo.machines.grbl_words import ALARMS, STATES, Report, offsets_of, probed, report_of
from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.protocol import (
    Facts,
    LinkLostError,
    MachineError,
    MachineStatus,
    Sensed,
    StoppedError,
    place_of,
)
from tanteo.typing import Transforms, Vectors

_HOLD, _RESET, _ASK = b"!", b"\x18", b"?"
_PERIOD = 0.2
"""Between two questions for the status [s]: GRBL asks for 5 Hz at most."""
_BRAKE = 0.5
"""From a feed hold to the reset, if the controller does not say that it holds [s]."""
_STILL = 1e-6
"""A motion shorter than this is none [m]: GRBL calls it an error."""


class GrblMachine:
    """A GRBL or FluidNC controller with a touch probe.

    Attributes:
        facts: what does not change.

    Raises:
        StoppedError: it is in alarm; it is never unlocked or homed from here.
        LinkLostError: nobody answers.
    """

    def __init__(self, link: Link, seconds: float = 5.0) -> None:
        self._link, self._answers = link, queue.SimpleQueue[str]()
        self._report: Report | None = None
        self._offset, self._unit = np.zeros(3), 1e-3
        self._latch = Latch("GRBL", "Clear it there", self.abort)
        self._held_at, self._reset_sent, self._closed = 0.0, False, False
        self._busy, self._ready = threading.Lock(), False
        self.facts = Facts("GRBL", "grbl")
        self._listener = threading.Thread(target=self._listen, daemon=True, name="grbl")
        self._listener.start()
        try:
            self._begin(seconds)
        except MachineError:
            self.close()
            raise

    def status(self) -> MachineStatus:
        """What was heard last."""
        report, now = self._report, time.monotonic()
        if report is None:
            return MachineStatus(self._latch.state("idle"))
        state = self._latch.state(STATES.get(report.state.partition(":")[0], "stopped"))
        return MachineStatus(state, self._unit * report.machine, report.tripped, now - report.at, report.state)

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there, as a probe cycle that should meet nothing."""
        goal = T_world_probe[:3, 3]
        if self._probe(goal, speed, seconds) is not None:
            raise self._latch.met(place_of(self))

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there; nothing stops it but the controller."""
        deadline = time.monotonic() + seconds
        self._command(f"G1 {place_words(T_world_probe[:3, 3] - self._offset)} {feed_word(speed)}", deadline)
        self._settled(deadline)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """``G38.3`` along the direction."""
        begun, start = time.monotonic(), place_of(self)
        met = self._probe(start + reach * direction, speed, seconds)
        distance = np.inf if met is None else float((met - start) @ direction)
        return Sensed(start, direction, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """Feed hold now, reset when it stands; from any thread, never raises."""
        self._latch.stop("it was told to stop")
        self._held_at = self._held_at or time.monotonic()
        self._latch.send(self._link, _HOLD)

    def write_frame(self, text: str, seconds: float) -> None:
        """Its lines one by one; what they set is read back.

        Raises:
            MachineError: the controller has another frame than it was told.
        """
        deadline = time.monotonic() + seconds
        for line in offsets.commands(text):
            self._command(line, deadline)
        there = self._read_offsets(deadline)
        for slot, wanted in offsets.frames_in(text).items():
            offsets.check(
                self.facts.name, slot, wanted, offsets.padded(1e3 * self._unit * there.get(slot, np.full(3, np.nan)))
            )

    def close(self) -> None:
        """Stop what moves, and let go; never raises."""
        if self.status().state == "moving":
            self.abort()
            time.sleep(2 * _PERIOD)
        self._closed = True
        self._listener.join(0.5)  # it may be reading
        self._link.close()

    def _begin(self, seconds: float) -> None:
        """Its name, unit and offsets; millimetres, absolute, ``G54`` from here on."""
        deadline = time.monotonic() + seconds
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
        self._unit = 25.4e-3 if inches else 1e-3
        self._command("G21 G90 G94 G54", deadline)
        self._read_offsets(deadline)
        self._fresh(deadline)

    def _read_offsets(self, deadline: float) -> dict[str, Vectors]:
        """All of them, in the controller's unit; those that act on ``G54`` count from here on."""
        found = offsets_of(self._command("$#", deadline))
        acting = (found[name] for name in ("G54", "G92", "TLO") if name in found)
        self._offset = self._unit * sum(acting, np.zeros(3))
        return found

    def _probe(self, goal: Vectors, speed: float, seconds: float) -> Vectors | None:
        """A probe cycle: where it met something ``(3,)`` [m]; None for nothing."""
        deadline = time.monotonic() + seconds
        self._latch.check()
        if np.linalg.norm(goal - place_of(self)) < _STILL:
            return None
        if self.status().tripped:
            raise self._latch.in_contact()
        rows = self._command(f"G38.3 {place_words(goal - self._offset)} {feed_word(speed)}", deadline)
        found = probed(rows)
        if found is None:
            raise self._latch.failed("no [PRB:...] after a probe cycle")
        self._settled(deadline)
        return self._unit * found[0] if found[1] else None

    def _command(self, line: str, deadline: float) -> list[str]:
        """One line, and what is said until ``ok``."""
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

    def _settled(self, deadline: float) -> None:
        """Wait until it says that it is at rest."""
        while True:
            report = self._fresh(deadline)
            if report.state.startswith("Idle"):
                return
            self._latch.late(deadline, "it to come to rest")

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

    def _listen(self) -> None:
        """The thread that reads: status, alarms, answers; and that asks for the status."""
        rest, asked = b"", 0.0
        while not self._closed and self._latch.lost is None:
            now = time.monotonic()
            if now - asked > _PERIOD:
                asked = now
                self._latch.send(self._link, _ASK)
            self._brake(now)
            try:
                rest += self._link.read(0.05)
            except LinkLostError as error:
                self._latch.lose(error)
                return
            *rows, rest = rest.split(b"\n")
            for row in rows:
                self._hear(row.decode("ascii", "replace").strip())

    def _brake(self, now: float) -> None:
        """After a feed hold, the reset: what is still in the controller's queue is forgotten."""
        if not self._held_at or self._reset_sent:
            return
        report = self._report
        stands = report is not None and report.at > self._held_at and report.state in ("Hold:0", "Idle", "Alarm")
        if stands or now - self._held_at > _BRAKE:
            self._reset_sent = True
            self._latch.send(self._link, _RESET)

    def _hear(self, row: str) -> None:
        if row.startswith("<"):
            self._report = report_of(row, self._offset / self._unit) or self._report
        elif row.startswith("ALARM"):
            code = row.partition(":")[2].strip()
            self._latch.stop(f"{row}, {ALARMS.get(code, 'see the manual')}")
        elif row.startswith(("Grbl ", "GrblHAL")) and self._ready:
            self._latch.stop("the controller was reset")
        elif row:
            self._answers.put(row)
