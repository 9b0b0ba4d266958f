"""Define the limits of a machine: workspace, speeds, distances and times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Rotations, Vectors
from tanteo.hand import Body, Workspace

DOWN = np.diag([1.0, -1.0, -1.0])
"""Axes of a tool that points down ``(3, 3)``."""
_STEP = 1e-3
"""Largest way of a sphere between two poses at which the body is compared with the limits [m]."""


def tool_body(stylus: float, ball: float, radius: float, length: float) -> Body:
    """Return the body of a tool: a stylus, and a cylinder with rounded ends behind it.

    Args:
        stylus: length of the stylus from the ball's centre to the tool [m].
        ball: radius of ball and stylus [m]; 0 for a sharp tip, whose stylus is not part of the body.
        radius: radius of the tool [m].
        length: length of the tool behind the stylus [m].

    Raises:
        InputError: a length is not positive.

    Example:
        >>> from tanteo.machines import tool_body
        >>> tool_body(0.05, 1e-3, 0.03, 0.1).centres[-1].tolist()
        [0.0, 0.0, -0.12]
    """
    values = {"stylus": stylus, "radius": radius, "length": length}
    for name, value in values.items():
        if not 0 < value < np.inf:
            raise InputError(f"tool, {name}: expected a positive length, got {value}. Correct it.")
    first = stylus + radius
    chains = [(first, max(first, stylus + length - radius), radius)]
    if ball > 0:
        chains.insert(0, (0.0, stylus, ball))
    centres, radii = list[FloatArray](), list[FloatArray]()
    for start, end, r in chains:
        depths = np.linspace(start, end, 1 + int(np.ceil(2 * (end - start) / r)))
        gap = float(depths[1] - depths[0]) if len(depths) > 1 else 0.0
        centres.append(depths[:, None] * np.array([0.0, 0.0, -1.0]))
        radii.append(np.full(len(depths), np.hypot(r, 0.5 * gap)))  # neighbouring spheres enclose the cylinder
    return Body(np.concatenate(centres), np.concatenate(radii))


@dataclass(frozen=True, slots=True, eq=False)
class MachineLimits:
    """Limits that :class:`~tanteo.machines.SafeMachine` enforces.

    Attributes:
        workspace: permitted positions of tip and tool; paths do not cross its forbidden boxes.
        clearance: smallest distance of the tip from the bounds of the workspace [m], at least the radius of its ball.
        travel: speed of motions between readings [m/s].
        touch: speed of a guarded motion [m/s].
        reach: largest length of a guarded motion [m].
        arrival: largest distance from its goal at which a motion may end [m].
        stale: age of the status during a motion at which the machine is stopped [s].
        grace: time that a motion may take beyond 1.5 times its length divided by its speed [s].
        body: spheres that enclose stylus and tool, in the frame of the probe: origin at the ball's centre, z along the
            stylus, away from the tool. None checks the tip alone, which is not enough for a tool that turns.

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
    body: Body | None = None

    def __post_init__(self) -> None:
        for name in ("travel", "touch", "reach", "arrival", "stale", "grace"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"limits, {name}: expected a positive number, got {getattr(self, name)}. Correct it.")
        if not self.clearance >= 0:
            raise InputError(f"limits, clearance: expected 0 or more, got {self.clearance}. Correct it.")

    def violation(self, here: Vectors, goal: Vectors, axes: Sequence[Rotations] = (DOWN, DOWN)) -> str:
        """Return the first limit that a straight path violates, for messages; empty if there is none.

        Args:
            here: start of the path ``(3,)`` [m].
            goal: end of the path ``(3,)`` [m].
            axes: axes of the tool at both ends ``(3, 3)``; between them it rotates at a constant rate.
        """
        if not np.isfinite([*here, *goal]).all():
            return "a finite position"
        margins = self.workspace.clearances(goal)[0] - self.clearance
        crossed = [box.name for box in self.workspace.forbidden if box.crossed(here, goal, self.clearance)]
        if crossed:
            return f"the forbidden box '{crossed[0]}'"
        if not (margins >= 0).all():
            return self.workspace.limits[int(np.argmin(margins))]
        return "" if self.body is None else self._violation_of_body(self.body, here, goal, axes)

    def _violation_of_body(self, body: Body, here: Vectors, goal: Vectors, axes: Sequence[Rotations]) -> str:
        """Return the first limit that the body of the tool violates on a path; empty if there is none.

        The distances are those at poses along the path, less the way of a sphere between a pose and its neighbours.
        """
        turn = SO3.log(axes[0].T @ axes[1])
        lever = float(np.linalg.norm(body.centres, axis=1).max())
        way = float(np.linalg.norm(goal - here)) + lever * float(np.linalg.norm(turn))
        if not np.isfinite(way):
            return "a finite orientation"
        count = 1 + int(np.ceil(way / _STEP))
        s = np.linspace(0.0, 1.0, count + 1)[:, None]
        poses = SE3.from_parts(axes[0] @ SO3.exp(s * turn), here + s * (goal - here))
        margins = self.workspace.of_body(body, poses).min(axis=0, initial=np.inf) - 0.5 * way / count
        if (margins >= 0).all():
            return ""
        return f"{self.workspace.limits[int(np.argmin(margins))]} with the body of the tool"
