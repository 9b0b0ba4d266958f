"""What all fakes of controllers have in common: a tip, faults, and what a motion comes to."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Literal

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.axis import Ended, Tip
from tanteo.machines.faults import Faults
from tanteo.machines.world import World

Outcome = Literal["there", "met", "tripped", "pushed", "unsaid"]
"""At its goal; at a contact; not begun, in contact; pushed without a contact; nothing is to be said of it."""


class Fake(ABC):
    """A controller that is not there.

    Attributes:
        tip: its ball.
        faults: what goes wrong.
        motions: how many it was told to make.
        ports: of loopback.
    """

    ports: tuple[int, ...]

    def __init__(self, world: World, start: Vectors, hurry: float, faults: Faults | None) -> None:
        self.tip = Tip(world, np.asarray(start, dtype=np.float64), hurry)
        self.faults, self.motions = faults or Faults(), 0
        self._silent = False

    @abstractmethod
    def close(self) -> None:
        """Switch it off."""

    @abstractmethod
    def press_stop(self) -> None:
        """The emergency stop."""

    @abstractmethod
    def _drop(self) -> None:
        """End the connection."""

    def _motion(self, goal: Vectors, speed: float, *, guarded: bool) -> tuple[Outcome, Vectors]:
        """A straight motion with the faults of its number: what came of it, and the place ``(3,)`` that is said."""
        self.motions += 1
        n, faults, start = self.motions, self.faults, self.tip.place
        if n == faults.drop_before:
            self._drop()
            return "unsaid", start
        self._silent = self._silent or n == faults.silent
        if guarded and self.tip.world.tripped(start):
            return "tripped", start
        if guarded and n == faults.stuck:
            self.tip.go(0.5 * (start + goal), speed, until_contact=False)
            return "pushed", self.tip.place
        half = self.press_stop if n == faults.stop_at else None
        ended = self.tip.go(goal, speed, until_contact=guarded, half_way=half)
        return self._reported(ended, start, goal)

    def _reported(self, ended: Ended, start: Vectors, goal: Vectors) -> tuple[Outcome, Vectors]:
        here = self.tip.place
        if ended in ("held", "stopped"):
            return "unsaid", here
        if self.motions == self.faults.late:
            time.sleep(self.faults.seconds)
        if self.motions == self.faults.drop_after:
            self._drop()
            return "unsaid", here
        if ended == "there":
            return "there", here
        return "met", here + self.tip.world.noise(start, goal) * (goal - start) / np.linalg.norm(goal - start)
