"""Simulate the moving tip of a fake controller: straight motions that can be held and stopped."""

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
"""Time between two updates of a position during a motion [s]."""

Ended = Literal["arrived", "contact", "held", "stopped"]
"""Reason for which a motion ended: at its goal; at a contact; cancelled; by an emergency stop."""


@dataclass(eq=False)
class Tip:
    """Simulated ball of a probe, which moves along straight lines.

    Attributes:
        world: body that the ball touches.
        place: position of the ball's centre ``(3,)`` [m].
        speedup: factor on the commanded speed; infinite for motions that take no time.
        travelled: positions at which the motions ended, in order.
        moving: whether a motion is under way.
        hold: event of a feed hold, which pauses the motion until it is cleared.
        pressed: event of a hand that triggers the probe.
        cancel: event that cancels the motion, also a paused one.
        emergency: event of an emergency stop, which ends the motion.
    """

    world: World
    place: Vectors
    speedup: float = np.inf
    travelled: list[Vectors] = field(default_factory=list)
    moving: bool = False
    hold: threading.Event = field(default_factory=threading.Event)
    cancel: threading.Event = field(default_factory=threading.Event)
    pressed: threading.Event = field(default_factory=threading.Event)
    emergency: threading.Event = field(default_factory=threading.Event)

    @property
    def tripped(self) -> bool:
        """Whether the probe is triggered, by the body or by a hand."""
        return self.pressed.is_set() or self.world.tripped(self.place)

    def go(
        self, goal: Vectors, speed: float, *, until_contact: bool, half_way: Callable[[], None] | None = None
    ) -> Ended:
        """Move along a straight line to a goal.

        Args:
            goal: position of the ball's centre at the end ``(3,)`` [m].
            speed: commanded speed [m/s].
            until_contact: whether the motion ends at a contact; otherwise the ball moves through the body.
            half_way: function to call in the middle of the motion; None for none.

        Returns:
            Reason for which the motion ended.
        """
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
        return ended if ended in ("held", "stopped") else ("contact" if way <= length else "arrived")

    def _run(
        self, start: Vectors, goal: Vectors, length: float, ends: float, speed: float, half: Callable[[], None] | None
    ) -> Ended:
        gone, before = 0.0, time.monotonic()
        while gone < ends:
            if self.emergency.is_set() or self.cancel.is_set():
                return "stopped" if self.emergency.is_set() else "held"
            if self.hold.is_set():
                time.sleep(_TICK)
                before = time.monotonic()
                continue
            if np.isfinite(self.speedup):
                time.sleep(_TICK)
                now = time.monotonic()
                gone, before = min(ends, gone + (now - before) * speed * self.speedup), now
            else:
                gone = ends if gone or half is None else 0.5 * ends
            self.place = goal if gone >= length else start + (gone / length) * (goal - start)
            if half is not None and gone >= 0.5 * ends:
                half()
                half = None
        if half is not None:  # the tip rotates in place or does not move
            half()
        return "stopped" if self.emergency.is_set() else "arrived"
