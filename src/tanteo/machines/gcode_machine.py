"""What all controllers of G-code have in common: probe cycles for motions, the way back, frames that are read back.

Of a controller only its protocol is left: how a line reaches its interpreter, and how it says what came of it.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines import offsets
from tanteo.machines.gcode import feed_word, place_words
from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.offsets import WorkFrame
from tanteo.machines.protocol import Facts, MachineError, MachineStatus, Sensed, place_of

UNITS = {"MM": 1e-3, "INCH": 25.4e-3, "CM": 1e-2}
"""Of what controllers say of places [m]."""
_BRAKE = 0.4
"""From a stop to letting go [s]."""
_STILL = 1e-6
"""A motion shorter than this is none [m]: GRBL calls it an error."""


class GcodeMachine(ABC):
    """A controller with a touch probe that takes ``G38.3`` and ``G1``.

    Attributes:
        facts: what does not change.
    """

    def __init__(self, link: Link, name: str, controller: str) -> None:
        self._link, self._unit = link, UNITS["MM"]
        self._frame = WorkFrame()
        self._latch = Latch(name, "Clear it there", self.abort)
        self.facts = Facts(name, controller)

    @abstractmethod
    def status(self) -> MachineStatus:
        """What was heard last."""

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there, as a probe cycle that should meet nothing."""
        if self._probe(T_world_probe[:3, 3], speed, seconds) is not None:
            raise self._latch.met(place_of(self))

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there; nothing stops it but the controller."""
        deadline = time.monotonic() + seconds
        self._command(f"G1 {self._way(T_world_probe[:3, 3], speed)}", deadline)
        self._settled(deadline)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """``G38.3`` along the direction."""
        begun, start = time.monotonic(), place_of(self)
        met = self._probe(start + reach * direction, speed, seconds)
        distance = np.inf if met is None else float((met - start) @ direction)
        return Sensed(start, direction, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """For good; from any thread, never waits, never raises."""
        self._latch.stop("it was told to stop")
        self._halt()

    def write_frame(self, text: str, seconds: float) -> None:
        """Its lines one by one; what they set is read back.

        Raises:
            MachineError: the controller has another frame than it was told.
        """
        deadline, told = time.monotonic() + seconds, offsets.frames_in(text)
        for line in offsets.commands(text):
            self._command(line, deadline)
        there = self._read_frames(told, deadline)
        for slot, wanted in told.items():
            offsets.check(self.facts.name, slot, wanted, there[slot])

    def close(self) -> None:
        """Stop what moves, and let go; never raises."""
        if self.status().state == "moving":
            self.abort()
            time.sleep(_BRAKE)
        self._hang_up()
        self._link.close()

    def _open(self, deadline: float) -> None:
        """Begin, or let go of it."""
        try:
            self._begin(deadline)
        except MachineError:
            self.close()
            raise

    def _probe(self, goal: Vectors, speed: float, seconds: float) -> Vectors | None:
        """A probe cycle: where it met something ``(3,)`` [m]; None for nothing."""
        deadline = time.monotonic() + seconds
        self._latch.check()
        if np.linalg.norm(goal - place_of(self)) < _STILL:
            return None
        if self.status().tripped:
            raise self._latch.in_contact()
        said = self._command(f"G38.3 {self._way(goal, speed)}", deadline)
        self._settled(deadline)
        return self._contact(said, deadline)

    def _way(self, goal: Vectors, speed: float) -> str:
        return f"{place_words(self._frame.program(goal))} {feed_word(speed)}"

    def _settled(self, deadline: float) -> None:
        """Wait until it says that it is at rest."""
        while not self._at_rest(deadline):
            self._latch.late(deadline, "it to come to rest")
            time.sleep(0.005)

    @abstractmethod
    def _begin(self, deadline: float) -> None:
        """See that it is ready; millimetres, absolute, ``G54`` from here on, whose frame is known."""

    @abstractmethod
    def _command(self, line: str, deadline: float) -> Sequence[str]:
        """One line to the interpreter, and what is said before it is acknowledged."""

    @abstractmethod
    def _at_rest(self, deadline: float) -> bool:
        """Whether all is done, asked from now on."""

    @abstractmethod
    def _contact(self, said: Sequence[str], deadline: float) -> Vectors | None:
        """Where the probe cycle that said this met something ``(3,)``, in machine coordinates [m]; None for nothing."""

    @abstractmethod
    def _read_frames(self, slots: Iterable[str], deadline: float) -> Mapping[str, Vectors]:
        """Of each slot x, y, z [mm] and the turn [deg] ``(4,)``, not a number where unknown; ``G54`` acts from here."""

    @abstractmethod
    def _halt(self) -> None:
        """Tell it to stop; never waits, never raises."""

    @abstractmethod
    def _hang_up(self) -> None:
        """Before the connection is closed; never raises."""
