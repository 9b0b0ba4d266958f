"""Free-space rays that the part of an answer surely blocks.

A face that is more oblique than the sensor's limit returns no echo. A ray without an echo carries no information about
it.
"""

from __future__ import annotations

import numpy as np

from tanteo.factors import FreeRays
from tanteo.fitting.localization import SharedGiven
from tanteo.geometry import SO3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors
from tanteo.posterior.answers.part_motions import observed_covariance
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.settings import DEFAULTS, Settings

_DIRECTIONS = 8
"""Numerical: directions across a ray in which it is moved; between two of them the offset is 8 % less than stated."""

_ANGLES = np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False)
"""Directions across a ray in which it is moved [rad]."""


def _across(directions: Vectors) -> FloatArray:
    """Return four unit vectors across each direction ``(k, 4, 3)``."""
    least = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    u = SO3.cross(directions, least)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = SO3.cross(directions, u)
    return np.stack([u, v, -u, -v], axis=1)


def _passed(free: FreeRays, Ts: Transforms, z: FloatArray, part: PreparedPart) -> tuple[FloatArray, FloatArray]:
    """Return the probability that each ray passes the part, and the distance of its first hit [m] ``(S, m)``."""
    origins, directions = free.at(z)
    local, along = (origins - Ts[:, None, :3, 3]) @ Ts[:, :3, :3], directions @ Ts[:, :3, :3]
    hits = _echoes(part, local, along, free.incidences)
    end = _ends(free, part)
    passed = (hits >= end).astype(np.float64)
    s, n = np.nonzero((hits < end) & (free.slopes > 0))
    if len(s):  # five rays of equal moments with the disc: the one in the middle counts one half
        beside = along[s, n, None] + 2 * free.slopes[n, None, None] * _across(along[s, n])
        beside /= np.linalg.norm(beside, axis=-1, keepdims=True)
        start = np.broadcast_to(local[s, n, None], beside.shape)
        echoes = _echoes(part, start, beside, free.incidences[n, None])
        passed[s, n] = 0.5 * np.mean(echoes >= end[n, None], axis=1)
    return passed, hits


def gone_through(
    free: FreeRays,
    T: Transforms,
    covariance: Covariances,
    shared: SharedGiven | None,
    part: PreparedPart,
    settings: Settings = DEFAULTS,
) -> FloatArray:
    """Return the length of each free-space ray that the part surely blocks ``(m,)`` [m]; 0 if the ray may pass.

    Args:
        free: rays without an echo.
        T: pose of the part ``(4, 4)``.
        covariance: covariance of the pose ``(6, 6)``, part frame, right perturbation [m, rad].
        shared: whitened shared errors that move the rays, given the pose; None if there are none.
        part: the part.
        settings: settings of the inference, for the extent of an error.
    """
    out = np.zeros(len(free))
    if not len(free):
        return out
    if shared is None:
        free, shared = free.unmoved(), SharedGiven.none()
    passed, hits = _passed(free, T[None], shared.mean[None], part)
    rows = np.flatnonzero(passed[0] < 0.5)
    if len(rows):
        hit = hits[0, rows]
        sure = _surely(free.take(rows), T, covariance, shared, part, hit, settings.search.reach_sds)
        out[rows[sure]] = (free.lengths[rows] - hit)[sure]
    return out


def _surely(
    free: FreeRays, T: Transforms, C: Covariances, shared: SharedGiven, part: PreparedPart, hit: FloatArray, gate: float
) -> BoolArray:
    """Return which rays hit the part even if ray and part are displaced by any probable error ``(m,)``.

    All rays of a cone have to hit it. The rim of the cone is at two of the standard deviations in ``slopes``.
    """
    origins, directions = (np.broadcast_to(x, (1, len(free), 3))[0] for x in free.at(shared.mean[None]))
    start, along = (origins - T[:3, 3]) @ T[:3, :3], directions @ T[:3, :3]
    S = _between(free, T, C, shared, part, start + hit[:, None] * along, hit)
    beside, cone = np.eye(3) - along[:, :, None] * along[:, None, :], (2 / gate * free.slopes * hit) ** 2
    values, vectors = np.linalg.eigh(beside @ (S + cone[:, None, None] * np.eye(3)) @ beside)
    axes = vectors[..., 1:] * np.sqrt(values[:, None, 1:].clip(0))
    starts = start[:, None] + gate * np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1) @ np.swapaxes(axes, 1, 2)
    end = _ends(free, part) - gate * np.sqrt(np.einsum("mi,mij,mj->m", along, S, along))
    echoes = _echoes(part, starts, np.broadcast_to(along[:, None], starts.shape), free.incidences[:, None])
    return np.all(echoes < end[:, None], axis=1)


def _between(
    free: FreeRays,
    T: Transforms,
    C: Covariances,
    shared: SharedGiven,
    part: PreparedPart,
    points: Vectors,
    far: FloatArray,
) -> Covariances:
    """Return covariances of points on rays relative to the part, in its frame ``(m, 3, 3)`` [m^2].

    A shared error that moves readings and rays equally moves the pose as well, so it does not count.
    """
    own = -np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -SO3.hat(points)], axis=2)
    by_shared = np.zeros((len(points), 3, len(shared.mean)))
    if free.moved:
        by_shared = T[:3, :3].T @ (free.shared_jacobian + far[:, None, None] * free.turns)
        own = own + by_shared @ shared.follows
    C = observed_covariance(part.part, C)
    return np.asarray(own @ C @ np.swapaxes(own, 1, 2) + by_shared @ shared.covariance @ np.swapaxes(by_shared, 1, 2))


def _ends(free: FreeRays, part: PreparedPart) -> FloatArray:
    """Return the distance up to which material would certainly have returned an echo ``(m,)`` [m]."""
    return free.lengths - free.margin - 0.01 * part.part.diagonal


def _echoes(part: PreparedPart, starts: Vectors, along: Vectors, incidences: FloatArray) -> FloatArray:
    """Return distances of first hits; infinite if the angle of incidence exceeds the limit."""
    hits = part.surface.cast(starts, along)
    cosines = np.abs(np.sum(part.surface.normals[hits.triangles] * along, axis=-1))
    return np.where(cosines >= np.cos(incidences) - 1e-12, hits.distances, np.inf)
