"""LinuxCNC under linuxcncrsh: ``G38.3`` by MDI, the place of a contact from the interpreter's own parameters.

No request gives parameters, but the message of ``(debug, #5061)`` comes back by ``GET OPERATOR_DISPLAY``. Messages go
to whoever asks first, so another display may take one: it is asked for again. ``G38`` and ``#5061`` to ``#5070`` are as
in ``docs/src/gcode`` of LinuxCNC/linuxcnc.
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
"""The passwords that linuxcncrsh has if it is not told others."""
_AGAIN = 0.5
"""After which a message is asked for again [s]."""
_ASKED = ("ESTOP", "MACHINE", "PROGRAM_STATUS", "PROBE_VALUE", "ABS_ACT_POS")
"""What its status is made of, the place last."""
_STATES: dict[str, MachineState] = {"RUNNING": "moving", "PAUSED": "held"}


class LinuxCncMachine(GcodeMachine):
    """A machine of LinuxCNC with a touch probe on ``motion.probe-input``.

    Positions and offsets are in the machine's own unit, whatever the program is in; probed places are in the program's.

    Attributes:
        facts: what does not change.

    Raises:
        StoppedError: it is in emergency stop, off, or runs a program; that is changed there, not from here.
        LinkLostError: nobody answers, or not with these passwords.
    """

    def __init__(self, link: Link, passwords: tuple[str, str] = (CONNECT, ENABLE), seconds: float = 10.0) -> None:
        super().__init__(link, "LinuxCNC", "linuxcnc")
        self._passwords, self._number = passwords, 0
        self._rsh = RshClient(link, self._latch, _ASKED, self._heard)
        self._open(time.monotonic() + seconds)

    def status(self) -> MachineStatus:
        """What was heard last."""
        place, words = self._place, ", ".join(f"{name} {self._rsh.said(name)}" for name in _ASKED[:3])
        if place is None:
            return MachineStatus(self._latch.state("idle"))
        state = "stopped" if self._unsafe() else _STATES.get(self._rsh.said("PROGRAM_STATUS"), "idle")
        tripped, age = self._rsh.said("PROBE_VALUE") == "1", self._rsh.age(_ASKED[-1])
        return MachineStatus(self._latch.state(state), place, tripped, age, words)

    def _halt(self) -> None:
        """``SET ABORT``."""
        self._rsh.send("set abort")

    def _hang_up(self) -> None:
        self._rsh.close()

    @property
    def _place(self) -> Vectors | None:
        """Where it said it is ``(3,)`` [m]; None before it has, or if it said no numbers."""
        try:
            return self._unit * _numbers(self._rsh.said("ABS_ACT_POS"))
        except ValueError:
            return None

    def _heard(self, name: str) -> None:
        """Of each answer, by the thread that reads."""
        if name in ("ESTOP", "MACHINE") and (why := self._unsafe()):
            self._latch.stop(why)

    def _unsafe(self) -> str:
        """Why it may not move by its own word; empty if it may."""
        if self._rsh.said("ESTOP", "OFF") != "OFF":
            return "an emergency stop"
        return "" if self._rsh.said("MACHINE", "ON") == "ON" else "it is switched off"

    def _begin(self, deadline: float) -> None:
        """Control, millimetres, absolute, ``G54`` without tool length from here on."""
        connect, enable = self._passwords
        version = self._rsh.ask(f"hello {connect} tanteo 1.0", "HELLO", deadline)
        if not version.startswith("ACK"):
            raise LinkLostError(f"{self._link.name}: expected its connect password, got one that it refuses. Say it.")
        self._rsh.send(f"set echo off\r\nset enable {enable}\r\nset verbose on")
        if self._rsh.ask("get enable", "ENABLE", deadline) != "ON":
            raise LinkLostError(f"{self._link.name}: expected control of it, got none. Check its enable password.")
        unit = self._rsh.ask("get user_linear_units", "USER_LINEAR_UNITS", deadline)
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
        while self._rsh.ask("get error", "ERROR", deadline) != "OK":
            self._latch.late(deadline, "an end of old error messages")
        self._set("mode mdi", deadline)
        self._command("G21 G90 G94 G54 G40 G49 G80", deadline)
        self._read_frames((), deadline)
        self._rsh.fresh(deadline)

    def _read_frames(self, slots: Iterable[str], deadline: float) -> dict[str, Vectors]:
        """By the interpreter's parameters, which are in the machine's own unit; ``G54`` has a turn, and ``G92``."""
        self._settled(deadline)
        *values, turn, shifted = self._parameters(5221, 5222, 5223, 5211, 5212, 5213, 5230, 5210, deadline=deadline)
        lengths = self._unit * np.array(values)
        rotation = SO3.axis_rotation(2, np.radians(turn))
        self._frame = WorkFrame(lengths[:3], rotation, lengths[3:] * bool(shifted))
        return {slot: self._slot(5201 + 20 * offsets.number_of(slot), deadline) for slot in slots}

    def _slot(self, first: int, deadline: float) -> Vectors:
        """The frame whose parameters begin there, as :func:`offsets.check` takes it."""
        has = self._parameters(*range(first, first + 3), first + 9, deadline=deadline)
        return offsets.padded(1e3 * self._unit * has[:3], has[3])

    def _contact(self, said: Sequence[str], deadline: float) -> Vectors | None:
        """By the interpreter's parameters, in the program's unit."""
        met, *place = self._parameters(5070, 5061, 5062, 5063, deadline=deadline)
        return self._frame.machine(UNITS["MM"] * np.array(place)) if met else None

    def _parameters(self, *names: int, deadline: float) -> FloatArray:
        """Parameters of the interpreter, once all before is done."""
        while True:
            self._number += 1
            mark = f"TANTEO{self._number}"
            self._command(f"(debug,{mark} " + " ".join(f"#{name}" for name in names) + ")", deadline)
            again = min(deadline, time.monotonic() + _AGAIN)
            while time.monotonic() < again:
                said = self._rsh.ask("get operator_display", "OPERATOR_DISPLAY", deadline)
                if said.startswith(mark + " "):
                    return _numbers(said[len(mark) :], len(names))
                time.sleep(0.005)
            self._latch.late(deadline, "the message that it was told to show: has another display taken it?")

    def _command(self, line: str, deadline: float) -> Sequence[str]:
        """One block by MDI."""
        self._set(f"mdi {line}", deadline)
        return ()

    def _set(self, what: str, deadline: float) -> None:
        if not self._rsh.set(what, deadline):
            self._rsh.fresh(deadline)  # an emergency stop, if that is why
            raise self._latch.failed(f"a refusal of '{what}'")

    def _at_rest(self, deadline: float) -> bool:
        self._rsh.fresh(deadline)
        return self._rsh.said("PROGRAM_STATUS") == "IDLE"

    def _settled(self, deadline: float) -> None:
        """And see that it did all without an error."""
        super()._settled(deadline)
        if (error := self._rsh.ask("get error", "ERROR", deadline)) != "OK":
            raise self._latch.failed(f"'{error}'")
        self._rsh.fresh(deadline)


def _numbers(text: str, count: int = 3) -> FloatArray:
    """The first numbers of an answer; ValueError if it has fewer."""
    values = [float(v) for v in text.split()[:count]]
    if len(values) < count:
        raise ValueError(text)
    return np.array(values)
