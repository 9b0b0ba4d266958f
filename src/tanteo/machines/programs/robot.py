"""Common elements of robot programs: paths, poses, header and log rows.

The tool's z is along the stylus, and its TCP is the centre of the ball.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Rotations, Vectors
from tanteo.io import BRANDS, pose_as_brand
from tanteo.machines.programs.job import LEAST_MISS, Job, Touch, first_way, transfer

COLUMNS = "id,x_mm,y_mm,z_mm,radius_mm,dx,dy,dz"
"""Columns of the readings file that the log becomes."""


def robot_header(job: Job, log: list[str], probe: str = "probe on digital input 1, high at contact") -> list[str]:
    """Return the header lines that the operator must read before the program runs.

    Args:
        job: touches of the program.
        log: lines on the log of this controller; they come last.
        probe: input of the probe.
    """
    return [
        f"tanteo plan: {len(job.touches)} touches of {job.part}",
        job.message,
        f"time: about {sum(job.seconds):.0f} s, {max(job.seconds):.0f} s for the slowest touch",
        "frame: world of the plan = the robot's base; tool: TCP at the centre of the ball, z along the stylus,",
        f"away from the flange; ball radius {1e3 * job.radius:g} mm; {probe}",
        "before it starts: a free straight way from where the robot is to the first point.",
        "obstacles around the part are unknown: check every motion, and run it without the part and slowly first",
        *log,
    ]


def misses(job: Job) -> str:
    """Return the header line of a program that goes on after a touch without contact.

    Args:
        job: touches of the program.
    """
    expected = sum(touch.miss for touch in job.touches)
    return f"a touch without contact (about {expected:.0f} are expected) does not end it; improbable misses in a row do"


def miss_text(touch: Touch) -> str:
    """Return the probability with which a miss of a touch counts, at least :data:`LEAST_MISS`.

    Args:
        touch: touch of the program.
    """
    return f"{max(touch.miss, LEAST_MISS):.2f}"


def ways(job: Job) -> Iterator[tuple[Touch, list[tuple[Vectors, Rotations]]]]:
    """Yield each touch with the path from the outer point of the previous touch to its own.

    Args:
        job: touches of the program.
    """
    before: Touch | None = None
    for touch in job.touches:
        way = first_way(job, touch) if before is None else transfer(job, before, touch)
        ahead = [*way[1:], (np.full(3, np.inf), touch.tool)]
        stays = [np.allclose(p, q) and np.allclose(R, Q) for (p, R), (q, Q) in zip(way, ahead, strict=True)]
        yield touch, [there for there, stay in zip(way, stays, strict=True) if not stay]
        before = touch


def pose_text(name: str, place: Vectors, tool: Rotations) -> str:
    """Return a pose in the syntax of a controller.

    Args:
        name: brand of the controller, a key of :data:`tanteo.io.BRANDS`.
        place: position ``(3,)``, world frame [m].
        tool: axes of the tool ``(3, 3)``.
    """
    brand = BRANDS[name]
    values = pose_as_brand(name, SE3.from_parts(tool, place)) + 0.0
    of_place, of_turn = (4 if brand.metre < 1 else 7), (5 if brand.radian < 1 else 7)
    texts = [f"{v:.{of_place}f}" for v in values[:3]] + [f"{v:.{of_turn}f}" for v in values[3:]]
    return brand.syntax.format(*(t.removeprefix("-") if not float(t) else t for t in texts))


def facts(job: Job, touch: Touch) -> str:
    """Return the columns of a log row after the position: radius of the ball [mm] and direction of the touch.

    Args:
        job: touches of the program.
        touch: touch of the row.
    """
    d = ",".join(f"{v:.6f}" for v in np.round(touch.direction, 6) + 0.0)
    return f"{1e3 * job.radius:g},{d}"
