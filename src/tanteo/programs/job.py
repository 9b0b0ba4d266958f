"""What a probing program does, in numbers: where each touch starts, meets and ends, and how the ball gets there.

Positions are of the centre of the ball. A touch is a straight motion; the ball goes back the way it came, and over the
part to the next at a safe height.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tanteo.answers import box_corners, point_moves
from tanteo.errors import InputError
from tanteo.lie import SE3, SO3
from tanteo.shapes import Surface, ball_contact
from tanteo.typing import Covariances, FloatArray, Rotations, Transforms, Vectors

if TYPE_CHECKING:
    from tanteo.active import Plan, Probe
    from tanteo.parts import Part

_SDS, _LEAST_OVERTRAVEL = 3.0, 2e-3
"""Standard deviations of the surface's place that the search goes beyond it, and the least way [m]."""

_NEAR = 1e-7
"""Nearer than this two places are one [m]."""

DOWN = np.diag([1.0, -1.0, -1.0])
"""Axes of a tool that looks down."""


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One guarded motion; world frame, metres, centres of the ball.

    Attributes:
        number: from 1, in the order of the plan.
        face: name of the face that it should meet.
        start: where the guarded motion begins ``(3,)``.
        direction: of it, unit ``(3,)``.
        contact: where it is expected to stop ``(3,)``.
        stop: where it is given up ``(3,)``.
        outer: on the straight way back from the start, outside of the part's surroundings ``(3,)``.
        tool: axes of a robot's tool ``(3, 3)``, its z along the motion.
    """

    number: int
    face: str
    start: Vectors
    direction: Vectors
    contact: Vectors
    stop: Vectors
    outer: Vectors
    tool: Rotations


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """The touches of a program and what they have in common.

    Attributes:
        part: name.
        message: what the plan promises, one sentence.
        touches: in their order.
        radius: of the ball [m].
        feed: of the guarded motion [m/s].
        safe_height: of the ball above the part, world z [m].
        lowest: as far below it [m].
        centre: of the part's box ``(3,)`` [m].
        around: radius of the upright cylinder about it that holds the part and all starts [m].
    """

    part: str
    message: str
    touches: tuple[Touch, ...]
    radius: float
    feed: float
    safe_height: float
    lowest: float
    centre: Vectors
    around: float


def job_of(
    plan: Plan,
    part: Part,
    probe: Probe,
    covariance: Covariances,
    feed: float,
    overtravel: float | None = None,
    retract_height: float | None = None,
) -> Job:
    """The program's numbers for a plan.

    Args:
        plan: the readings.
        part: that they are of.
        probe: a touch probe, as the plan had it.
        covariance: of the part's expected pose before the first touch ``(6, 6)``, part frame.
        feed: of the guarded motion [m/s].
        overtravel: how far beyond the expected contact it goes on [m]; three standard deviations of the surface's
            place, and 2 mm at least, if not given.
        retract_height: world z at which the ball goes over the part [m]; the least that is safe, if not given.

    Raises:
        InputError: The plan has no readings, or the retract height is not above part and starts.
    """
    if not plan.readings:
        raise InputError(f"--program: expected a plan with touches, got none. {plan.message}")
    empty = _surroundings(plan, part, probe, covariance)
    if retract_height is not None and retract_height < empty.safe_height:
        raise InputError(
            f"--retract-height: expected {1e3 * empty.safe_height:.1f} mm or more, above part and starts with "
            f"clearance and three sd, got {1e3 * retract_height:g} mm. Leave it out, or say more."
        )
    job = replace(empty, feed=feed, safe_height=empty.safe_height if retract_height is None else retract_height)
    surface, T, touches = Surface(part.vertices, part.triangles), plan.T_world_part, []
    for number, r in enumerate(plan.readings, 1):
        way = _way_to_contact(surface, T, r.origin, r.direction, probe.radius)
        beyond = overtravel if overtravel is not None else _beyond(T, covariance, r.point, r.direction)
        contact = r.origin + way * r.direction
        places = r.origin, r.direction, contact, contact + beyond * r.direction
        touches.append(Touch(number, r.face, *places, leaves(r.origin, -r.direction, job), tool_axes(r.direction)))
    return replace(job, touches=tuple(touches))


def _surroundings(plan: Plan, part: Part, probe: Probe, covariance: Covariances) -> Job:
    """A job without touches: how high, how low and how far out the part and all starts reach, with room around."""
    corners = SE3.apply(plan.T_world_part, box_corners(part))
    starts = np.array([r.origin for r in plan.readings])
    room = probe.clearance + probe.radius + _SDS * _height_sd(plan.T_world_part, part, covariance)
    every, centre = np.concatenate([corners, starts]), corners.mean(axis=0)
    around = float(np.linalg.norm(every[:, :2] - centre[:2], axis=1).max()) + room
    heights = float(every[:, 2].max()) + room, float(every[:, 2].min()) - room
    return Job(part.name, plan.message, (), probe.radius, 0.0, *heights, centre, around)


def transfer(job: Job, one: Touch, other: Touch) -> list[tuple[Vectors, Rotations]]:
    """Places and axes of a robot's tool from the outer point of one touch to that of another.

    Up to the safe height outside of the part's surroundings, over them with the tool looking down, and down again.
    """
    up, down = _column(job, one), _column(job, other)[::-1]
    rise = [(place, one.tool) for place in up[1:]]
    over = [(place, DOWN) for place in (up[-1], down[0])]
    return [*rise, *over, *((place, other.tool) for place in down)]


def first_way(job: Job, touch: Touch) -> list[tuple[Vectors, Rotations]]:
    """The way to the first outer point, from the safe height."""
    down = _column(job, touch)[::-1]
    return [(down[0], DOWN), *((place, touch.tool) for place in down)]


def _column(job: Job, touch: Touch) -> list[Vectors]:
    """From an outer point up to the safe height; from below the part it goes aside first."""
    places = [touch.outer]
    aside = touch.outer[:2] - job.centre[:2]
    distance = float(np.linalg.norm(aside))
    if touch.outer[2] < job.safe_height - _NEAR and distance < job.around - _NEAR:
        way = aside / distance if distance > 0 else np.array([1.0, 0.0])
        places.append(np.array([*(job.centre[:2] + job.around * way), touch.outer[2]]))
    top = np.array([*places[-1][:2], job.safe_height])
    return [*places, top] if np.linalg.norm(top - places[-1]) > _NEAR else places


def _way_to_contact(surface: Surface, T: Transforms, origin: Vectors, direction: Vectors, radius: float) -> float:
    """How far the ball goes until it touches."""
    to_part = SE3.inverse(T)
    way = ball_contact(surface, SE3.apply(to_part, origin), direction @ T[:3, :3], radius)
    if not np.isfinite(way):
        raise InputError(
            "--program: expected touches that meet the part, got one that passes it. Plan with a larger sd."
        )
    return way


def _beyond(T: Transforms, covariance: Covariances, point: Vectors, direction: Vectors) -> float:
    """Overtravel where none is given [m]."""
    moves = T[:3, :3] @ point_moves(SE3.apply(SE3.inverse(T), point[None]))[0]
    sd = float(np.sqrt(direction @ moves @ covariance @ moves.T @ direction))
    return max(_LEAST_OVERTRAVEL, _SDS * sd)


def _height_sd(T: Transforms, part: Part, covariance: Covariances) -> float:
    """Of the corner of the part's box whose height is known least [m]."""
    moves = (T[:3, :3] @ point_moves(box_corners(part)))[:, 2]
    return float(np.sqrt(np.einsum("ki,ij,kj->k", moves, covariance, moves).max()))


def leaves(origin: Vectors, back: Vectors, job: Job) -> Vectors:
    """Where a straight way back from a start leaves the upright cylinder about the part; the start if it is outside."""
    a, b = origin[:2] - job.centre[:2], back[:2]
    flat, half, rest = float(b @ b), float(a @ b), float(a @ a) - job.around**2
    ways = [(-half + np.sqrt(half**2 - flat * rest)) / flat] if flat > 0 and rest < 0 else []
    if rest >= 0:
        return origin
    if back[2] != 0:
        ways.append(((job.safe_height if back[2] > 0 else job.lowest) - origin[2]) / back[2])
    return np.asarray(origin + max(min(ways), 0.0) * back)


def tool_axes(direction: Vectors) -> FloatArray:
    """Axes of a tool whose z is along a direction, turned as little as may be from one that looks down."""
    axis = np.cross(DOWN[:, 2], direction)
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        return DOWN if direction[2] < 0 else np.eye(3)
    angle = np.arctan2(length, float(DOWN[:, 2] @ direction))
    return np.asarray(SO3.exp(angle * axis / length) @ DOWN)
