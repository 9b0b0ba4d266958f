"""Readings of one sensor during a crossing, and creases, at which a surface bends away without ending."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.hand.robot import FREE, HIT, LOST, HandReading
from tanteo.hand.twists import advance, pose_difference

_DROPS = 3
"""Number of readings beyond the surface that confirm an edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Readings of the frontal sensors on the surface before a crossing.

    Attributes:
        ranges: ranges of the two sensors ``(2,)`` [m]; NaN for one that was not over the surface.
        slack: increase of each range at which the sensor is off the surface ``(2,)`` [m].
        sds: standard deviation of one reading of each sensor ``(2,)`` [m].
        spots: radii of the cones on the surface ``(2,)`` [m].
    """

    ranges: FloatArray
    slack: FloatArray
    sds: FloatArray
    spots: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Readings of one sensor during a leg that begins over the surface.

    Attributes:
        Ts_world_hand: poses of the hand ``(n, 4, 4)``.
        ways: path lengths from the beginning of the leg ``(n,)`` [m].
        ranges: ranges ``(n,)`` [m]; NaN without one.
        on: whether a reading is on the surface ``(n,)``.
        dropped: whether a reading is beyond the surface, or nothing is within range ``(n,)``.
        lost: whether a reading has an echo without a valid range ``(n,)``.
    """

    Ts_world_hand: Transforms
    ways: FloatArray
    ranges: FloatArray
    on: BoolArray
    dropped: BoolArray
    lost: BoolArray

    @classmethod
    def of(cls, leg: Sequence[HandReading], sensor: int, distance: float, slack: float) -> Track:
        """Create the track of one sensor over a surface.

        Args:
            leg: readings of one straight motion, in order.
            sensor: index of the sensor on the rig.
            distance: expected range to the surface [m].
            slack: largest difference from that range at which a reading counts as on the surface [m].
        """
        ranges = np.array([s.ranges[sensor] for s in leg])
        states = np.array([s.states[sensor] for s in leg])
        Ts = np.array([s.T_world_hand for s in leg])
        ways = np.concatenate([[0.0], np.linalg.norm(np.diff(Ts[:, :3, 3], axis=0), axis=1).cumsum()])
        hits = states == HIT
        on = hits & (np.abs(ranges - distance) < slack)
        dropped = np.where(hits, ranges > distance + slack, states == FREE)
        return cls(Ts, ways, ranges, on, dropped, states == LOST)

    def last_on(self, gap: float, *, blindly: bool = False) -> int | None:
        """Return the index of the last reading on the surface before it ends; None if it does not end.

        At least three readings off the surface must confirm the end.

        Args:
            gap: path length that must be off the surface [m].
            blindly: whether echoes without a range confirm the end. Next to an edge the beam grazes the side face, and
                such echoes are no proof.
        """
        ways, off = self.ways, self.dropped | self.lost
        counted = off if blindly else self.dropped
        for k in np.flatnonzero(self.on):
            beyond = (ways > ways[k]) & (ways < ways[k] + gap)
            if ways[-1] < ways[k] + gap:
                return None
            if off[beyond].all() and counted[beyond].sum() >= _DROPS:
                return int(k)
        return None

    def pose_at(self, way: float) -> Transforms:
        """Return the pose of the hand after a path length [m]."""
        k = int(np.clip(np.searchsorted(self.ways, way), 1, len(self.ways) - 1))
        before, after = self.Ts_world_hand[k - 1], self.Ts_world_hand[k]
        share = (way - self.ways[k - 1]) / max(self.ways[k] - self.ways[k - 1], 1e-12)
        return advance(before, np.concatenate(pose_difference(before, after)), share)


STEEP = math.radians(75.0)
"""Angle reported for a bend beyond which the sensor gives no ranges [rad]; at about this incidence echoes fail."""

_LEAST = math.radians(2.0)
"""Smallest angle of a bend [rad]."""

_SOME = 6
"""Smallest number of readings beyond the bend for its angle."""

_MOSTLY = 0.7
"""Smallest fraction of the ranges beyond that must be near the surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Crease:
    """Pose of the hand at which the axis of one sensor passed over a bend of the surface.

    Attributes:
        sensor: index of the sensor on the rig.
        T_world_hand: reported pose of the hand at that instant ``(4, 4)``.
        distance: range to the surface there [m].
        angle: angle by which the surface bends away along the crossing [rad]; :data:`STEEP` without ranges beyond it.
    """

    sensor: int
    T_world_hand: Transforms
    distance: float
    angle: float


def crease_of(sensor: int, number: int, track: Track, surface: Surface, beyond: float) -> Crease | None:
    """Return the bend at the end of a leg, or None if the surface continues, ends in a drop, or meets a wall.

    Args:
        sensor: index of the sensor on the rig.
        number: index of the sensor in the frontal pair.
        track: readings of the sensor during the leg.
        surface: readings on the surface before the crossing.
        beyond: distance beyond the surface for which all readings must be off it [m].
    """
    distance, slack = float(surface.ranges[number]), float(surface.slack[number])
    last, steep = track.last_on(beyond), track.last_on(beyond, blindly=True)
    if last is None and steep is not None:
        return Crease(sensor, track.pose_at(float(track.ways[steep])), distance, STEEP)
    if last is None:
        return None
    after = (track.ways > track.ways[last]) & (track.ways <= track.ways[last] + beyond)
    near = after & (track.ranges < distance + 4 * slack + 2.5 * beyond)
    if near.sum() < max(_SOME, _MOSTLY * (after & np.isfinite(track.ranges)).sum()):
        return None
    slope, higher = _line(track.ways[near] - track.ways[last], track.ranges[near] - distance)
    # at a step the range grows at once, at a bend gradually
    if higher > 2 * slack or slope < math.tan(_LEAST):
        return None
    return Crease(sensor, track.pose_at(float(track.ways[last] - higher / slope)), distance, math.atan(slope))


def crease_angle(creases: Sequence[Crease]) -> float:
    """Return the angle of a bend [rad]; infinite if it is too steep for the sensors."""
    angle = float(np.median([c.angle for c in creases]))
    return angle if angle < STEEP else math.inf


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    slope, offset = np.polyfit(x, y, 1)
    return float(slope), float(offset)
