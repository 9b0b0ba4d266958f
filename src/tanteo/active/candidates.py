"""Readings that the probe can really make: places on what may be there, from where it may come, with room to come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.active.belief import Belief
from tanteo.active.probe import Probe
from tanteo.lie import SE3, SO3
from tanteo.surface_search import Target
from tanteo.typing import BoolArray, FloatArray, IntArray, Vectors

_LIVE = 0.003
"""Modes of at least this probability must be given a wide berth."""

_LIKELY = 0.01
"""Modes of at least this probability are aimed at."""

_STEPS = 4
"""Places along the way in that are checked for room."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Readings to choose from.

    Attributes:
        origins: where the probe starts, world ``(C, 3)`` [m].
        directions: in which it looks or moves, unit, world ``(C, 3)``.
        mode: mode of the belief that each is aimed at ``(C,)``.
        face: index of the face of that mode's part that is to be met ``(C,)``.
        ranges: after which it is, if that mode is true ``(C,)`` [m].
    """

    origins: Vectors
    directions: Vectors
    mode: IntArray
    face: IntArray
    ranges: FloatArray

    def __len__(self) -> int:
        return len(self.origins)

    def take(self, rows: IntArray | BoolArray) -> Candidates:
        """Some of them."""
        return Candidates(*(getattr(self, name)[rows] for name in self.__slots__))

    @property
    def aims(self) -> Vectors:
        """What each would meet if its mode is true, world ``(C, 3)`` [m]."""
        return np.asarray(self.origins + self.ranges[:, None] * self.directions)


def propose(belief: Belief, probe: Probe, count: int = 500, seed: int = 0) -> Candidates:
    """Readings on the likelier modes, about as many as asked for, that keep clear of every mode that is alive.

    Args:
        belief: what is known.
        probe: what senses, and where it may come from.
        count: of readings.
        seed: which places of the surfaces are tried.
    """
    w = belief.weights
    likely = np.flatnonzero(w >= min(_LIKELY, w.max(initial=0.0)))
    likely = likely[np.argsort(-w[likely], kind="stable")][: max(1, count // 20)]
    share = np.sqrt(w[likely]) / max(np.sqrt(w[likely]).sum(), 1e-300)
    some = [_on_mode(belief, int(k), probe, int(np.ceil(n)), seed) for k, n in zip(likely, count * share, strict=True)]
    if not some:
        none, nowhere = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        return Candidates(nowhere, nowhere, none, none, np.zeros(0))
    joint = Candidates(*(np.concatenate([getattr(c, name) for c in some]) for name in Candidates.__slots__))
    return joint.take(has_room(belief, joint, probe))


def _on_mode(belief: Belief, k: int, probe: Probe, count: int, seed: int) -> Candidates:
    """Readings that would meet evenly spread places of one mode first, at an incidence that the probe answers to."""
    target, T = belief.target(k), belief.poses[k]
    rows = np.random.default_rng((1991, seed, k)).permutation(len(target.samples))
    points, normals = target.samples[rows], target.normals[rows]
    faces = _faces(target, points)
    world, outward = SE3.apply(T, points), normals @ T[:3, :3].T
    directions = within_cone(-outward, probe)
    cosines = -np.sum(directions * outward, axis=1)
    ok = cosines > np.cos(0.95 * probe.max_incidence)
    ranges = np.resize(probe.standoffs, len(points))
    origins = world - ranges[:, None] * directions
    to_part = SE3.inverse(T)
    first = target.surface.cast(SE3.apply(to_part, origins), directions @ to_part[:3, :3].T).distances
    ok &= np.abs(first - ranges) < 1e-6 + 1e-3 * ranges
    index = np.flatnonzero(ok)[:count]
    return Candidates(origins[index], directions[index], np.full(len(index), k), faces[index], ranges[index])


def _faces(target: Target, points: Vectors) -> IntArray:
    return target.part.triangle_face[target.surface.closest(points).triangles]


def within_cone(directions: Vectors, probe: Probe) -> Vectors:
    """The allowed directions nearest to these ``(C, 3)``."""
    if probe.approach is None:
        return directions
    a = probe.approach
    along = directions @ a
    across = directions - along[:, None] * a
    length = np.linalg.norm(across, axis=1, keepdims=True)
    beside = SO3.frame_from_axis(a, 2)[:, 0]  # straight against the cone's axis every direction of its edge is as near
    across = np.where(length > 1e-9, across, beside)
    length = np.where(length > 1e-9, length, 1.0)
    edge = np.cos(probe.cone) * a + np.sin(probe.cone) * across / length
    return np.where((along >= np.cos(probe.cone))[:, None], directions, edge)


def has_room(belief: Belief, candidates: Candidates, probe: Probe) -> BoolArray:
    """Whether start and way in are inside the workspace and clear of every live mode ``(C,)``."""
    back = np.linspace(0.0, probe.retreat, _STEPS)
    way = candidates.origins[:, None] - back[:, None] * candidates.directions[:, None]
    ok: BoolArray = np.all(probe.workspace.rooms(way)[0] >= probe.clearance, axis=(1, 2))
    for k in np.flatnonzero(belief.weights >= _LIVE):
        rows = np.flatnonzero(ok)
        if not len(rows):
            break
        target, to_part = belief.target(int(k)), SE3.inverse(belief.poses[k])
        gaps = _distances(target, SE3.apply(to_part, way[rows]))
        ok[rows] = gaps.min(axis=1) >= probe.clearance
    return ok


def _distances(target: Target, points: Vectors) -> FloatArray:
    """To the surface, negative inside: from the grid, less what that may be off."""
    return np.asarray(target.field(points)[0] - 0.5 * target.field.step)
