"""Define the common part of all fake controllers: a simulated tip, faults, and the outcome of a motion."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Literal

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.axis import Ended, Tip
from tanteo.machines.faults import Faults
from tanteo.machines.world import World

Outcome = Literal["arrived", "contact", "tripped", "pushed", "unreported"]
"""Outcome of a motion: at its goal; at a contact; refused because the probe was in contact; stopped by a force without
a contact; not to be reported by the controller."""


class Fake(ABC):
    """Fake controller, which speaks the protocol of a real one on loopback.

    Attributes:
        tip: simulated ball of the probe.
        faults: simulated faults.
        motions: number of motions that were commanded.
        ports: TCP ports on loopback.
    """

    ports: tuple[int, ...]

    def __init__(self, world: World, start: Vectors, speedup: float, faults: Faults | None) -> None:
        self.tip = Tip(world, np.asarray(start, dtype=np.float64), speedup)
        self.faults, self.motions = faults or Faults(), 0
        self._silent = False

    @abstractmethod
    def close(self) -> None:
        """Switch the controller off."""

    @abstractmethod
    def press_stop(self) -> None:
        """Press the emergency stop."""

    @abstractmethod
    def _drop(self) -> None:
        """End the connection."""

    def _motion(self, goal: Vectors, speed: float, *, guarded: bool) -> tuple[Outcome, Vectors]:
        """Make a straight motion with the faults of its number.

        Returns:
            Outcome of the motion, and the position that the controller reports ``(3,)`` [m].
        """
        self.motions += 1
        n, faults, start = self.motions, self.faults, self.tip.place
        if n == faults.drop_before:
            self._drop()
            return "unreported", start
        self._silent = self._silent or n == faults.silent
        stops = guarded and not 0 < faults.never <= n
        if guarded and self.tip.tripped:
            return "tripped", start
        if guarded and n == faults.stuck:
            self.tip.go(0.5 * (start + goal), speed, until_contact=False)
            return "pushed", self.tip.place
        half = self.press_stop if n == faults.stop_at else None
        ended = self.tip.go(goal, speed, until_contact=stops, half_way=half)
        return self._reported(ended, start, goal)

    def _reported(self, ended: Ended, start: Vectors, goal: Vectors) -> tuple[Outcome, Vectors]:
        here, faults = self.tip.place, self.faults
        if ended in ("held", "stopped"):
            return "unreported", here
        if self.motions == faults.late:
            time.sleep(faults.seconds)
        if self.motions == faults.drop_after:
            self._drop()
            return "unreported", here
        if ended == "arrived" or self.motions == faults.missed:
            return "arrived", here
        along = (goal - start) / np.linalg.norm(goal - start)
        beside = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        shift = faults.shift * ((self.motions == faults.beside) * beside - (self.motions == faults.along) * along)
        return "contact", here + self.tip.world.noise(start, goal) * along + shift
