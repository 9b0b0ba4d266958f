"""What one sensor read on one leg of a crossing, and the creases at which a surface does not end but turns away."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.hand import FREE, LOST, MET, HandReading, advance, gap
from tanteo.typing import BoolArray, FloatArray, Transforms

_DROPS = 3
"""Readings past the surface that it takes to call its end an edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """What the frontal sensors read on the surface, and what counts as off it.

    Attributes:
        ranges: Of the two sensors [m]; NaN for one that was not over it at the start.
        slack: A range that is longer by this has dropped off [m].
        sds: Standard deviation of one reading [m].
        spots: Radii of the cones there [m].
    """

    ranges: FloatArray
    slack: FloatArray
    sds: FloatArray
    spots: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The readings of one sensor on a leg that begins over the surface.

    Attributes:
        Ts_world_hand: Poses of the hand ``(n, 4, 4)``.
        ways: From the begin of the leg ``(n,)`` [m].
        ranges: ``(n,)`` [m]; NaN where nothing was met.
        on: On the surface ``(n,)``.
        dropped: Farther than the surface, or nothing within range ``(n,)``.
        lost: No range, though something is there ``(n,)``.
    """

    Ts_world_hand: Transforms
    ways: FloatArray
    ranges: FloatArray
    on: BoolArray
    dropped: BoolArray
    lost: BoolArray

    @classmethod
    def of(cls, leg: Sequence[HandReading], sensor: int, distance: float, slack: float) -> Track:
        """Of one sensor over a surface at a distance [m], which may seem nearer or farther by a slack [m]."""
        ranges = np.array([s.ranges[sensor] for s in leg])
        states = np.array([s.states[sensor] for s in leg])
        Ts = np.array([s.T_world_hand for s in leg])
        ways = np.concatenate([[0.0], np.linalg.norm(np.diff(Ts[:, :3, 3], axis=0), axis=1).cumsum()])
        met = states == MET
        on = met & (np.abs(ranges - distance) < slack)
        dropped = np.where(met, ranges > distance + slack, states == FREE)
        return cls(Ts, ways, ranges, on, dropped, states == LOST)

    def last_on(self, gap: float, *, blindly: bool = False) -> int | None:
        """The last reading on the surface before the first ``gap`` [m] in which all readings dropped off it.

        Readings without a range count neither way, unless ``blindly``: next to an edge the beam grazes the side face
        below it.
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
        """Where the hand was after a way [m]."""
        k = int(np.clip(np.searchsorted(self.ways, way), 1, len(self.ways) - 1))
        before, after = self.Ts_world_hand[k - 1], self.Ts_world_hand[k]
        share = (way - self.ways[k - 1]) / max(self.ways[k] - self.ways[k - 1], 1e-12)
        return advance(before, np.concatenate(gap(before, after)), share)


STEEP = math.radians(75.0)
"""Said of a bend beyond which the sensor gives no ranges: at about this angle and more they do not answer [rad]."""

_LEAST = math.radians(2.0)
"""Less than this is no bend [rad]."""

_SOME = 6
"""Readings beyond the bend that tell its angle."""

_MOSTLY = 0.7
"""Share of the ranges beyond that must be near."""


@dataclass(frozen=True, slots=True, eq=False)
class Crease:
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


def crease_of(sensor: int, number: int, track: Track, surface: Surface, beyond: float) -> Crease | None:
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
        return Crease(sensor, track.pose_at(float(track.ways[steep])), distance, STEEP)
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
    return Crease(sensor, track.pose_at(float(track.ways[last] - higher / slope)), distance, math.atan(slope))


def crease_angle(creases: Sequence[Crease]) -> str:
    """By how much a surface bends away, in words."""
    angle = float(np.median([c.angle for c in creases]))
    return f"by about {math.degrees(angle):.0f} deg" if angle < STEEP else "too steeply for the sensors to answer"


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    slope, offset = np.polyfit(x, y, 1)
    return float(slope), float(offset)
