"""Drive LinuxCNC under linuxcncrsh: ``G38.3`` by MDI, contact positions from the interpreter's parameters.

No request returns parameters, but ``GET OPERATOR_DISPLAY`` returns the message of ``(debug, #5061)``. The first display
that requests a message takes it. If another display has taken it, the driver sends the block again. ``G38`` and the
parameters ``#5061`` to ``#5070``, ``#5210`` to ``#5230`` and ``#<_metric>`` are defined in ``docs/src/gcode`` of
LinuxCNC/linuxcnc, and ``Interp::convert_param_comment`` writes them into messages. ``G53`` is valid with ``G0`` and
``G1`` only.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.machines import offsets
from tanteo.machines.gcode import MODES
from tanteo.machines.gcode_machine import UNITS, GcodeMachine
from tanteo.machines.link import Link
from tanteo.machines.linuxcncrsh import RshClient
from tanteo.machines.offsets import WorkFrame
from tanteo.machines.protocol import LinkLostError, MachineState, MachineStatus, StoppedError, place_of, quoted
from tanteo.machines.replies import numbers_of

CONNECT, ENABLE = "EMC", "EMCTOO"
"""Default passwords of linuxcncrsh."""
_AGAIN = 0.5
"""Time after which the driver requests a message again [s]."""
_POLLED = ("ESTOP", "MACHINE", "PROGRAM_STATUS", "MODE", "PROBE_VALUE", "ABS_ACT_POS")
"""Names of the values that form a status, the position last."""
_VALUES = {
    "ESTOP": ("ON", "OFF"), "MACHINE": ("ON", "OFF"), "PROGRAM_STATUS": ("IDLE", "RUNNING", "PAUSED"),
    "MODE": ("MANUAL", "AUTO", "MDI"), "PROBE_VALUE": ("0", "1"),
}  # fmt: skip
"""Possible answers, by name."""
_EXPECTED_MODES = {"5220": 1, "<_metric>": 1, "<_absolute>": 1, "<_units_per_minute>": 1, "<_spindle_on>": 0}
"""Parameters of the modes that the lines of the driver set, and of the spindle, with their values before a motion."""
_OFFSETS = "5221", "5222", "5223", "5211", "5212", "5213", "5230", "5210"
"""Parameters of the offset of ``G54``, of ``G92``, of the rotation, and whether ``G92`` is active."""
_SETTLES = 1.0
"""Largest time from an abort to its end [s]."""
_STATES: dict[str, MachineState] = {"RUNNING": "moving", "PAUSED": "held"}


class LinuxCncMachine(GcodeMachine):
    """Driver of a LinuxCNC machine with a touch probe on ``motion.probe-input``.

    Positions and offsets are in the machine's unit; contact positions are in the program's unit.

    Attributes:
        facts: constant properties of the machine.

    Raises:
        StoppedError: the machine is in emergency stop, off, or runs a program; the driver does not change that.
        LinkLostError: no controller answers, or it refuses the passwords.
    """

    def __init__(self, link: Link, passwords: tuple[str, str] = (CONNECT, ENABLE), seconds: float = 10.0) -> None:
        super().__init__(link, "LinuxCNC", "linuxcnc", f"{MODES} G40 G49")
        self._passwords, self._number = passwords, 0
        self._rsh = RshClient(link, self._latch, _POLLED, self._heard)
        self._open(time.monotonic() + seconds)

    def status(self) -> MachineStatus:
        """Return the most recent status."""
        place, words = self._place, ", ".join(f"{name} {self._rsh.value(name)}" for name in _POLLED[:3])
        if place is None:
            return MachineStatus(self._latch.state("idle"))
        state = "stopped" if self._unsafe() else _STATES.get(self._rsh.value("PROGRAM_STATUS"), "idle")
        tripped, age = self._rsh.value("PROBE_VALUE") != "0", self._rsh.age(_POLLED[-1])
        return MachineStatus(self._latch.state(state), place, tripped, age, words)

    def _halt(self) -> None:
        """Send ``SET ABORT``."""
        self._rsh.send("set abort")

    def _finish_stop(self) -> None:
        """Wait until an aborted motion has ended."""
        if not self._latch.stopped:
            return
        end = time.monotonic() + _SETTLES
        while self._latch.lost is None and time.monotonic() < end:
            before = self._rsh.age("PROGRAM_STATUS")
            self._rsh.send("get program_status")
            time.sleep(0.02)
            if self._rsh.age("PROGRAM_STATUS") < before and self._rsh.value("PROGRAM_STATUS") == "IDLE":
                return

    def _hang_up(self) -> None:
        self._rsh.close()

    @property
    def _place(self) -> Vectors | None:
        """Last reported position ``(3,)`` [m]; None before the first report, or if the report has no numbers."""
        try:
            return self._unit * numbers_of(self._rsh.value("ABS_ACT_POS").split(), "", "")[:3]
        except ValueError:
            return None

    def _heard(self, name: str, answer: str) -> None:
        """Take one answer in the reader thread; latch an emergency stop or a machine that is off.

        Raises:
            ValueError: the answer has another form; it has the expected and the received answer.
        """
        row = f"{name} {answer}"
        if name == "ABS_ACT_POS":
            numbers_of(answer.split(), "a position such as ABS_ACT_POS 0.000000 0.000000 0.000000", row)
        elif name in _VALUES and answer not in _VALUES[name]:
            raise ValueError(f"{name} with one of {', '.join(_VALUES[name])}", row)
        elif name.startswith("SET ") and answer not in ("ACK", "NAK"):
            raise ValueError(f"{name} ACK or {name} NAK", row)
        if why := _reason({name: answer}):
            self._latch.stop(why)

    def _unsafe(self) -> str:
        """Return why the machine must not move according to its status; empty if it may."""
        return _reason({name: self._rsh.value(name) for name in ("ESTOP", "MACHINE")})

    def _begin(self, deadline: float) -> None:
        """Take control; set millimetres, absolute coordinates and ``G54`` without tool length."""
        connect, enable = self._passwords
        version = self._rsh.request(f"hello {connect} tanteo 1.0", "HELLO", deadline)
        if not version.startswith("ACK"):
            raise LinkLostError(
                f"{self._link.name}: expected its connect password, got one that it refuses. Correct it."
            )
        self._rsh.send(f"set echo off\r\nset enable {enable}\r\nset verbose on")
        if self._rsh.request("get enable", "ENABLE", deadline) != "ON":
            raise LinkLostError(
                f"{self._link.name}: expected control of the machine, got none. Check the enable password."
            )
        unit = self._rsh.request("get user_linear_units", "USER_LINEAR_UNITS", deadline)
        if unit not in UNITS:
            raise StoppedError(
                f"{self._link.name}: expected a machine in mm, inch or cm, got {unit}. Set it in its INI."
            )
        self._unit = UNITS[unit]
        self._rsh.polling = True
        self._rsh.fresh(deadline)
        if why := self._unsafe():
            raise StoppedError(f"{self._link.name}: expected a machine that is on, got {why}. Clear it there.")
        if (state := self.status().state) != "idle":
            raise StoppedError(f"{self._link.name}: expected an idle machine, got one that is {state}. End it there.")
        while self._rsh.request("get error", "ERROR", deadline) != "OK":
            self._latch.late(deadline, "an end of old error messages")
        self._set("mode mdi", deadline)
        self._command(f"{self._modes} G80", deadline)
        self._read_frames((), deadline)
        self._verify(deadline)

    def _verify(self, deadline: float) -> None:
        """Compare the state, the modes and the offsets of the interpreter with what this driver has set."""
        self._latch.check()
        self._rsh.fresh(deadline)
        self._latch.check()
        for name, ready in (("PROGRAM_STATUS", "IDLE"), ("MODE", "MDI")):
            if (answer := self._rsh.value(name)) != ready:
                raise self._latch.changed(f"{name} {answer} in place of {ready}")
        values = self._parameters(*_EXPECTED_MODES, *_OFFSETS, deadline=deadline)
        for (name, good), value in zip(_EXPECTED_MODES.items(), values, strict=False):
            if value != good:
                raise self._latch.changed(f"#{name} = {value:g} in place of {good}")
        if what := offsets.changes(self._frame, self._frame_of(values[len(_EXPECTED_MODES) :])):
            raise self._latch.changed(what)
        self._rsh.fresh(deadline)

    def _frame_of(self, values: FloatArray) -> WorkFrame:
        """Return the work frame from the values of its parameters, which are in the machine's unit."""
        *lengths, turn, shifted = values
        metres = self._unit * np.array(lengths)
        return WorkFrame(metres[:3], SO3.axis_rotation(2, np.radians(turn)), metres[3:] * bool(shifted))

    def _read_frames(self, slots: Iterable[str], deadline: float) -> dict[str, Vectors]:
        """Read frames from the interpreter's parameters, in the machine's unit, with rotation and ``G92``."""
        self._wait_until_rest(deadline)
        self._frame = self._frame_of(self._parameters(*_OFFSETS, deadline=deadline))
        return {slot: self._slot(5201 + 20 * offsets.number_of(slot), deadline) for slot in slots}

    def _slot(self, first: int, deadline: float) -> Vectors:
        """Return the frame whose parameters begin at a number, in the form of :func:`offsets.check`."""
        has = self._parameters(*map(str, range(first, first + 3)), str(first + 9), deadline=deadline)
        return offsets.padded(1e3 * self._unit * has[:3], has[3])

    def _contact(self, rows: Sequence[str], deadline: float) -> tuple[bool, Vectors]:
        """Return contact and position from the interpreter's parameters, which are in the program's unit."""
        hit, *place = self._parameters("5070", "5061", "5062", "5063", deadline=deadline)
        if hit not in (0.0, 1.0):
            raise self._latch.bent(f"#5070 = {hit:g}", "#5070 = 0 or 1")
        return bool(hit), self._frame.machine(UNITS["MM"] * np.array(place)) if hit else place_of(self)

    def _parameters(self, *names: str, deadline: float) -> FloatArray:
        """Return parameters of the interpreter, after all earlier blocks have ended."""
        while True:
            self._number += 1
            mark = f"TANTEO{self._number}"
            self._command(f"(debug,{mark} " + " ".join(f"#{name}" for name in names) + ")", deadline)
            again = min(deadline, time.monotonic() + _AGAIN)
            while time.monotonic() < again:
                answer = self._rsh.request("get operator_display", "OPERATOR_DISPLAY", deadline)
                if answer.startswith(mark + " "):
                    return self._numbers(answer, len(names))
                time.sleep(0.005)
            self._latch.late(deadline, "the message of a (debug, ...) block: has another display taken it?")

    def _numbers(self, answer: str, count: int) -> FloatArray:
        """Return the values of parameters in a message."""
        try:
            return numbers_of(answer.split()[1:], f"{count} numbers of parameters", answer, count, count)
        except ValueError as error:
            raise self._latch.bent(answer, error.args[0]) from None

    def _command(self, line: str, deadline: float) -> Sequence[str]:
        """Send one block by MDI."""
        self._set(f"mdi {line}", deadline)
        return ()

    def _set(self, what: str, deadline: float) -> None:
        if not self._rsh.set(what, deadline):
            self._rsh.fresh(deadline)  # latches an emergency stop if that is the reason
            raise self._latch.failed(f"a refusal of '{what}'")

    def _at_rest(self, deadline: float) -> bool:
        self._rsh.fresh(deadline)
        return self._rsh.value("PROGRAM_STATUS") == "IDLE"

    def _wait_until_rest(self, deadline: float) -> None:
        """Wait until the machine is at rest, and check that no error was reported."""
        super()._wait_until_rest(deadline)
        if (error := self._rsh.request("get error", "ERROR", deadline)) != "OK":
            raise self._latch.failed(quoted(error))
        self._rsh.fresh(deadline)


def _reason(answers: Mapping[str, str]) -> str:
    """Return why the machine must not move according to some answers; empty if it may."""
    if answers.get("ESTOP", "OFF") != "OFF":
        return "an emergency stop"
    return "" if answers.get("MACHINE", "ON") == "ON" else "it is switched off"
