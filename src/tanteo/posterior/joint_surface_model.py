"""Joint model of the surfaces of an unknown object: made objects have parallel and perpendicular faces.

Most objects have faces along three perpendicular axes, and several faces in one plane.
"""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SO3, maximize
from tanteo.geometry.special import log_even, log_sum
from tanteo.geometry.typing import Covariances, FloatArray, Vectors
from tanteo.posterior.labels import Facets
from tanteo.posterior.settings import DEFAULTS, Settings

_AXIS_STEPS = 3
"""Numerical: Newton steps from axes of a pair of normals to a maximum; convergence is quadratic."""


def log_joint_surfaces(facets: Facets, share: float, radius: float, settings: Settings = DEFAULTS) -> float:
    """Return the log density of facets of one made object over that of independent facets.

    Args:
        facets: pieces of planes.
        share: fraction of the faces along three perpendicular axes.
        radius: radius of the object [m].
        settings: settings of the inference.
    """
    return log_right_angled(facets, share, settings) + log_level(facets, radius, settings)


def log_level(facets: Facets, radius: float, settings: Settings = DEFAULTS) -> float:
    """Return the log density of the positions of facets over that of independent facets: some share a plane.

    Args:
        facets: pieces of planes.
        radius: radius of the object [m].
        settings: settings of the inference.
    """
    n, total = facets.normals, 0.0
    for k in range(1, len(facets)):
        tilts = facets.covariances[:k] + facets.covariances[k]
        rotated = n[:k] - n[k]
        parallel = np.sum(rotated**2, axis=1) < settings.search.reach_sds**2 * np.trace(tilts, axis1=1, axis2=2)
        parallel &= np.isfinite(facets.variances[:k] + facets.variances[k])
        if not parallel.any():
            continue
        offset = facets.points[k] - facets.points[:k][parallel]
        off = np.sum(offset * n[:k][parallel], axis=1)
        levers = np.einsum("ki,kij,kj->k", offset, facets.covariances[:k][parallel], offset)
        variance = facets.variances[:k][parallel] + facets.variances[k] + levers
        log = np.log(2 * radius) - 0.5 * np.log(2 * np.pi * variance) - 0.5 * off**2 / variance
        total += float(log_even(log.max()))  # half of parallel facets share a plane (decision 62)
    return total


def log_right_angled(facets: Facets, share: float, settings: Settings = DEFAULTS) -> float:
    """Return the log density of normals over that of independent ones: a fraction is along perpendicular axes.

    Args:
        facets: pieces of planes.
        share: fraction of the faces along the axes.
        settings: settings of the inference.
    """
    normals, covariances = facets.normals, facets.covariances
    k = len(normals)
    if k < 2:
        return 0.0
    none, one = k * np.log1p(-share), np.log(k * share) + (k - 1) * np.log1p(-share)
    tangents = SO3.frame_from_axis(normals, 2)[:, :, :2]
    S = np.swapaxes(tangents, 1, 2) @ covariances @ tangents
    frames = _axes_of_pairs(normals, settings.unknown.axis_pairs)
    log, frames = _maximized(frames, tangents, S, normals, share)
    order, kept = np.argsort(-log, kind="stable"), list[int]()
    for i in order:
        turns = np.abs(np.swapaxes(frames[kept], 1, 2) @ frames[i])
        if not np.any(turns.max(axis=2).min(axis=1) > np.cos(settings.unknown.same_axes)):
            kept.append(int(i))
    return float(log_sum([none, one, *log[kept]]))


def _axes_of_pairs(normals: Vectors, count: int) -> FloatArray:
    """Return perpendicular axes through pairs of directions, as columns ``(F, 3, 3)``.

    If the two directions are parallel, one axis is along both.
    """
    a, b = np.triu_indices(len(normals), 1)
    cosines = np.abs(np.sum(normals[a] * normals[b], axis=1))
    some = np.argsort(cosines, kind="stable")[:count]
    x, z = normals[a[some]], np.cross(normals[a[some]], normals[b[some]])
    sines = np.linalg.norm(z, axis=1, keepdims=True)
    z = np.where(sines > 0.5, z / np.maximum(sines, 1e-12), SO3.frame_from_axis(x, 0)[..., 2])
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _maximized(
    frames: FloatArray, tangents: FloatArray, S: Covariances, normals: Vectors, share: float
) -> tuple[FloatArray, FloatArray]:
    """Return axes at the maxima, and log integrals about them over the density of uniform directions."""
    free = 8 * np.pi**2 / 24  # attitudes of a body, of which 24 have the same axes
    W, log_det = np.linalg.inv(S), np.linalg.slogdet(S)[1]

    def evaluate(frames: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        along = np.einsum("fia,ki->fka", frames, normals)
        nearest = np.argmax(np.abs(along), axis=2)
        sign = np.sign(np.take_along_axis(along, nearest[..., None], 2))
        a = np.take_along_axis(np.swapaxes(frames, 1, 2), nearest[..., None], 1) * sign
        r = np.einsum("kib,fki->fkb", tangents, a)
        pulls = np.einsum("kab,fkb->fka", W, r)
        q = np.einsum("fka,fka->fk", r, pulls)
        on = np.log(share * 4 * np.pi / 6) - np.log(2 * np.pi) - 0.5 * log_det - 0.5 * q
        total = np.logaddexp(np.log1p(-share), on)
        weight = np.exp(on - total)
        J = -np.swapaxes(tangents, 1, 2) @ SO3.hat(a)  # the axis moves by phi x a
        H = np.einsum("fk,fkai,kab,fkbj->fij", weight, J, W, J) + 2 * np.pi / free ** (2 / 3) * np.eye(3)
        g = -np.einsum("fk,fkai,fka->fi", weight, J, pulls)
        log = total.sum(axis=1) + 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1] - np.log(free)
        return H, g, log

    frames, _ = maximize(frames, lambda at: evaluate(at)[:2], lambda at, step: SO3.exp(step) @ at, _AXIS_STEPS)
    return evaluate(frames)[2], frames
