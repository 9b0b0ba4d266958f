"""The moving tip of a fake: straight motions in simulated time that can be watched, held and stopped."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.world import World

_TICK = 0.002
"""Of a motion that takes time [s]."""

Ended = Literal["there", "met", "held", "stopped"]
"""At its goal; at a contact; a feed hold; an emergency stop."""


@dataclass(eq=False)
class Tip:
    """Where the ball is, and what a motion does to it.

    Attributes:
        world: what it meets.
        place: of the ball's centre ``(3,)`` [m].
        hurry: how much faster than stated it moves; infinite: at once.
        travelled: every place at which a motion ended, in order.
    """

    world: World
    place: Vectors
    hurry: float = np.inf
    travelled: list[Vectors] = field(default_factory=list)
    moving: bool = False
    hold: threading.Event = field(default_factory=threading.Event)
    emergency: threading.Event = field(default_factory=threading.Event)

    def go(
        self, goal: Vectors, speed: float, *, until_contact: bool, half_way: Callable[[], None] | None = None
    ) -> Ended:
        """Move straight, to a contact at most if that is looked for; through it, where nobody looks."""
        start = self.place
        length = float(np.linalg.norm(goal - start))
        way = self.world.contact(start, goal) if until_contact else np.inf
        ends = min(way, length)
        self.moving = True
        try:
            ended = self._run(start, goal, length, ends, speed, half_way)
        finally:
            self.moving = False
            self.travelled.append(self.place)
        return ended if ended in ("held", "stopped") else ("met" if way <= length else "there")

    def _run(
        self, start: Vectors, goal: Vectors, length: float, ends: float, speed: float, half: Callable[[], None] | None
    ) -> Ended:
        gone, begun = 0.0, time.monotonic()
        while gone < ends:
            if self.emergency.is_set() or self.hold.is_set():
                return "stopped" if self.emergency.is_set() else "held"
            if np.isfinite(self.hurry):
                time.sleep(_TICK)
                gone = min(ends, (time.monotonic() - begun) * speed * self.hurry)
            else:
                gone = ends if gone or half is None else 0.5 * ends
            self.place = goal if gone >= length else start + (gone / length) * (goal - start)
            if half is not None and gone >= 0.5 * ends:
                half()
                half = None
        if half is not None:  # it only turns, or does not move at all
            half()
        return "stopped" if self.emergency.is_set() else "there"
