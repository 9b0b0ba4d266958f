"""Drive a simulated tip without a controller; tests compare the fake controllers with it."""

from __future__ import annotations

import time

import numpy as np

from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines.axis import Ended, Tip
from tanteo.machines.protocol import ContactError, Facts, MachineState, MachineStatus, Sensed, StoppedError
from tanteo.machines.world import World


class DirectMachine:
    """Machine that moves a simulated tip directly.

    Attributes:
        tip: simulated ball of the probe.
        facts: constant properties of the machine.
        frames: texts that :meth:`write_frame` received.
    """

    def __init__(self, world: World, start: Vectors, *, turns: bool = False, speedup: float = np.inf) -> None:
        self.tip = Tip(world, np.asarray(start, dtype=np.float64), speedup)
        self.facts = Facts("simulated tip", turns=turns)
        self.frames = list[str]()
        self._stopped = False

    def status(self) -> MachineStatus:
        """Return the current status."""
        state: MachineState = "stopped" if self._stopped else "moving" if self.tip.moving else "idle"
        return MachineStatus(state, self.tip.place, self.tip.tripped, 0.0, state)

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Move straight to a pose; see :class:`~tanteo.machines.protocol.Machine`.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s]; not used.

        Raises:
            ContactError: the tip touched the body.
        """
        goal = T_world_probe[:3, 3]
        if self._go(goal, speed, until_contact=True) == "contact":
            raise ContactError("simulated tip: expected a clear path, got a contact. Give the part more clearance.")

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Retract straight to a pose without watching for contacts.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s]; not used.
        """
        self._go(T_world_probe[:3, 3], speed, until_contact=False)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Move along a direction until contact; see :class:`~tanteo.machines.protocol.Machine`.

        Args:
            direction: unit direction ``(3,)``.
            reach: largest distance [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s]; not used.
        """
        start, begun = self.tip.place, time.monotonic()
        goal = start + reach * direction
        hit = self._go(goal, speed, until_contact=True) == "contact"
        noise = self.tip.world.noise(start, goal) if hit else 0.0
        distance = float((self.tip.place - start) @ direction) + noise if hit else np.inf
        return Sensed(start, direction, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """Stop permanently."""
        self._stopped = True
        self.tip.emergency.set()

    def write_frame(self, text: str, seconds: float) -> None:
        """Append the text to ``frames``.

        Args:
            text: lines that set a frame.
            seconds: largest duration [s]; not used.
        """
        self._check()
        self.frames.append(text)

    def close(self) -> None:
        """Stop permanently, and wait until the tip rests; there is nothing to disconnect."""
        self.abort()
        end = time.monotonic() + 1.0
        while self.tip.moving and time.monotonic() < end:
            time.sleep(0.002)

    def _check(self) -> None:
        if self._stopped:
            raise StoppedError("simulated tip: expected one that can move, got a stopped one. Create a new one.")

    def _go(self, goal: Vectors, speed: float, *, until_contact: bool) -> Ended:
        self._check()
        if until_contact and self.tip.tripped:
            raise ContactError("simulated tip: expected a free probe, got one in contact. Move it back first.")
        ended = self.tip.go(goal, speed, until_contact=until_contact)
        if ended == "stopped":
            self._check()
        return ended
