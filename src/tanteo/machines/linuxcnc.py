"""LinuxCNC under linuxcncrsh: ``G38.3`` by MDI, the place of a contact from the interpreter's own parameters.

No request gives parameters, but the message of ``(debug, #5061)`` comes back by ``GET OPERATOR_DISPLAY``. Messages go
to whoever asks first, so another display may take one: it is asked for again. ``G38`` and ``#5061`` to ``#5070`` are as
in ``docs/src/gcode`` of LinuxCNC/linuxcnc.
"""

from __future__ import annotations

import time

import numpy as np

from tanteo.lie import SO3
from tanteo.machines import offsets
from tanteo.machines.gcode import feed_word, place_words
from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.linuxcncrsh import RshClient
from tanteo.machines.protocol import (
    Facts,
    LinkLostError,
    MachineError,
    MachineState,
    MachineStatus,
    Sensed,
    StoppedError,
    place_of,
)
from tanteo.typing import FloatArray, Transforms, Vectors

PORT = 5007
CONNECT, ENABLE = "EMC", "EMCTOO"
"""The passwords that linuxcncrsh has if it is not told others."""
_BRAKE = 0.2
"""From an abort to letting go [s]."""
_AGAIN = 0.5
"""After which a message is asked for again [s]."""
_STILL = 1e-6
_ASKED = ("ESTOP", "MACHINE", "PROGRAM_STATUS", "PROBE_VALUE", "ABS_ACT_POS")
"""What its status is made of, the place last."""
_STATES: dict[str, MachineState] = {"RUNNING": "moving", "PAUSED": "held"}
_UNITS = {"MM": 1e-3, "INCH": 25.4e-3, "CM": 1e-2}
"""Of a machine: positions and offsets are in it, whatever the program is in; probed places are in the program's [m]."""


