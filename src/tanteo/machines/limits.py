"""What a machine may do: where, how fast, how far, and how long it may be silent."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import Vectors
from tanteo.hand import Workspace


@dataclass(frozen=True, slots=True, eq=False)
class MachineLimits:
    """What a machine may do.

    Attributes:
        workspace: where the tip may be; ways do not cross its forbidden boxes.
        room: that the tip keeps from the workspace's bounds [m]: the radius of its ball, and more.
        travel: the largest speed between readings [m/s].
        touch: the largest speed of a guarded motion [m/s].
        reach: the longest guarded motion [m].
        arrival: how far from its goal a motion may end [m].
        stale: age of a status during a motion at which the machine is stopped [s].
        grace: seconds that a motion may take beyond its length and speed.

    Raises:
        InputError: a limit that is not positive.
    """

    workspace: Workspace = field(default_factory=Workspace.everywhere)
    room: float = 0.0
    travel: float = 0.05
    touch: float = 0.002
    reach: float = 0.1
    arrival: float = 2e-4
    stale: float = 1.5
    grace: float = 5.0

    def __post_init__(self) -> None:
        for name in ("travel", "touch", "reach", "arrival", "stale", "grace"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"limits, {name}: expected a positive number, got {getattr(self, name)}. Correct it.")
        if not self.room >= 0:
            raise InputError(f"limits, room: expected 0 or more, got {self.room}. Correct it.")

    def passed(self, here: Vectors, goal: Vectors) -> str:
        """What a straight way of the tip goes past, in words; empty if it keeps all limits."""
        rooms = self.workspace.rooms(goal)[0] - self.room
        crossed = [box.name for box in self.workspace.forbidden if box.crossed(here, goal, self.room)]
        if crossed:
            return f"the forbidden box '{crossed[0]}'"
        return self.workspace.limits[int(np.argmin(rooms))] if (rooms < 0).any() else ""
