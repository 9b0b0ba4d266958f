"""What beams have been through: no material lies before a hit, none on a path on which nothing was met.

None that the sensor would have answered to, that is: a face that lies more obliquely than its limit sends no echo back.
"""

from __future__ import annotations

import numpy as np

from tanteo.lie import SO3
from tanteo.localization import SharedGiven
from tanteo.matching.model import PartModel
from tanteo.matching.part_motions import observed_covariance
from tanteo.matching.priors import Priors
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors

_IN_FRONT = 4.0
"""Material this many standard deviations before the hit contradicts a beam."""

_SURELY = 3.0
"""A path that passes the part with both off by so many standard deviations is not said to go through it."""

_AROUND = np.pi / 4 * np.arange(8)
"""Ways in which they are off, across the path [rad]."""


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


def log_free_paths(
    free: FreePaths, Ts: Transforms, z: FloatArray, target: Target | PartModel, priors: Priors
) -> FloatArray:
    """Log probability of the paths on which nothing was met ``(S,)``: clutter's, for each that the part blocks.

    A path that is not known exactly may have passed beside the part where that is near its border.

    Args:
        free: the paths.
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors, which move the paths as they move the readings ``(S, D)``.
        target: the part.
        priors: rate of clutter.
    """
    if not len(free):
        return np.zeros(len(Ts))
    passed, _ = _passed(free, Ts, z, target)
    return np.asarray(np.sum(np.log(priors.clutter + (1 - 2 * priors.clutter) * passed), axis=1))


def _passed(
    free: FreePaths, Ts: Transforms, z: FloatArray, target: Target | PartModel
) -> tuple[FloatArray, FloatArray]:
    """How probably each path passes the part ``(S, m)``, and where its middle meets it ``(S, m)`` [m]."""
    origins, directions = free.at(z)
    local, along = (origins - Ts[:, None, :3, 3]) @ Ts[:, :3, :3], directions @ Ts[:, :3, :3]
    hits = _echoes(target, local, along, free.incidences)
    end = _ends(free, target)
    passed = (hits >= end).astype(np.float64)
    s, n = np.nonzero((hits < end) & (free.slopes > 0))
    if len(s):  # five rays of equal moments with the disc: the one in the middle counts one half
        beside = along[s, n, None] + 2 * free.slopes[n, None, None] * _across(along[s, n])
        beside /= np.linalg.norm(beside, axis=-1, keepdims=True)
        start = np.broadcast_to(local[s, n, None], beside.shape)
        echoes = _echoes(target, start, beside, free.incidences[n, None])
        passed[s, n] = 0.5 * np.mean(echoes >= end[n, None], axis=1)
    return passed, hits


def gone_through(
    free: FreePaths, T: Transforms, covariance: Covariances, shared: SharedGiven | None, target: Target | PartModel
) -> FloatArray:
    """How far before its end each path should have met the part ``(m,)`` [m]; zero for those that may have passed it.

    Args:
        free: paths on which nothing was met.
        T: pose of the part ``(4, 4)``.
        covariance: of that ``(6, 6)``, part frame, right perturbation [m, rad].
        shared: the whitened errors that move the paths, given the pose; None if nothing does.
        target: the part.
    """
    out = np.zeros(len(free))
    if not len(free):
        return out
    if shared is None:
        free, shared = free.unmoved(), SharedGiven.none()
    passed, hits = _passed(free, T[None], shared.mean[None], target)
    rows = np.flatnonzero(passed[0] < 0.5)
    if len(rows):
        met = hits[0, rows]
        sure = _surely(free.take(rows), T, covariance, shared, target, met)
        out[rows[sure]] = (free.lengths[rows] - met)[sure]
    return out


def _surely(
    free: FreePaths, T: Transforms, C: Covariances, shared: SharedGiven, target: Target | PartModel, met: FloatArray
) -> BoolArray:
    """Paths that meet the part also with both off by as much as is likely, to all sides and along them ``(m,)``.

    Of a cone all rays have to: its rim is at two of the standard deviations that ``slopes`` say.
    """
    origins, directions = (np.broadcast_to(x, (1, len(free), 3))[0] for x in free.at(shared.mean[None]))
    start, along = (origins - T[:3, 3]) @ T[:3, :3], directions @ T[:3, :3]
    S = _between(free, T, C, shared, target, start + met[:, None] * along, met)
    beside, cone = np.eye(3) - along[:, :, None] * along[:, None, :], (2 / _SURELY * free.slopes * met) ** 2
    values, vectors = np.linalg.eigh(beside @ (S + cone[:, None, None] * np.eye(3)) @ beside)
    axes = vectors[..., 1:] * np.sqrt(values[:, None, 1:].clip(0))
    starts = start[:, None] + _SURELY * np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=1) @ np.swapaxes(axes, 1, 2)
    end = _ends(free, target) - _SURELY * np.sqrt(np.einsum("mi,mij,mj->m", along, S, along))
    echoes = _echoes(target, starts, np.broadcast_to(along[:, None], starts.shape), free.incidences[:, None])
    return np.all(echoes < end[:, None], axis=1)


def _between(
    free: FreePaths,
    T: Transforms,
    C: Covariances,
    shared: SharedGiven,
    target: Target | PartModel,
    points: Vectors,
    far: FloatArray,
) -> Covariances:
    """Of points of paths, so far along them, against the part, in whose frame they are ``(m, 3, 3)`` [m2].

    What moves readings and paths alike moves the pose as well: that is no distance between them.
    """
    assert target.part is not None
    own = -np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -SO3.hat(points)], axis=2)
    by_shared = np.zeros((len(points), 3, len(shared.mean)))
    if free.moved:
        by_shared = T[:3, :3].T @ (free.gains + far[:, None, None] * free.turns)
        own = own + by_shared @ shared.follows
    C = observed_covariance(target.part, C)
    return np.asarray(own @ C @ np.swapaxes(own, 1, 2) + by_shared @ shared.covariance @ np.swapaxes(by_shared, 1, 2))


def _ends(free: FreePaths, target: Target | PartModel) -> FloatArray:
    """Up to where material would certainly have been met ``(m,)`` [m]."""
    assert target.part is not None
    return free.lengths - free.margin - 0.01 * target.part.diagonal


def _echoes(target: Target | PartModel, starts: Vectors, along: Vectors, incidences: FloatArray) -> FloatArray:
    """Distances of what rays meet first; infinite where that is met at more than these angles."""
    hits = target.surface.cast(starts, along)
    cosines = np.abs(np.sum(target.surface.normals[hits.triangles] * along, axis=-1))
    return np.where(cosines >= np.cos(incidences) - 1e-12, hits.distances, np.inf)
