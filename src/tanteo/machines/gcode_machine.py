"""Define the common part of all drivers of G-code controllers: probe cycles, retraction, and frames with read-back.

A derived class implements the protocol: how a line reaches the interpreter, and how the controller reports its result.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines import offsets
from tanteo.machines.gcode import MODES, feed_word, place_words
from tanteo.machines.latch import Latch
from tanteo.machines.limits import MachineLimits
from tanteo.machines.link import Link
from tanteo.machines.offsets import WorkFrame
from tanteo.machines.protocol import Facts, MachineStatus, Sensed, in_mm, place_of

UNITS = {"MM": 1e-3, "INCH": 25.4e-3, "CM": 1e-2}
"""Metres per unit of the positions that controllers report [m]."""
_STILL = 1e-6
"""Length below which a motion is not sent [m]; GRBL reports it as an error."""


class GcodeMachine(ABC):
    """Driver of a controller with a touch probe that supports ``G38.3`` and ``G1``.

    Every line with a motion sets all modes that it needs. Before it is sent, the controller reports its state, its
    modes and its offsets, which must be those that this driver has set. Otherwise the driver sends nothing more.

    Attributes:
        facts: constant properties of the machine.
    """

    def __init__(self, link: Link, name: str, controller: str, modes: str = MODES) -> None:
        self._link, self._unit = link, UNITS["MM"]
        self._frame, self._modes = WorkFrame(), modes
        self._latch, self._moving = Latch(name, "Clear it there", self.abort), False
        self._rest: Vectors | None = None
        self.facts = Facts(name, controller)

    @abstractmethod
    def status(self) -> MachineStatus:
        """Return the most recent status."""

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Move straight to a pose, as a probe cycle that should not end at a contact.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].

        Raises:
            ContactError: the probe touched something, or was in contact at the start.
            StoppedError: the machine has stopped.
        """
        if self._probe(T_world_probe[:3, 3], speed, seconds)[0]:
            raise self._latch.contact_error(place_of(self))

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Retract straight to a pose; only the controller can stop this motion.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        deadline = time.monotonic() + seconds
        self._ready_to_move(deadline)
        # G53: machine coordinates, which no offset moves
        self._go(f"{self._modes} G53 G1 {place_words(T_world_probe[:3, 3])} {feed_word(speed)}", deadline)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Move along a direction until contact, by ``G38.3``.

        Args:
            direction: unit direction ``(3,)``.
            reach: largest distance [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        begun, start = time.monotonic(), place_of(self)
        hit, reported = self._probe(start + reach * direction, speed, seconds)
        distance = float((reported - start) @ direction) if hit else np.inf
        return Sensed(start, direction, distance, reach, time.monotonic() - begun, reported)

    def abort(self) -> None:
        """Stop permanently; callable from any thread, never waits, never raises."""
        self._latch.stop("a stop was commanded")
        self._halt()

    def write_frame(self, text: str, seconds: float) -> None:
        """Send the lines that set a frame, and read the frame back.

        Args:
            text: lines of G-code that set a frame.
            seconds: largest duration [s].

        Raises:
            MachineError: the controller reports another frame than was set.
        """
        deadline, wanted = time.monotonic() + seconds, offsets.frames_in(text)
        for line in offsets.commands(text):
            self._command(line, deadline)
        there = self._read_frames(wanted, deadline)
        for slot, values in wanted.items():
            offsets.check(self.facts.name, slot, values, there[slot])

    def close(self) -> None:
        """Stop a running motion, wait until its stop is complete, and disconnect; never raises."""
        if self._moving or self.status().state == "moving":
            self.abort()
        self._finish_stop()
        self._hang_up()
        self._link.close()

    def _open(self, deadline: float) -> None:
        """Set the controller up, or disconnect if that fails."""
        try:
            self._begin(deadline)
        except BaseException:
            self.close()
            raise

    def _probe(self, goal: Vectors, speed: float, seconds: float) -> tuple[bool, Vectors]:
        """Run a probe cycle; return whether there was a contact, and where the cycle ended ``(3,)`` [m]."""
        deadline = time.monotonic() + seconds
        self._ready_to_move(deadline)
        if np.linalg.norm(goal - place_of(self)) < _STILL:
            return False, goal
        if self.status().tripped is not False:
            raise self._latch.in_contact()
        rows = self._go(f"{self._modes} G38.3 {place_words(self._frame.program(goal))} {feed_word(speed)}", deadline)
        return self._contact(rows, deadline)

    def _go(self, line: str, deadline: float) -> Sequence[str]:
        """Send one line with a motion, and wait until it has ended; return the rows before its acknowledgement."""
        self._moving, self._rest = True, None
        rows = self._command(line, deadline)
        self._wait_until_rest(deadline)
        self._moving, self._rest = False, place_of(self)
        return rows

    def _ready_to_move(self, deadline: float) -> None:
        """Check the controller, and that the tip is where the last motion ended."""
        self._verify(deadline)
        here = place_of(self)
        if self._rest is not None and not np.linalg.norm(here - self._rest) <= MachineLimits().arrival:
            raise self._latch.changed(f"the position {in_mm(here)} in place of {in_mm(self._rest)}")

    def _wait_until_rest(self, deadline: float) -> None:
        """Wait until the controller reports that it is at rest."""
        while not self._at_rest(deadline):
            self._latch.late(deadline, "the end of its motion")
            time.sleep(0.005)

    @abstractmethod
    def _begin(self, deadline: float) -> None:
        """Check that the controller is ready; set millimetres, absolute coordinates and ``G54``, and read its frame."""

    @abstractmethod
    def _verify(self, deadline: float) -> None:
        """Check that the controller is ready, and that its modes and offsets are those that this driver has set.

        Raises:
            StoppedError: the state is another one; no motion was sent.
        """

    @abstractmethod
    def _command(self, line: str, deadline: float) -> Sequence[str]:
        """Send one line to the interpreter; return the rows that arrive before the acknowledgement."""

    @abstractmethod
    def _at_rest(self, deadline: float) -> bool:
        """Return whether all motions have ended, from a status requested now."""

    @abstractmethod
    def _contact(self, rows: Sequence[str], deadline: float) -> tuple[bool, Vectors]:
        """Return whether a probe cycle made contact, and where it ended ``(3,)``, machine coordinates [m]."""

    @abstractmethod
    def _read_frames(self, slots: Iterable[str], deadline: float) -> Mapping[str, Vectors]:
        """Return x, y, z [mm] and rotation [deg] ``(4,)`` of each slot, NaN if unknown; keep the frame of ``G54``."""

    @abstractmethod
    def _halt(self) -> None:
        """Command a stop; never waits, never raises."""

    @abstractmethod
    def _finish_stop(self) -> None:
        """Wait, for a bounded time, until a stop that was commanded is complete; never raises."""

    @abstractmethod
    def _hang_up(self) -> None:
        """Prepare for the end of the connection; never raises."""
