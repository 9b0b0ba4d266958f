"""Define the limits of a machine: workspace, speeds, distances and times."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import Vectors
from tanteo.hand import Workspace


@dataclass(frozen=True, slots=True, eq=False)
class MachineLimits:
    """Limits that :class:`~tanteo.machines.SafeMachine` enforces.

    Attributes:
        workspace: permitted positions of the tip; paths do not cross its forbidden boxes.
        clearance: smallest distance of the tip from the bounds of the workspace [m], at least the radius of its ball.
        travel: speed of motions between readings [m/s].
        touch: speed of a guarded motion [m/s].
        reach: largest length of a guarded motion [m].
        arrival: largest distance from its goal at which a motion may end [m].
        stale: age of the status during a motion at which the machine is stopped [s].
        grace: time that a motion may take beyond 1.5 times its length divided by its speed [s].

    Raises:
        InputError: a limit is not positive.
    """

    workspace: Workspace = field(default_factory=Workspace.everywhere)
    clearance: float = 0.0
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
        if not self.clearance >= 0:
            raise InputError(f"limits, clearance: expected 0 or more, got {self.clearance}. Correct it.")

    def violation(self, here: Vectors, goal: Vectors) -> str:
        """Return the first limit that a straight path of the tip violates, for messages; empty if there is none.

        Args:
            here: start of the path ``(3,)`` [m].
            goal: end of the path ``(3,)`` [m].
        """
        if not np.isfinite([*here, *goal]).all():
            return "a finite position"
        margins = self.workspace.clearances(goal)[0] - self.clearance
        crossed = [box.name for box in self.workspace.forbidden if box.crossed(here, goal, self.clearance)]
        if crossed:
            return f"the forbidden box '{crossed[0]}'"
        return self.workspace.limits[int(np.argmin(margins))] if not (margins >= 0).all() else ""
