"""GRBL and FluidNC: ``G38.3`` for every motion that should meet nothing or may meet nothing, ``?``, ``!``, ctrl-x.

Read for it: GRBL 1.1 ``doc/markdown/interface.md`` and ``commands.md`` (grbl/grbl): ``ok`` after ``G38`` comes when the
motion has ended; a probe cycle that begins in contact ends in ``ALARM:4``; ``[PRB:...]`` is in machine coordinates, in
inches where ``$13=1``; a status may say ``MPos``, or ``WPos`` with ``WCO``; after ``!`` a reset keeps the position once
the state is ``Hold:0``.
"""

from __future__ import annotations

import queue
import re
import threading
import time
from dataclasses import dataclass

import numpy as np

from tanteo.machines.link import Link
from tanteo.machines.protocol import (
    ContactError,
    Facts,
    LateError,
    LinkLostError,
    MachineError,
    MachineState,
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
_PROBE = re.compile(r"\[PRB:([-\d.,]+):([01])\]")
_STATES: dict[str, MachineState] = {"Idle": "idle", "Run": "moving", "Jog": "moving", "Hold": "held", "Home": "moving"}
_ALARMS = {
    "1": "a limit switch", "2": "a soft limit", "3": "a reset during a motion", "4": "the probe was in contact before",
    "5": "the probe met nothing", "6": "homing was reset", "8": "homing failed", "9": "homing failed",
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _Report:
    """A status report, in the controller's unit."""

    state: str
    machine: Vectors | None
    tripped: bool
    at: float


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
        self._report: _Report | None = None
        self._heard, self._offset, self._unit = -np.inf, np.zeros(3), 1e-3
        self._stopped = ""
        self._lost: LinkLostError | None = None
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
            return MachineStatus("lost" if self._lost else "stopped" if self._stopped else "idle")
        place = None if report.machine is None else self._unit * report.machine
        state = _STATES.get(report.state.partition(":")[0], "stopped")
        state = "lost" if self._lost else "stopped" if self._stopped else state
        return MachineStatus(state, place, report.tripped, now - report.at, report.state)

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there, as a probe cycle that should meet nothing."""
        goal = T_world_probe[:3, 3]
        if self._probe(goal, speed, seconds) is not None:
            where = ", ".join(f"{1e3 * v:.3f}" for v in place_of(self))
            raise ContactError(
                f"{self.facts.name}: expected a free way, met something at ({where}) mm. Give the part more clearance."
            )

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there; nothing stops it but the controller."""
        deadline = time.monotonic() + seconds
        self._command(f"G1 {self._words(T_world_probe[:3, 3])} F{self._feed(speed)}", deadline)
        self._settled(deadline)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """``G38.3`` along the direction."""
        begun, start = time.monotonic(), place_of(self)
        met = self._probe(start + reach * direction, speed, seconds)
        distance = np.inf if met is None else float((met - start) @ direction)
        return Sensed(start, direction, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """Feed hold now, reset when it stands; from any thread, never raises."""
        self._stopped = self._stopped or "it was told to stop"
        self._held_at = self._held_at or time.monotonic()
        self._send_quietly(_HOLD)

    def write_frame(self, text: str, seconds: float) -> None:
        """Its lines one by one."""
        for line in (row for row in text.splitlines() if row and not row.startswith("(")):
            self._command(line, time.monotonic() + seconds)

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
        self._send_quietly(b"\r\n")
        while self._report is None:
            self._check()
            if time.monotonic() > deadline:
                raise LinkLostError(f"{self._link.name}: expected a GRBL status, got none. Check port and baud rate.")
            self._send_quietly(_ASK)
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
        settings = self._command("$$", deadline)
        inches = any(re.match(r"\$(13|Report/Inches)=(1|on|true)", row, re.IGNORECASE) for row in settings)
        self._unit = 25.4e-3 if inches else 1e-3
        self._command("G21 G90 G94 G54", deadline)
        offsets = self._command("$#", deadline)
        self._offset = self._unit * sum(
            (_numbers(row) for row in offsets if re.match(r"\[(G54|G92|TLO):", row)), np.zeros(3)
        )
        self._fresh(deadline)

    def _probe(self, goal: Vectors, speed: float, seconds: float) -> Vectors | None:
        """A probe cycle: where it met something ``(3,)`` [m]; None for nothing."""
        deadline = time.monotonic() + seconds
        self._check()
        if np.linalg.norm(goal - place_of(self)) < _STILL:
            return None
        if self.status().tripped:
            raise ContactError(
                f"{self.facts.name}: expected a probe that is free, got one in contact before it moved. Look at the "
                "stylus and its cable."
            )
        rows = self._command(f"G38.3 {self._words(goal)} F{self._feed(speed)}", deadline)
        found = [m for m in map(_PROBE.search, rows) if m]
        if not found:
            raise self._stop("no [PRB:...] after a probe cycle")
        self._settled(deadline)
        met = found[-1].group(2) == "1"
        return self._unit * np.array([float(v) for v in found[-1].group(1).split(",")[:3]]) if met else None

    def _words(self, place: Vectors) -> str:
        """A place of the machine in the coordinates of ``G54``."""
        return " ".join(f"{axis}{1e3 * v + 0.0:.4f}" for axis, v in zip("XYZ", place - self._offset, strict=True))

    @staticmethod
    def _feed(speed: float) -> str:
        return f"{60e3 * speed:.4g}"

    def _command(self, line: str, deadline: float) -> list[str]:
        """One line, and what is said until ``ok``."""
        with self._busy:
            self._check()
            self._forget()
            self._link.write(line.encode("ascii") + b"\n")
            rows = list[str]()
            while True:
                row = self._next(deadline, line)
                if row == "ok":
                    return rows
                if row.startswith("error"):
                    raise self._stop(f"{row} for '{line}'")
                rows.append(row)

    def _next(self, deadline: float, line: str) -> str:
        while True:
            self._check()
            try:
                return self._answers.get(timeout=0.02)
            except queue.Empty:
                if time.monotonic() > deadline:
                    self.abort()
                    raise LateError(
                        f"{self.facts.name}: expected 'ok' for '{line}' in time, got none. It was stopped: look at it."
                    ) from None

    def _settled(self, deadline: float) -> None:
        """Wait until it says that it is at rest."""
        while True:
            report = self._fresh(deadline)
            if report.state.startswith("Idle"):
                return
            if time.monotonic() > deadline:
                self.abort()
                raise LateError(
                    f"{self.facts.name}: expected it to come to rest in time, got {report.state}. Look at it."
                )

    def _fresh(self, deadline: float) -> _Report:
        """A status that was asked for from now on."""
        begun = time.monotonic()
        self._send_quietly(_ASK)
        while True:
            self._check()
            report = self._report
            if report is not None and report.at >= begun:
                return report
            if time.monotonic() > deadline:
                self.abort()
                raise LateError(
                    f"{self.facts.name}: expected a status in time, got none. It was told to stop: look at it."
                )
            time.sleep(0.001)

    def _check(self) -> None:
        if self._lost is not None:
            raise self._lost
        if self._stopped:
            raise StoppedError(
                f"{self.facts.name}: expected a machine that may move, got one that has stopped: {self._stopped}. "
                "Clear it there, and start again."
            )

    def _stop(self, got: str) -> StoppedError:
        self.abort()
        return StoppedError(f"{self.facts.name}: expected its command to be done, got {got}. It was told to stop.")

    def _forget(self) -> None:
        while not self._answers.empty():
            self._answers.get_nowait()

    def _send_quietly(self, data: bytes) -> None:
        try:
            self._link.write(data)
        except LinkLostError as error:
            self._lost = self._lost or error

    def _listen(self) -> None:
        """The thread that reads: status, alarms, answers; and that asks for the status."""
        rest, asked = b"", 0.0
        while not self._closed and self._lost is None:
            now = time.monotonic()
            if now - asked > _PERIOD:
                asked = now
                self._send_quietly(_ASK)
            self._brake(now)
            try:
                rest += self._link.read(0.05)
            except LinkLostError as error:
                self._lost = error
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
            self._send_quietly(_RESET)

    def _hear(self, row: str) -> None:
        if row.startswith("<"):
            self._report = _report_of(row, self._report, self._offset / self._unit) or self._report
        elif row.startswith("ALARM"):
            code = row.partition(":")[2].strip()
            self._stopped = self._stopped or f"{row}, {_ALARMS.get(code, 'see the manual')}"
        elif row.startswith(("Grbl ", "GrblHAL")) and self._ready:
            self._stopped = self._stopped or "the controller was reset"
        elif row:
            self._answers.put(row)


def _report_of(row: str, before: _Report | None, offset: Vectors) -> _Report | None:
    """``<Idle|MPos:0.000,0.000,0.000|FS:0,0|Pn:P>``; None where it is not whole."""
    if not row.endswith(">"):
        return None
    state, *fields = row[1:-1].split("|")
    said = dict(field.partition(":")[::2] for field in fields)
    try:
        if "MPos" in said:
            machine = np.array([float(v) for v in said["MPos"].split(",")[:3]])
        elif "WPos" in said:
            offset = np.array([float(v) for v in said["WCO"].split(",")[:3]]) if "WCO" in said else offset
            machine = np.array([float(v) for v in said["WPos"].split(",")[:3]]) + offset
        else:
            return None
    except ValueError:
        return None
    return _Report(state, machine, "P" in said.get("Pn", ""), time.monotonic())


def _numbers(row: str) -> Vectors:
    """Of ``[G54:1.000,2.000,3.000]``, or of ``[TLO:1.000]``, which is along z."""
    values = [float(v) for v in row.strip("[]").partition(":")[2].split(",")[:3]]
    return np.array(values if len(values) == 3 else [0.0, 0.0, values[0]])