class LinuxCncMachine:
    """A machine of LinuxCNC with a touch probe on ``motion.probe-input``.

    Attributes:
        facts: what does not change.

    Raises:
        StoppedError: it is in emergency stop, off, or runs a program; that is changed there, not from here.
        LinkLostError: nobody answers, or not with these passwords.
    """

    def __init__(self, link: Link, passwords: tuple[str, str] = (CONNECT, ENABLE), seconds: float = 10.0) -> None:
        self._link = link
        self._number, self._unit = 0, 1e-3
        self._offset, self._shift, self._turn = np.zeros(3), np.zeros(3), np.eye(3)
        self._latch = Latch("LinuxCNC", "Clear it there", self.abort)
        self.facts = Facts("LinuxCNC", "linuxcnc")
        self._rsh = RshClient(link, self._latch, _ASKED, self._heard)
        try:
            self._begin(passwords, time.monotonic() + seconds)
        except MachineError:
            self.close()
            raise

    def status(self) -> MachineStatus:
        """What was heard last."""
        place, words = self._place, ", ".join(f"{name} {self._rsh.said(name)}" for name in _ASKED[:3])
        if place is None:
            return MachineStatus(self._latch.state("idle"))
        state = "stopped" if self._unsafe() else _STATES.get(self._rsh.said("PROGRAM_STATUS"), "idle")
        tripped, age = self._rsh.said("PROBE_VALUE") == "1", self._rsh.age(_ASKED[-1])
        return MachineStatus(self._latch.state(state), place, tripped, age, words)

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there, as a probe cycle that should meet nothing."""
        if self._probe(T_world_probe[:3, 3], speed, seconds) is not None:
            raise self._latch.met(place_of(self))

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there; nothing stops it but the controller."""
        deadline = time.monotonic() + seconds
        self._mdi(f"G1 {self._words(T_world_probe[:3, 3])} {feed_word(speed)}", deadline)
        self._settled(deadline)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """``G38.3`` along the direction."""
        begun, start = time.monotonic(), place_of(self)
        met = self._probe(start + reach * direction, speed, seconds)
        distance = np.inf if met is None else float((met - start) @ direction)
        return Sensed(start, direction, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """``SET ABORT``; from any thread, never waits, never raises."""
        self._latch.stop("it was told to stop")
        self._rsh.send("set abort")

    def write_frame(self, text: str, seconds: float) -> None:
        """Its lines one by one; what they set is read back.

        Raises:
            MachineError: the controller has another frame than it was told.
        """
        deadline = time.monotonic() + seconds
        for line in offsets.commands(text):
            self._mdi(line, deadline)
        self._settled(deadline)
        for slot, wanted in offsets.frames_in(text).items():
            first = 5201 + 20 * offsets.number_of(slot)
            has = self._parameters(*range(first, first + 3), first + 9, deadline=deadline)
            offsets.check(self.facts.name, slot, wanted, offsets.padded(1e3 * self._unit * has[:3], has[3]))
        self._read_offsets(deadline)

    def close(self) -> None:
        """Stop what moves, and let go; never raises."""
        if self.status().state == "moving":
            self.abort()
            time.sleep(_BRAKE)
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

    def _begin(self, passwords: tuple[str, str], deadline: float) -> None:
        """Control, millimetres, absolute, ``G54`` without tool length from here on."""
        connect, enable = passwords
        version = self._rsh.ask(f"hello {connect} tanteo 1.0", "HELLO", deadline)
        if not version.startswith("ACK"):
            raise LinkLostError(f"{self._link.name}: expected its connect password, got one that it refuses. Say it.")
        self._rsh.send(f"set echo off\r\nset enable {enable}\r\nset verbose on")
        if self._rsh.ask("get enable", "ENABLE", deadline) != "ON":
            raise LinkLostError(f"{self._link.name}: expected control of it, got none. Check its enable password.")
        unit = self._rsh.ask("get user_linear_units", "USER_LINEAR_UNITS", deadline)
        if unit not in _UNITS:
            raise StoppedError(
                f"{self._link.name}: expected a machine in mm, inch or cm, got {unit}. Set it in its INI."
            )
        self._unit = _UNITS[unit]
        self._rsh.fresh(deadline)
        self._rsh.polling = True
        if why := self._unsafe():
            raise StoppedError(f"{self._link.name}: expected a machine that is on, got {why}. Clear it there.")
        if (state := self.status().state) != "idle":
            raise StoppedError(f"{self._link.name}: expected an idle machine, got one that is {state}. End it there.")
        while self._rsh.ask("get error", "ERROR", deadline) != "OK":
            self._latch.late(deadline, "an end of old error messages")
        self._set("mode mdi", deadline)
        self._mdi("G21 G90 G94 G54 G40 G49 G80", deadline)
        self._settled(deadline)
        self._read_offsets(deadline)
        self._rsh.fresh(deadline)

    def _read_offsets(self, deadline: float) -> None:
        """Of ``G54``, its turn, and ``G92``: the interpreter keeps lengths in the machine's own unit."""
        *values, turn, shifted = self._parameters(5221, 5222, 5223, 5211, 5212, 5213, 5230, 5210, deadline=deadline)
        self._offset = self._unit * np.array(values[:3])
        self._shift = self._unit * np.array(values[3:]) * bool(shifted)
        self._turn = SO3.axis_rotation(2, np.radians(turn))

    def _words(self, place: Vectors) -> str:
        """A place of the machine in the coordinates of ``G54``: ``machine = turn (program + G92) + G54``."""
        return place_words(self._turn.T @ (place - self._offset) - self._shift)

    def _probe(self, goal: Vectors, speed: float, seconds: float) -> Vectors | None:
        """A probe cycle: where it met something ``(3,)`` [m]; None for nothing."""
        deadline = time.monotonic() + seconds
        self._latch.check()
        if np.linalg.norm(goal - place_of(self)) < _STILL:
            return None
        if self.status().tripped:
            raise self._latch.in_contact()
        self._mdi(f"G38.3 {self._words(goal)} {feed_word(speed)}", deadline)
        self._settled(deadline)
        met, *place = self._parameters(5070, 5061, 5062, 5063, deadline=deadline)
        return self._turn @ (1e-3 * np.array(place) + self._shift) + self._offset if met else None

    def _parameters(self, *names: int, deadline: float) -> FloatArray:
        """Parameters of the interpreter, once all before is done."""
        while True:
            self._number += 1
            mark = f"TANTEO{self._number}"
            self._mdi(f"(debug,{mark} " + " ".join(f"#{name}" for name in names) + ")", deadline)
            again = min(deadline, time.monotonic() + _AGAIN)
            while time.monotonic() < again:
                said = self._rsh.ask("get operator_display", "OPERATOR_DISPLAY", deadline)
                if said.startswith(mark + " "):
                    return _numbers(said[len(mark) :], len(names))
                time.sleep(0.005)
            self._latch.late(deadline, "the message that it was told to show: has another display taken it?")

    def _mdi(self, line: str, deadline: float) -> None:
        """One block; its error, if it has one, stops."""
        self._set(f"mdi {line}", deadline)

    def _set(self, what: str, deadline: float) -> None:
        if not self._rsh.set(what, deadline):
            self._rsh.fresh(deadline)  # an emergency stop, if that is why
            raise self._latch.failed(f"a refusal of '{what}'")

    def _settled(self, deadline: float) -> None:
        """Wait until it has done all, and see that it did it without an error."""
        while True:
            self._rsh.fresh(deadline)
            if self._rsh.said("PROGRAM_STATUS") == "IDLE":
                break
            self._latch.late(deadline, "it to come to rest")
            time.sleep(0.005)
        if (error := self._rsh.ask("get error", "ERROR", deadline)) != "OK":
            raise self._latch.failed(f"'{error}'")
        self._rsh.fresh(deadline)


def _numbers(text: str, count: int = 3) -> FloatArray:
    """The first numbers of an answer; ValueError if it has fewer."""
    values = [float(v) for v in text.split()[:count]]
    if len(values) < count:
        raise ValueError(text)
    return np.array(values)
