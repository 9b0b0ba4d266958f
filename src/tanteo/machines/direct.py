"""A machine without a controller: its motions are those of the simulated tip. What the fakes are compared with."""

from __future__ import annotations

import time

import numpy as np

from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines.axis import Ended, Tip
from tanteo.machines.protocol import ContactError, Facts, MachineState, MachineStatus, Sensed, StoppedError
from tanteo.machines.world import World


class DirectMachine:
    """The simulated tip as a machine.

    Attributes:
        tip: its ball.
        facts: what does not change.
    """

    def __init__(self, world: World, start: Vectors, *, turns: bool = False, hurry: float = np.inf) -> None:
        self.tip = Tip(world, np.asarray(start, dtype=np.float64), hurry)
        self.facts = Facts("simulated tip", turns=turns)
        self.frames = list[str]()
        self._stopped = False

    def status(self) -> MachineStatus:
        """Of now."""
        state: MachineState = "stopped" if self._stopped else "moving" if self.tip.moving else "idle"
        return MachineStatus(state, self.tip.place, self.tip.world.tripped(self.tip.place), 0.0, state)

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there."""
        goal = T_world_probe[:3, 3]
        if self._go(goal, speed, until_contact=True) == "met":
            raise ContactError("simulated tip: expected a free way, met something. Give the part more clearance.")

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there, out of contact."""
        self._go(T_world_probe[:3, 3], speed, until_contact=False)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Until contact."""
        start, begun = self.tip.place, time.monotonic()
        goal = start + reach * direction
        met = self._go(goal, speed, until_contact=True) == "met"
        noise = self.tip.world.noise(start, goal) if met else 0.0
        distance = float((self.tip.place - start) @ direction) + noise if met else np.inf
        return Sensed(start, direction, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """For good."""
        self._stopped = True
        self.tip.emergency.set()

    def write_frame(self, text: str, seconds: float) -> None:
        """Kept in ``frames``."""
        self._check()
        self.frames.append(text)

    def close(self) -> None:
        """Nothing is held."""
        self.abort()

    def _check(self) -> None:
        if self._stopped:
            raise StoppedError("simulated tip: expected one that may move, got one that has stopped. Make another.")

    def _go(self, goal: Vectors, speed: float, *, until_contact: bool) -> Ended:
        self._check()
        if until_contact and self.tip.world.tripped(self.tip.place):
            raise ContactError("simulated tip: expected a free probe, got one in contact. Move it back first.")
        ended = self.tip.go(goal, speed, until_contact=until_contact)
        if ended == "stopped":
            self._check()
        return ended
