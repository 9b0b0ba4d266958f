"""What the robots' programs have in common: ways, poses, what their heads say, rows of a log.

The tool's z is the stylus, its TCP the centre of the ball.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tanteo.io import BRANDS, pose_as_brand
from tanteo.lie import SE3
from tanteo.programs.job import Job, Touch, first_way, transfer
from tanteo.typing import Rotations, Vectors

COLUMNS = "id,x_mm,y_mm,z_mm,radius_mm,dx,dy,dz"
"""Of a readings file, as logs have them."""

TRAVEL = 0.1
"""Speed between touches [m/s]."""


def robot_header(job: Job, log: list[str]) -> list[str]:
    """Lines that a person must read before the program runs, those on its log last."""
    return [
        f"tanteo plan: {len(job.touches)} touches of {job.part}",
        job.message,
        "frame: world of the plan = the robot's base; tool: TCP at the centre of the ball, z along the stylus,",
        f"away from the flange; ball radius {1e3 * job.radius:g} mm; probe on digital input 1 (UR: 0), high at contact",
        "before it starts: a free straight way from where the robot is to the first point.",
        "around the part nothing is known: look at every motion, and run it without the part and slowly first",
        *log,
    ]


def ways(job: Job) -> Iterator[tuple[Touch, list[tuple[Vectors, Rotations]]]]:
    """Each touch, and the way to its outer point from the one before."""
    before: Touch | None = None
    for touch in job.touches:
        way = first_way(job, touch) if before is None else transfer(job, before, touch)
        ahead = [*way[1:], (np.full(3, np.inf), touch.tool)]
        stays = [np.allclose(p, q) and np.allclose(R, Q) for (p, R), (q, Q) in zip(way, ahead, strict=True)]
        yield touch, [there for there, stay in zip(way, stays, strict=True) if not stay]
        before = touch


def pose_text(name: str, place: Vectors, tool: Rotations) -> str:
    """A pose in a controller's syntax."""
    brand = BRANDS[name]
    values = pose_as_brand(name, SE3.from_parts(tool, place)) + 0.0
    of_place, of_turn = (4 if brand.metre < 1 else 7), (5 if brand.radian < 1 else 7)
    texts = [f"{v:.{of_place}f}" for v in values[:3]] + [f"{v:.{of_turn}f}" for v in values[3:]]
    return brand.syntax.format(*(t.removeprefix("-") if not float(t) else t for t in texts))


def facts(job: Job, touch: Touch) -> str:
    """What a row of the log has behind the place."""
    d = ",".join(f"{v:.6f}" for v in np.round(touch.direction, 6) + 0.0)
    return f"{1e3 * job.radius:g},{d}"
