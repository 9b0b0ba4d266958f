"""Drive LinuxCNC under linuxcncrsh: ``G38.3`` by MDI, contact positions from the interpreter's parameters.

No request returns parameters, but ``GET OPERATOR_DISPLAY`` returns the message of ``(debug, #5061)``. The first display
that requests a message takes it. If another display has taken it, the driver sends the block again. ``G38`` and the
parameters ``#5061`` to ``#5070`` are defined in ``docs/src/gcode`` of LinuxCNC/linuxcnc.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.machines import offsets
from tanteo.machines.gcode_machine import UNITS, GcodeMachine
from tanteo.machines.link import Link
from tanteo.machines.linuxcncrsh import RshClient
from tanteo.machines.offsets import WorkFrame
from tanteo.machines.protocol import LinkLostError, MachineState, MachineStatus, StoppedError

CONNECT, ENABLE = "EMC", "EMCTOO"
"""Default passwords of linuxcncrsh."""
_AGAIN = 0.5
"""Time after which the driver requests a message again [s]."""
_POLLED = ("ESTOP", "MACHINE", "PROGRAM_STATUS", "PROBE_VALUE", "ABS_ACT_POS")
"""Names of the values that form a status, the position last."""
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
        super().__init__(link, "LinuxCNC", "linuxcnc")
        self._passwords, self._number = passwords, 0
        self._rsh = RshClient(link, self._latch, _POLLED, self._heard)
        self._open(time.monotonic() + seconds)

    def status(self) -> MachineStatus:
        """Return the most recent status."""
        place, words = self._place, ", ".join(f"{name} {self._rsh.value(name)}" for name in _POLLED[:3])
        if place is None:
            return MachineStatus(self._latch.state("idle"))
        state = "stopped" if self._unsafe() else _STATES.get(self._rsh.value("PROGRAM_STATUS"), "idle")
        tripped, age = self._rsh.value("PROBE_VALUE") == "1", self._rsh.age(_POLLED[-1])
        return MachineStatus(self._latch.state(state), place, tripped, age, words)

    def _halt(self) -> None:
        """Send ``SET ABORT``."""
        self._rsh.send("set abort")

    def _hang_up(self) -> None:
        self._rsh.close()

    @property
    def _place(self) -> Vectors | None:
        """Last reported position ``(3,)`` [m]; None before the first report, or if the report has no numbers."""
        try:
            return self._unit * _numbers(self._rsh.value("ABS_ACT_POS"))
        except ValueError:
            return None

    def _heard(self, name: str) -> None:
        """Latch an emergency stop or a machine that is off; the reader thread calls this for each answer."""
        if name in ("ESTOP", "MACHINE") and (why := self._unsafe()):
            self._latch.stop(why)

    def _unsafe(self) -> str:
        """Return why the machine must not move according to its status; empty if it may."""
        if self._rsh.value("ESTOP", "OFF") != "OFF":
            return "an emergency stop"
        return "" if self._rsh.value("MACHINE", "ON") == "ON" else "it is switched off"

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
        self._rsh.fresh(deadline)
        self._rsh.polling = True
        if why := self._unsafe():
            raise StoppedError(f"{self._link.name}: expected a machine that is on, got {why}. Clear it there.")
        if (state := self.status().state) != "idle":
            raise StoppedError(f"{self._link.name}: expected an idle machine, got one that is {state}. End it there.")
        while self._rsh.request("get error", "ERROR", deadline) != "OK":
            self._latch.late(deadline, "an end of old error messages")
        self._set("mode mdi", deadline)
        self._command("G21 G90 G94 G54 G40 G49 G80", deadline)
        self._read_frames((), deadline)
        self._rsh.fresh(deadline)

    def _read_frames(self, slots: Iterable[str], deadline: float) -> dict[str, Vectors]:
        """Read frames from the interpreter's parameters, in the machine's unit, with rotation and ``G92``."""
        self._wait_until_rest(deadline)
        *values, turn, shifted = self._parameters(5221, 5222, 5223, 5211, 5212, 5213, 5230, 5210, deadline=deadline)
        lengths = self._unit * np.array(values)
        rotation = SO3.axis_rotation(2, np.radians(turn))
        self._frame = WorkFrame(lengths[:3], rotation, lengths[3:] * bool(shifted))
        return {slot: self._slot(5201 + 20 * offsets.number_of(slot), deadline) for slot in slots}

    def _slot(self, first: int, deadline: float) -> Vectors:
        """Return the frame whose parameters begin at a number, in the form of :func:`offsets.check`."""
        has = self._parameters(*range(first, first + 3), first + 9, deadline=deadline)
        return offsets.padded(1e3 * self._unit * has[:3], has[3])

    def _contact(self, rows: Sequence[str], deadline: float) -> Vectors | None:
        """Return the contact from the interpreter's parameters, which are in the program's unit."""
        hit, *place = self._parameters(5070, 5061, 5062, 5063, deadline=deadline)
        return self._frame.machine(UNITS["MM"] * np.array(place)) if hit else None

    def _parameters(self, *names: int, deadline: float) -> FloatArray:
        """Return parameters of the interpreter, after all earlier blocks have ended."""
        while True:
            self._number += 1
            mark = f"TANTEO{self._number}"
            self._command(f"(debug,{mark} " + " ".join(f"#{name}" for name in names) + ")", deadline)
            again = min(deadline, time.monotonic() + _AGAIN)
            while time.monotonic() < again:
                answer = self._rsh.request("get operator_display", "OPERATOR_DISPLAY", deadline)
                if answer.startswith(mark + " "):
                    return _numbers(answer[len(mark) :], len(names))
                time.sleep(0.005)
            self._latch.late(deadline, "the message of a (debug, ...) block: has another display taken it?")

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
            raise self._latch.failed(f"'{error}'")
        self._rsh.fresh(deadline)


def _numbers(text: str, count: int = 3) -> FloatArray:
    """Return the first numbers of an answer; raise ValueError if there are fewer."""
    values = [float(v) for v in text.split()[:count]]
    if len(values) < count:
        raise ValueError(text)
    return np.array(values)
