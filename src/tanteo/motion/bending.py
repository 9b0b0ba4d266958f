"""Surfaces that do not end but bend away: beyond the bend the range grows evenly with the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.motion.track import Surface, Track
from tanteo.typing import FloatArray, Transforms

STEEP = math.radians(75.0)
"""Said of a bend beyond which the sensor gives no ranges: at about this angle and more they do not answer [rad]."""

_LEAST = math.radians(2.0)
"""Less than this is no bend [rad]."""

_SOME = 6
"""Readings beyond the bend that tell its angle."""

_MOSTLY = 0.7
"""Share of the ranges beyond that must be near."""


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """Where the axis of one sensor passed over a bend.

    Attributes:
        sensor: Its number on the rig.
        T_world_hand: The hand's pose at that instant, by the robot ``(4, 4)``.
        distance: Range to the surface there [m].
        angle: By which the surface turns away along the crossing [rad]; :data:`STEEP` for all that gives no ranges.
    """

    sensor: int
    T_world_hand: Transforms
    distance: float
    angle: float


def bend_of(sensor: int, number: int, track: Track, surface: Surface, beyond: float) -> Bend | None:
    """The bend at the end of a leg, None if there is none: the surface goes on, ends in a drop, or meets a wall.

    Args:
        sensor: Its number on the rig.
        number: Its number of the pair.
        track: What it read.
        surface: What it read before.
        beyond: How far beyond the surface all readings have to be off it [m].
    """
    distance, slack = float(surface.ranges[number]), float(surface.slack[number])
    last, steep = track.last_on(beyond), track.last_on(beyond, blindly=True)
    if last is None and steep is not None:
        return Bend(sensor, track.pose_at(float(track.ways[steep])), distance, STEEP)
    if last is None:
        return None
    after = (track.ways > track.ways[last]) & (track.ways <= track.ways[last] + beyond)
    near = after & (track.ranges < distance + 4 * slack + 2.5 * beyond)
    if near.sum() < max(_SOME, _MOSTLY * (after & np.isfinite(track.ranges)).sum()):
        return None
    slope, higher = _line(track.ways[near] - track.ways[last], track.ranges[near] - distance)
    # where the surface ends in a step, it is farther at once, and not more and more
    if higher > 2 * slack or slope < math.tan(_LEAST):
        return None
    return Bend(sensor, track.pose_at(float(track.ways[last] - higher / slope)), distance, math.atan(slope))


def how_far(bends: Sequence[Bend]) -> str:
    """By how much a surface bends away, in words."""
    angle = float(np.median([b.angle for b in bends]))
    return f"by about {math.degrees(angle):.0f} deg" if angle < STEEP else "too steeply for the sensors to answer"


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    slope, offset = np.polyfit(x, y, 1)
    return float(slope), float(offset)
