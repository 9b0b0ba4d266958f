"""What beams have been through: no material lies before a hit, none on a path on which nothing was met.

None that the sensor would have answered to, that is: a face that lies more obliquely than its limit sends no echo back.
"""

from __future__ import annotations

import numpy as np

from tanteo.lie import SO3
from tanteo.matching.evidence import Priors
from tanteo.matching.model import PartModel
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

_IN_FRONT = 4.0
"""Material this many standard deviations before the hit contradicts a beam."""


def material_in_front(touches: Touches, Ts: Transforms, z: FloatArray, target: Target) -> BoolArray:
    """Readings whose free path runs through the part ``(S, n)``."""
    out = np.zeros((len(Ts), len(touches)), dtype=bool)
    rows = np.flatnonzero((touches.reach > 0) & touches.directed)
    if not len(rows):
        return out
    points = touches.points[rows] + np.einsum("nid,sd->sni", touches.gains[rows], z)
    start = points - touches.reach[rows, None] * touches.directions[rows]
    local = (start - Ts[:, None, :3, 3]) @ Ts[:, :3, :3]
    along = np.einsum("sji,nj->sni", Ts[:, :3, :3], touches.directions[rows])
    free = touches.reach[rows] - _IN_FRONT * touches.sd[rows] - 0.01 * target.part.diagonal
    s, n = np.nonzero(target.surface.cast(local, along).distances < free)
    if len(s):  # a path that only grazes the part may have passed beside it
        aside = _IN_FRONT * touches.sd[rows[n], None, None] * _across(along[s, n])
        hits = target.surface.cast(local[s, n, None] + aside, along[s, n, None]).distances
        out[s, rows[n]] = np.all(hits < free[n, None], axis=1)
    return out


def _across(directions: Vectors) -> FloatArray:
    """Four unit vectors across each direction ``(k, 4, 3)``."""
    least = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    u = SO3.cross(directions, least)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = SO3.cross(directions, u)
    return np.stack([u, v, -u, -v], axis=1)


def log_free_paths(free: FreePaths, Ts: Transforms, target: Target | PartModel, priors: Priors) -> FloatArray:
    """Log probability of the paths on which nothing was met ``(S,)``: clutter's, for each that the part blocks.

    A path that is not known exactly may have passed beside the part where that is near its border.
    """
    if not len(free.origins):
        return np.zeros(len(Ts))
    passed, _ = _passed(free, Ts, target)
    return np.asarray(np.sum(np.log(priors.clutter + (1 - 2 * priors.clutter) * passed), axis=1))


def gone_through(free: FreePaths, T: Transforms, target: Target | PartModel) -> FloatArray:
    """How far before its end each path should have met the part ``(m,)`` [m]; zero for those that it does not block.

    Args:
        free: paths on which nothing was met.
        T: pose of the part ``(4, 4)``.
        target: the part.
    """
    if not len(free.origins):
        return np.zeros(0)
    passed, hits = _passed(free, T[None], target)
    return np.where(passed[0] < 0.5, free.lengths - np.minimum(hits[0], free.lengths), 0.0)


def _passed(free: FreePaths, Ts: Transforms, target: Target | PartModel) -> tuple[FloatArray, FloatArray]:
    """How probably each path passes the part ``(S, m)``, and where its middle meets it ``(S, m)`` [m]."""
    assert target.part is not None
    local = (free.origins - Ts[:, None, :3, 3]) @ Ts[:, :3, :3]
    along = np.einsum("sji,nj->sni", Ts[:, :3, :3], free.directions)
    hits = _echoes(target, local, along, free.incidences)
    end = free.lengths - free.margin - 0.01 * target.part.diagonal
    passed = (hits >= end).astype(np.float64)
    s, n = np.nonzero((hits < end) & (free.slopes > 0))
    if len(s):  # five rays of equal moments with the disc: the one in the middle counts one half
        beside = along[s, n, None] + 2 * free.slopes[n, None, None] * _across(along[s, n])
        beside /= np.linalg.norm(beside, axis=-1, keepdims=True)
        start = np.broadcast_to(local[s, n, None], beside.shape)
        echoes = _echoes(target, start, beside, free.incidences[n, None])
        passed[s, n] = 0.5 * np.mean(echoes >= end[n, None], axis=1)
    return passed, hits


def _echoes(target: Target | PartModel, starts: Vectors, along: Vectors, incidences: FloatArray) -> FloatArray:
    """Distances of what rays meet first; infinite where that is met at more than these angles."""
    hits = target.surface.cast(starts, along)
    cosines = np.abs(np.sum(target.surface.normals[hits.triangles] * along, axis=-1))
    return np.where(cosines >= np.cos(incidences) - 1e-12, hits.distances, np.inf)
