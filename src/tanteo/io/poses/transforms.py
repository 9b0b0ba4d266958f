"""Interpolate moving frames as ROS publishes them (TF), and chain them from a frame to the world."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms

_ONE = 1e-9
"""Difference below which two times count as equal [s]."""
_GAP, _PERIODS = 0.5, 5.0
"""Longest gap between samples that is interpolated: absolute [s], and as a multiple of the median period."""
_STILL = 1e-6
"""Largest motion over a gap of a frame that counts as standing still [m, rad]."""


@dataclass(slots=True, eq=False)
class Track:
    """Poses of one frame in its parent over time.

    Attributes:
        times: sample times ``(n,)``, sorted [s].
        Ts: poses ``(n, 4, 4)`` [m].
        static: whether the frame does not move, so that the last sample holds at all times.
    """

    times: FloatArray
    Ts: Transforms
    static: bool = False

    @classmethod
    def of(cls, samples: list[tuple[float, Transforms]], *, static: bool = False) -> Track:
        """Return the track of unsorted samples; of samples with equal times the last one is used.

        Args:
            samples: time [s] and pose ``(4, 4)`` of each sample.
            static: whether the frame does not move.
        """
        order = sorted(range(len(samples)), key=lambda k: (samples[k][0], k))
        times = np.array([samples[k][0] for k in order])
        last = np.append(np.diff(times) > _ONE, True)
        return cls(times[last], np.stack([samples[k][1] for k in order])[last], static)

    def at(self, times: FloatArray) -> tuple[Transforms, BoolArray]:
        """Return interpolated poses, and the mask of the times at which they are known.

        A pose is known between the first and the last sample, except within a long gap over which the frame moved. The
        interpolation has constant body velocity: ``T_k exp(s log(T_k^-1 T_k+1))``.

        Args:
            times: query times ``(m,)`` [s].

        Returns:
            Poses ``(m, 4, 4)``, and the mask ``(m,)``.
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
    """Tree of moving frames.

    Attributes:
        parents: parent of each frame.
        tracks: poses of each frame in its parent.
    """

    parents: dict[str, str] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict)

    def chain(self, frame: str) -> list[str]:
        """Return the frame and its ancestors up to the root; the chain stops before a cycle.

        Args:
            frame: name of the first frame.
        """
        out = [frame]
        while out[-1] in self.parents and self.parents[out[-1]] not in out:
            out.append(self.parents[out[-1]])
        return out

    def pose(self, world: str, frame: str, times: FloatArray) -> tuple[Transforms, BoolArray]:
        """Return ``T_world_frame`` at several times, and the mask of times at which the whole chain is known.

        Args:
            world: name of any frame of the same tree.
            frame: name of the frame.
            times: query times ``(m,)`` [s].

        Returns:
            Poses ``(m, 4, 4)``, and the mask ``(m,)``.
        """
        chain, other = self.chain(frame), self.chain(world)
        common = next(name for name in chain if name in other)
        T, known = self._up(chain, common, times)
        if common == world:
            return T, known
        T_common_world, there = self._up(other, common, times)
        return SE3.inverse(T_common_world) @ T, known & there

    def connects(self, frame: str, other: str) -> bool:
        """Return whether two frames are in one tree.

        Args:
            frame: name of a frame.
            other: name of another frame.
        """
        return self.chain(frame)[-1] == self.chain(other)[-1]

    def frames(self, frame: str) -> list[str]:
        """Return all frames of the tree of a frame, by name.

        Args:
            frame: name of a frame.
        """
        return sorted(one for one in {*self.parents, *self.parents.values()} if self.connects(one, frame))

    def _up(self, chain: list[str], top: str, times: FloatArray) -> tuple[Transforms, BoolArray]:
        """Return the poses of the first frame of a chain in a later one."""
        T = np.repeat(np.eye(4)[None], len(times), axis=0)
        known = np.ones(len(times), dtype=bool)
        for child in chain[: chain.index(top)]:
            step, there = self.tracks[child].at(times)
            T = step @ T
            known = known & there
        return T, known


def pose_of(position: FloatArray, quaternion_xyzw: FloatArray) -> Transforms:
    """Return a pose ``(4, 4)`` from a ROS position and quaternion, which is normalized.

    Args:
        position: translation ``(3,)`` [m].
        quaternion_xyzw: quaternion ``(4,)`` with the scalar last.
    """
    q = np.asarray(quaternion_xyzw, dtype=np.float64)
    length = float(np.linalg.norm(q))
    x, y, z, w = q / length if length > 0 else (0.0, 0.0, 0.0, 1.0)
    angle = 2 * np.arctan2(float(np.linalg.norm((x, y, z))), w)
    axis = np.array([x, y, z])
    norm = float(np.linalg.norm(axis))
    R = SO3.exp(angle * axis / norm) if norm > 0 else np.eye(3)
    return SE3.from_parts(R, np.asarray(position, dtype=np.float64))
