"""The wall of a bore or a boss, read by a frontal beam that comes over its rim at a slant, the hand above the face.

At rest a beam reads the mean over its cone. On a curved wall at a slant that is not the range along its axis; the
difference follows from the circle that is known by then, and is taken off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tanteo.features import Feature
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.hand.acquisition.crossings import raised
from tanteo.hand.acquisition.plane import HOVER, SCANS
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.ways import BETWEEN, fits, moved, nearly_known, scan_surroundings
from tanteo.hand.motion.steering import Motion
from tanteo.hand.motion.travelling import dwell, go_to, path
from tanteo.hand.robot import HIT
from tanteo.sensors import error_model
from tanteo.words.findings import NoSpace, NotAllSeen

SLANT = math.radians(35.0)
"""Of the beam to the axis: it meets the wall at an angle that sensors answer to, and comes deep enough into a bore."""

_CLEAR = 1.2
"""Distance of a cone from the rim, in radii of its spot."""

_INSTANTS = 24
"""Number of readings at rest that are averaged."""

_SPARE = 1e-3
"""Additional clearance from the face of a tilted hand [m]."""

_OTHER = 0.004, 0.05
"""Largest deviation of a range to the wall from its expected value [m, fraction], beyond the spread within the cone."""

_SCANS = 2
"""Largest number of scans over one position."""

_MOST_MISSED = 0.1
"""Largest fraction of readings at rest without a range to the wall."""


@dataclass(frozen=True, slots=True, eq=False)
class WallReading:
    """Averaged reading of one position on the wall.

    Attributes:
        sensor: index of the sensor on the rig.
        T_world_hand: pose of the hand that the robot reports ``(4, 4)`` [m].
        distance: range along the beam's axis [m].
        along_sd: standard deviation of the range, without the sensor's shared errors [m].
        across_sd: standard deviation of the position on the wall across the beam [m].
    """

    sensor: int
    T_world_hand: Transforms
    distance: float
    along_sd: float
    across_sd: float


def height_of(run: SensingRun) -> float:
    """Return the height of the sensor over the face at which the tilted hand has enough clearance [m].

    Args:
        run: running acquisition.
    """
    body, hand = run.hand.body, run.hand
    down = math.cos(SLANT) * np.array([0.0, 0.0, 1.0]) + math.sin(SLANT) * np.cross(hand.pair, [0.0, 0.0, 1.0])
    lower = max(float(((body.centres - hand.origins[i]) @ down + body.radii).max()) for i in hand.frontal)
    return max(run.standoff, run.rules.clearance + BETWEEN + _SPARE + lower)


def depths(run: SensingRun, circle: Feature) -> tuple[float, float]:
    """Return the depths below the rim of the first ring, and of the deepest one that the beams can reach [m].

    Args:
        run: running acquisition.
        circle: sensed rim.
    """
    radius, height = circle.radius or 0.0, height_of(run)
    half_angle = float(error_model(run.hand.rig).beam_half_angle[list(run.hand.frontal)].max())
    # the whole cone hits the wall below the rim
    across = math.tan(half_angle) / math.sin(SLANT)
    first = _CLEAR * across * height / (math.cos(SLANT) - _CLEAR * across)
    if circle.convex:
        return first, math.inf
    spot = math.tan(half_angle) * (height + first) / math.cos(SLANT) ** 2
    return first, (2 * radius - _CLEAR * spot) / math.tan(SLANT)


def read_wall(
    run: SensingRun, circle: Feature, out: FloatArray, depth: float, sensor: int
) -> tuple[WallReading | None, Motion]:
    """Return the mean of readings of the wall at one angle and depth, and the last motion.

    Args:
        run: running acquisition.
        circle: sensed rim, with z out of the material.
        out: unit direction of the radius ``(3,)``.
        depth: depth below the rim [m].
        sensor: index of the frontal sensor.
    """
    target, expected = _aimed(run, circle, out, depth, sensor)
    # move in along the beams, whose path is known to be free
    above = moved(target, -HOVER * target[:3, 2])
    come = path(above, target, run.hand.front, 8)
    last = _over(run, circle, above, come)
    if not last.reached:
        return None, last
    last = run.does(go_to(run.robot, target, run.rules))
    if not last.reached:
        return None, last
    stood = run.does(dwell(run.robot, _INSTANTS, run.rules))
    reading = _mean(run, stood, circle, sensor, expected) if stood.reached else None
    back = run.does(go_to(run.robot, above, run.rules))
    return reading, stood if back.reached else back


def _over(run: SensingRun, circle: Feature, above: Transforms, come: Transforms) -> Motion:
    """Move the hand over the rim, and scan from there until the path to the wall is known to be free."""
    way = np.concatenate([path(run.robot.sensed.T_world_hand, above, run.hand.front, 12), come])
    last = Motion("wall", "limit", NoSpace("over the rim"), ())
    if not fits(run, raised(run, circle), way):
        return last
    last = run.does(go_to(run.robot, above, run.rules))
    for tilt, spacing in SCANS[1 : 1 + _SCANS]:
        if not last.reached or nearly_known(run, come):
            return last
        last = scan_surroundings(run, tilt, spacing)
    if nearly_known(run, come) or last.status == "timeout":
        return last
    return Motion("wall", "limit", NotAllSeen("over the rim"), ())


def _aimed(run: SensingRun, circle: Feature, out: FloatArray, depth: float, sensor: int) -> tuple[Transforms, float]:
    """Return the hand pose at which a sensor points at a position on the wall, and the range to it [m]."""
    hand, T = run.hand, circle.T_world_feature
    normal, radius = T[:3, 2], circle.radius or 0.0
    place = T[:3, 3] + radius * out - depth * normal
    z = -math.cos(SLANT) * normal + (-1 if circle.convex else 1) * math.sin(SLANT) * out
    x = np.cross(normal, out)
    R = np.stack([x, np.cross(z, x), z], axis=1)
    H = np.stack([hand.pair, np.cross([0.0, 0.0, 1.0], hand.pair), [0.0, 0.0, 1.0]], axis=1)
    away = (height_of(run) + depth) / math.cos(SLANT)
    R = R @ H.T
    return SE3.from_parts(R, place - away * z - R @ hand.origins[sensor]), away


def _mean(run: SensingRun, stood: Motion, circle: Feature, sensor: int, expected: float) -> WallReading | None:
    """Return the mean of the readings at rest; None if they do not hit the wall."""
    log, model = stood.log[len(stood.log) // 4 :], error_model(run.hand.rig)
    T, half_angle = log[-1].T_world_hand, float(model.beam_half_angle[sensor])
    ranges = np.array([s.ranges[sensor] if s.states[sensor] == HIT else np.nan for s in log])
    reach = _cone(run, T, circle, sensor, half_angle)
    slack = _OTHER[0] + _OTHER[1] * expected
    own = (ranges > np.nanmin(reach) - slack) & (ranges < np.nanmax(reach) + slack)
    if own.mean() < 1 - _MOST_MISSED:
        return None
    # the mean over the cone is longer than the range along its axis
    distance, n = float(ranges[own].mean() - np.nanmean(reach[1:]) + reach[0]), int(own.sum())
    if abs(distance - expected) > slack:
        return None
    sd = float(model.law.sigma(np.full(len(model.names), distance))[sensor])
    return WallReading(sensor, T, distance, sd / math.sqrt(n), 0.5 * distance * half_angle / math.sqrt(n))


def _cone(run: SensingRun, T: Transforms, circle: Feature, sensor: int, half_angle: float) -> FloatArray:
    """Return ranges to the wall below a circle: along the axis of a beam, and along rays in its cone [m]."""
    to_circle = SE3.inverse(circle.T_world_feature) @ T
    start = SE3.apply(to_circle, run.hand.origins[sensor])
    z = run.hand.axes[sensor]
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x = x / np.linalg.norm(x)
    # a disc, evenly by area
    k = np.arange(400)
    share, turn = np.sqrt((k + 0.5) / len(k)), k * math.pi * (3 - math.sqrt(5))
    tilts = math.tan(half_angle) * share[:, None]
    rays = z + tilts * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * np.cross(z, x))
    rays = np.vstack([z, rays / np.linalg.norm(rays, axis=1, keepdims=True)]) @ to_circle[:3, :3].T
    return _to_wall(start, rays, circle.radius or 0.0, inside=not circle.convex)


def _to_wall(start: FloatArray, rays: FloatArray, radius: float, *, inside: bool) -> FloatArray:
    """Return ranges to a cylinder about z ``(n,)`` [m]; NaN for rays that miss it, and the far wall from inside."""
    a = np.sum(rays[:, :2] ** 2, axis=1)
    b = rays[:, :2] @ start[:2]
    root = b**2 - a * (start[:2] @ start[:2] - radius**2)
    root = np.sqrt(np.where(root >= 0, root, np.nan))
    return np.asarray((-b + (root if inside else -root)) / a)
