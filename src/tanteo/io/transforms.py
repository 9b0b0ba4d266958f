"""Frames that move against each other, as ROS tells them (TF): the chain to a frame at a moment."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.lie import SE3, SO3
from tanteo.typing import BoolArray, FloatArray, Transforms

_ONE = 1e-9
"""Moments nearer than this are one [s]."""
_GAP, _PERIODS = 0.5, 5.0
"""The longest time between two samples over which a motion is interpolated: [s], or times the usual one."""
_STILL = 1e-6
"""A frame that is within this of where it was has not moved over a gap [m, rad]."""


@dataclass(slots=True, eq=False)
class Track:
    """Poses of one frame in another over time.

    Attributes:
        times: of the samples ``(n,)``, sorted [s].
        Ts: poses ``(n, 4, 4)``.
        static: it does not move: the last sample holds always.
    """

    times: FloatArray
    Ts: Transforms
    static: bool = False

    @classmethod
    def of(cls, samples: list[tuple[float, Transforms]], *, static: bool = False) -> Track:
        """Sorted; of samples at one moment the last holds."""
        order = sorted(range(len(samples)), key=lambda k: (samples[k][0], k))
        times = np.array([samples[k][0] for k in order])
        last = np.append(np.diff(times) > _ONE, True)
        return cls(times[last], np.stack([samples[k][1] for k in order])[last], static)

    def at(self, times: FloatArray) -> tuple[Transforms, BoolArray]:
        """Poses at moments ``(m, 4, 4)``, and at which of them it is known.

        It is known between the first sample and the last, but not within a gap in which it may have moved anywhere.
        """
        if self.static or len(self.times) == 1:
            known = np.full(len(times), self.static) | (np.abs(times - self.times[-1]) < _ONE)
            return np.repeat(self.Ts[-1:], len(times), axis=0), known
        k = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        period = np.diff(self.times)
        share = (times - self.times[k]) / (self.times[k + 1] - self.times[k])
        step = SE3.log(SE3.inverse(self.Ts[k]) @ self.Ts[k + 1])
        known = (times >= self.times[0] - _ONE) & (times <= self.times[-1] + _ONE)
        gap = period[k] > max(_GAP, _PERIODS * float(np.median(period)))
        moved = np.abs(step).max(axis=-1) > _STILL
        known &= ~(gap & moved & (share > 0) & (share < 1))
        return self.Ts[k] @ SE3.exp(np.clip(share, 0, 1)[:, None] * step), known


@dataclass(slots=True, eq=False)
class FrameTree:
    """Tracks by child, each with its parent."""

    parents: dict[str, str] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict)

    def chain(self, frame: str) -> list[str]:
        """The frame and those above it, up to the root; ends where it would go in a circle."""
        out = [frame]
        while out[-1] in self.parents and self.parents[out[-1]] not in out:
            out.append(self.parents[out[-1]])
        return out

    def pose(self, world: str, frame: str, times: FloatArray) -> tuple[Transforms, BoolArray]:
        """``T_world_frame`` at moments ``(m, 4, 4)``, and where all of the chain is known ``(m,)``."""
        T = np.repeat(np.eye(4)[None], len(times), axis=0)
        known = np.ones(len(times), dtype=bool)
        chain = self.chain(frame)
        for child in chain[: chain.index(world)]:
            step, there = self.tracks[child].at(times)
            T, known = step @ T, known & there
        return T, known


def pose_of(position: FloatArray, quaternion_xyzw: FloatArray) -> Transforms:
    """A pose of ROS: the quaternion has w last, and is made unit."""
    q = np.asarray(quaternion_xyzw, dtype=np.float64)
    length = float(np.linalg.norm(q))
    x, y, z, w = q / length if length > 0 else (0.0, 0.0, 0.0, 1.0)
    angle = 2 * np.arctan2(float(np.linalg.norm((x, y, z))), w)
    axis = np.array([x, y, z])
    norm = float(np.linalg.norm(axis))
    R = SO3.exp(angle * axis / norm) if norm > 0 else np.eye(3)
    return SE3.from_parts(R, np.asarray(position, dtype=np.float64))
