"""The wall of a bore or a boss, read by a frontal beam that comes down over its rim at a slant, the hand above the face.

At rest a beam reads the mean over its cone. On a curved wall at a slant that is not the range along its axis; the
difference follows from the circle that is known by then, and is taken off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tanteo.acquisition.plane import HOVER
from tanteo.acquisition.run import SensingRun
from tanteo.acquisition.ways import fits, moved, nearly_known
from tanteo.features import Feature
from tanteo.hand import MET
from tanteo.lie import SE3
from tanteo.motion import Motion, dwell, go_to, path
from tanteo.sensors import error_model
from tanteo.typing import FloatArray, Transforms

SLANT = math.radians(35.0)
"""Of the beam to the axis: it meets the wall at an angle that sensors answer to, and comes deep enough into a bore."""

_INSTANTS = 24
"""Readings at rest of which one mean is made."""

_ABOVE = 0.003
"""The sensor stands so much higher over the face than the stand-off [m]: the finger's rim is lower when it leans."""

_OTHER = 0.004
"""A mean range that is farther off than this from where the wall should be is of something else [m]."""

_MOST_MISSED = 0.2
"""Share of the readings at rest that may have no range."""


@dataclass(frozen=True, slots=True, eq=False)
class WallReading:
    """One place of the wall.

    Attributes:
        sensor: Its number on the rig.
        T_world_hand: The hand's pose, by the robot ``(4, 4)``.
        distance: Range along the beam's axis [m].
        along_sd: Standard deviation of it, apart from what the sensor's readings share [m].
        across_sd: Of where the beam met the wall, across it [m].
    """

    sensor: int
    T_world_hand: Transforms
    distance: float
    along_sd: float
    across_sd: float


def depths(run: SensingRun, circle: Feature, *, convex: bool) -> tuple[float, float]:
    """Of the two rings below the rim [m]; the second not below the first where beams do not reach deep enough."""
    radius = circle.radius or 0.0
    half_angle = float(error_model(run.hand.rig).beam_half_angle[list(run.hand.frontal)].max())
    # the cone meets the wall below the rim only
    across = math.tan(half_angle) / math.sin(SLANT)
    first = 1.2 * across * (run.standoff + _ABOVE) / (math.cos(SLANT) - 1.2 * across)
    spot = math.tan(half_angle) * (run.standoff + first) / math.cos(SLANT) ** 2
    second = first + min(max(0.008, radius), 0.012)
    deepest = math.inf if convex else (2 * radius - 1.2 * spot) / math.tan(SLANT)
    return first, min(second, deepest)


def read_wall(
    run: SensingRun, circle: Feature, out: FloatArray, depth: float, sensor: int, *, convex: bool
) -> tuple[WallReading | None, Motion]:
    """The mean of some readings of the wall at one angle and depth, and how the last motion ended.

    Args:
        run: The run; the rim is sensed.
        circle: The rim, z out of the material.
        out: Direction of the radius ``(3,)``, unit.
        depth: Below the rim [m].
        sensor: Number of the frontal sensor that looks.
        convex: A boss.
    """
    target, expected = _aimed(run, circle, out, depth, sensor, convex=convex)
    above = moved(target, HOVER * circle.T_world_feature[:3, 2])
    for pose in (above, target):
        way = path(run.robot.sensed.T_world_hand, pose, run.hand.front, 12)
        if not fits(run, run.seen().keep(run.seen().met), way) or (pose is target and not nearly_known(run, way)):
            return None, Motion("wall", "limit", "there is no known room for the hand over the rim", ())
        last = run.does(go_to(run.robot, pose, run.rules))
        if not last.reached:
            return None, last
    stood = run.does(dwell(run.robot, _INSTANTS, run.rules))
    reading = _mean(run, stood, circle, sensor, expected) if stood.reached else None
    back = run.does(go_to(run.robot, above, run.rules))
    return reading, stood if back.reached else back


def _aimed(
    run: SensingRun, circle: Feature, out: FloatArray, depth: float, sensor: int, *, convex: bool
) -> tuple[Transforms, float]:
    """The pose in which a sensor looks at a place of the wall, and the range to it [m]."""
    hand, T = run.hand, circle.T_world_feature
    normal, radius = T[:3, 2], circle.radius or 0.0
    place = T[:3, 3] + radius * out - depth * normal
    z = -math.cos(SLANT) * normal + (-1 if convex else 1) * math.sin(SLANT) * out
    x = np.cross(normal, out)
    R = np.stack([x, np.cross(z, x), z], axis=1)
    H = np.stack([hand.pair, np.cross([0.0, 0.0, 1.0], hand.pair), [0.0, 0.0, 1.0]], axis=1)
    away = (run.standoff + _ABOVE + depth) / math.cos(SLANT)
    R = R @ H.T
    return SE3.from_parts(R, place - away * z - R @ hand.origins[sensor]), away


def _mean(run: SensingRun, stood: Motion, circle: Feature, sensor: int, expected: float) -> WallReading | None:
    """One reading of those at rest; None where they are not of the wall."""
    log = stood.log[len(stood.log) // 4 :]
    met = np.array([s.states[sensor] == MET for s in log])
    if met.mean() < 1 - _MOST_MISSED:
        return None
    ranges, n = np.array([s.ranges[sensor] for s in log])[met], int(met.sum())
    T, model = log[-1].T_world_hand, error_model(run.hand.rig)
    half_angle = float(model.beam_half_angle[sensor])
    distance = float(ranges.mean()) - _cone_excess(run, T, circle, sensor, half_angle)
    if abs(distance - expected) > _OTHER + 0.05 * expected:
        return None
    sd = float(model.law.sigma(np.full(len(model.names), distance))[sensor])
    return WallReading(sensor, T, distance, sd / math.sqrt(n), 0.5 * distance * half_angle / math.sqrt(n))


def _cone_excess(run: SensingRun, T: Transforms, circle: Feature, sensor: int, half_angle: float) -> float:
    """By how much the mean range over a cone is longer than that along its axis, on the wall below a circle [m]."""
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
    reach = _to_wall(start, rays, circle.radius or 0.0, inside=circle.convex is False)
    return float(np.nanmean(reach[1:]) - reach[0])


def _to_wall(start: FloatArray, rays: FloatArray, radius: float, *, inside: bool) -> FloatArray:
    """Ranges to a cylinder about z ``(n,)`` [m]; NaN for rays that pass it. Inside it is the far wall that is met."""
    a = np.sum(rays[:, :2] ** 2, axis=1)
    b = rays[:, :2] @ start[:2]
    root = b**2 - a * (start[:2] @ start[:2] - radius**2)
    root = np.sqrt(np.where(root >= 0, root, np.nan))
    return np.asarray((-b + (root if inside else -root)) / a)
