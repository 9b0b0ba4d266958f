"""Compute the geometry of a probing program: start, contact and end of each touch, and the paths between touches.

Positions are those of the ball's centre. A touch is a straight guarded motion. The ball returns along the same line and
moves to the next touch over the part at a safe height.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Rotations, Transforms, Vectors
from tanteo.parts import Surface
from tanteo.parts.shapes import ball_contact
from tanteo.posterior import box_corners
from tanteo.posterior.answers import point_moves

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.planning import Plan, Probe

_SDS, _LEAST_OVERTRAVEL = 3.0, 2e-3
"""Default overtravel: standard deviations of the surface position, and the smallest distance [m]."""

_STEPS = 100
"""Numerical: places on the line to a contact at which the distance from the part is computed."""

_NEAR = 1e-7
"""Distance below which two positions are equal [m]."""

SURE = 0.01
"""Largest probability of a miss at which a touch without contact ends a program that cannot count them."""

LEAST_MISS, DEAD_PROBE = 0.1, 0.02
"""Least probability with which a miss counts, and probability of all misses since the last contact at which a program
ends. Two misses in a row at faces that every placement hits end it: one may be an error of the prior."""

DOWN = np.diag([1.0, -1.0, -1.0])
"""Axes of a tool that points down ``(3, 3)``."""

TRAVEL, APPROACH = 0.1, 0.05
"""Speeds between touches, and on the line from the outer point to the start of a touch [m/s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """Guarded motion of one touch; positions of the ball's centre in the world frame [m].

    Attributes:
        number: number of the touch from 1, in the order of the plan.
        face: name of the face that the ball should touch.
        start: start of the guarded motion ``(3,)``.
        direction: unit direction of the guarded motion ``(3,)``.
        contact: expected position at contact ``(3,)``.
        stop: position at which the search ends without contact ``(3,)``.
        outer: point outside of the cylinder around the part, on the straight line back from the start ``(3,)``.
        tool: axes of a robot's tool ``(3, 3)``, its z along the stylus.
        miss: largest probability that a working probe makes no contact.
    """

    number: int
    face: str
    start: Vectors
    direction: Vectors
    contact: Vectors
    stop: Vectors
    outer: Vectors
    tool: Rotations
    miss: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """Touches of a probing program with their common settings.

    Attributes:
        part: name of the part.
        message: expected accuracy of the plan, one sentence.
        touches: touches in the order of the program.
        radius: radius of the ball [m].
        feed: speed of the guarded motions [m/s].
        safe_height: world z at which the ball moves over the part [m].
        lowest: world z below the part and all starts, by the same clearance [m].
        centre: centre of the part's bounding box ``(3,)``, world frame [m].
        outer_radius: radius of the vertical cylinder about ``centre`` that contains the part and all starts [m].
    """

    part: str
    message: str
    touches: tuple[Touch, ...]
    radius: float
    feed: float
    safe_height: float
    lowest: float
    centre: Vectors
    outer_radius: float

    @property
    def seconds(self) -> tuple[float, ...]:
        """Approximate durations of the touches with their travel ``(n,)`` [s], until the expected contact."""
        found, before = [], None
        for touch in self.touches:
            way = first_way(self, touch) if before is None else transfer(self, before, touch)
            places = np.array([place for place, _ in way])
            travel = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
            lines = np.linalg.norm(touch.outer - touch.start) + np.linalg.norm(touch.contact - touch.start)
            guarded = float(np.linalg.norm(touch.contact - touch.start))
            found.append(travel / TRAVEL + float(lines) / APPROACH + guarded / self.feed + float(lines) / TRAVEL)
            before = touch
        return tuple(found)


def job_of(
    plan: Plan,
    part: Part,
    probe: Probe,
    covariance: Covariances,
    feed: float,
    overtravel: float | None = None,
    retract_height: float | None = None,
) -> Job:
    """Compute the motions of a probing program for a plan.

    Args:
        plan: planned readings.
        part: part that is touched.
        probe: touch probe that the plan assumes.
        covariance: covariance of the part's expected pose before the first touch ``(6, 6)``, part frame.
        feed: speed of the guarded motions [m/s].
        overtravel: distance of the search beyond the expected contact [m]. The default is three standard deviations
            of the surface position, at least 2 mm.
        retract_height: world z at which the ball moves over the part [m]. The default is the lowest safe height.

    Raises:
        InputError: The plan has no readings, or the retract height is not above part and starts.
    """
    if not plan.readings:
        raise InputError(f"--program: expected a plan with touches, got none. {plan.message}")
    empty = _surroundings(plan, part, probe, covariance)
    if retract_height is not None and retract_height < empty.safe_height:
        raise InputError(
            f"--retract-height: expected {1e3 * empty.safe_height:.1f} mm or more, above part and starts with "
            f"clearance and three sd, got {1e3 * retract_height:g} mm. Omit it or increase it."
        )
    job = replace(empty, feed=feed, safe_height=empty.safe_height if retract_height is None else retract_height)
    surface, T, touches = Surface(part.vertices, part.triangles), plan.T_world_part, []
    for number, r in enumerate(plan.readings, 1):
        way = _way_to_contact(surface, T, r.origin, r.direction, probe.radius)
        beyond = overtravel if overtravel is not None else _beyond(T, covariance, r.point, r.direction)
        contact = r.origin + way * r.direction
        fast = _fast(surface, T, r.origin, r.direction, way, max(probe.clearance, beyond) + probe.radius)
        start = r.origin + fast * r.direction
        places = start, r.direction, contact, contact + beyond * r.direction
        tool = tool_axes(-probe.holders(r.direction[None])[0])
        touches.append(Touch(number, r.face, *places, leaves(start, -r.direction, job), tool, 1.0 - r.meets))
    return replace(job, touches=tuple(touches))


def _surroundings(plan: Plan, part: Part, probe: Probe, covariance: Covariances) -> Job:
    """Return a job without touches: the height, depth and radius of the part and all starts, with clearance."""
    corners = SE3.apply(plan.T_world_part, box_corners(part))
    starts = np.array([r.origin for r in plan.readings])
    clearance = probe.clearance + probe.radius + _SDS * _height_sd(plan.T_world_part, part, covariance)
    every, centre = np.concatenate([corners, starts]), corners.mean(axis=0)
    outer_radius = float(np.linalg.norm(every[:, :2] - centre[:2], axis=1).max()) + clearance
    heights = float(every[:, 2].max()) + clearance, float(every[:, 2].min()) - clearance
    return Job(part.name, plan.message, (), probe.radius, 0.0, *heights, centre, outer_radius)


def transfer(job: Job, one: Touch, other: Touch) -> list[tuple[Vectors, Rotations]]:
    """Return the path of a robot's tool from the outer point of one touch to that of the next.

    The path rises to the safe height outside of the cylinder around the part, crosses the part with the tool pointing
    down, and descends.

    Args:
        job: touches of the program.
        one: touch that was made last.
        other: next touch.

    Returns:
        Positions ``(3,)`` of the ball's centre and axes ``(3, 3)`` of the tool, world frame.
    """
    up, down = _column(job, one), _column(job, other)[::-1]
    rise = [(place, one.tool) for place in up[1:]]
    over = [(place, DOWN) for place in (up[-1], down[0])]
    return [*rise, *over, *((place, other.tool) for place in down)]


def first_way(job: Job, touch: Touch) -> list[tuple[Vectors, Rotations]]:
    """Return the path from the safe height to the first outer point, as positions and tool axes.

    Args:
        job: touches of the program.
        touch: first touch.
    """
    down = _column(job, touch)[::-1]
    return [(down[0], DOWN), *((place, touch.tool) for place in down)]


def _column(job: Job, touch: Touch) -> list[Vectors]:
    """Return the path from an outer point up to the safe height; below the part it first leaves the cylinder."""
    places = [touch.outer]
    sideways = touch.outer[:2] - job.centre[:2]
    distance = float(np.linalg.norm(sideways))
    if touch.outer[2] < job.safe_height - _NEAR and distance < job.outer_radius - _NEAR:
        way = sideways / distance if distance > 0 else np.array([1.0, 0.0])
        places.append(np.array([*(job.centre[:2] + job.outer_radius * way), touch.outer[2]]))
    top = np.array([*places[-1][:2], job.safe_height])
    return [*places, top] if np.linalg.norm(top - places[-1]) > _NEAR else places


def _way_to_contact(surface: Surface, T: Transforms, origin: Vectors, direction: Vectors, radius: float) -> float:
    """Return the distance that the ball moves until contact [m]."""
    to_part = SE3.inverse(T)
    way = ball_contact(surface, SE3.apply(to_part, origin), direction @ T[:3, :3], radius)
    if not np.isfinite(way):
        raise InputError(
            "--program: expected touches that reach the part, got one that misses it. Plan with a larger sd."
        )
    return way


def _fast(surface: Surface, T: Transforms, origin: Vectors, direction: Vectors, way: float, clearance: float) -> float:
    """Return how far the ball's centre moves towards a contact with a clearance from the whole part [m].

    It moves fast there, and only the rest is a slow guarded motion.
    """
    ways = np.linspace(0.0, max(way - clearance, 0.0), _STEPS)
    gaps = surface.closest(SE3.apply(SE3.inverse(T), origin + ways[:, None] * direction)).distances
    near = np.flatnonzero(gaps < clearance)
    return float(ways[max(int(near[0]) - 1, 0)] if len(near) else ways[-1])


def _beyond(T: Transforms, covariance: Covariances, point: Vectors, direction: Vectors) -> float:
    """Return the default overtravel [m]."""
    moves = T[:3, :3] @ point_moves(SE3.apply(SE3.inverse(T), point[None]))[0]
    sd = float(np.sqrt(direction @ moves @ covariance @ moves.T @ direction))
    return max(_LEAST_OVERTRAVEL, _SDS * sd)


def _height_sd(T: Transforms, part: Part, covariance: Covariances) -> float:
    """Return the largest standard deviation of height over the corners of the part's box [m]."""
    moves = (T[:3, :3] @ point_moves(box_corners(part)))[:, 2]
    return float(np.sqrt(np.einsum("ki,ij,kj->k", moves, covariance, moves).max()))


def leaves(origin: Vectors, back: Vectors, job: Job) -> Vectors:
    """Return the point where a straight line back from a start leaves the vertical cylinder around the part.

    Args:
        origin: start of a touch ``(3,)``, world frame [m].
        back: unit direction of the retreat ``(3,)``.
        job: job whose cylinder, safe height and lowest height bound the surroundings of the part.

    Returns:
        The point ``(3,)`` [m]; the start itself if it is outside already.
    """
    a, b = origin[:2] - job.centre[:2], back[:2]
    flat, half, rest = float(b @ b), float(a @ b), float(a @ a) - job.outer_radius**2
    ways = [(-half + np.sqrt(half**2 - flat * rest)) / flat] if flat > 0 and rest < 0 else []
    if rest >= 0:
        return origin
    if back[2] != 0:
        ways.append(((job.safe_height if back[2] > 0 else job.lowest) - origin[2]) / back[2])
    return np.asarray(origin + max(min(ways), 0.0) * back)


def tool_axes(direction: Vectors) -> FloatArray:
    """Return the axes of a tool with z along a direction, by the smallest rotation of a tool that points down.

    Args:
        direction: unit direction ``(3,)``, world frame.

    Returns:
        Rotation matrix ``(3, 3)``.
    """
    axis = np.cross(DOWN[:, 2], direction)
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        return DOWN if direction[2] < 0 else np.eye(3)
    angle = np.arctan2(length, float(DOWN[:, 2] @ direction))
    return np.asarray(SO3.exp(angle * axis / length) @ DOWN)
