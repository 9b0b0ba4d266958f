"""The likelihood of readings on a surface at given poses: mixture with clutter, shared errors as state.

A reading without correspondence is either on the surface, with its noise along the normal, or clutter. If nobody
knows how it was aimed, it may have met the surface anywhere, by area; if its direction is known, what it says is how
far it went, and material in front of the hit speaks against it (``math.md`` sections 7 and 10).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.lie import SO3
from tanteo.matching.prior import log_density_within, prior_residuals
from tanteo.matching.priors import Priors
from tanteo.surface_search.free_space import log_free_paths, material_in_front
from tanteo.surface_search.kin import Densities
from tanteo.surface_search.near_edges import NearEdges, log_near_edges, near_edges
from tanteo.surface_search.sensed_face import AWAY, GRAZING, turn_to_beams, turn_to_normals
from tanteo.surface_search.sensed_normals import Tilts, tilts
from tanteo.surface_search.strays import log_density, on_surface
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import FloatArray, IntArray, Transforms, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class Explained:
    """The readings at some poses ``S``, each explained by the surface and by clutter; normals add residuals.

    Attributes:
        r: residuals in standard deviations ``(S, n + 3 m)``.
        J: derivatives by pose and shared errors ``(S, n + 3 m, 6 + D)``.
        densities: of each reading, on the surface and as clutter.
        clutter: mean rate of strays.
        edges: readings near edges, which are on several faces.
    """

    r: FloatArray
    J: FloatArray
    densities: Densities
    clutter: float
    edges: NearEdges | None

    @property
    def log(self) -> FloatArray:
        """Of both together, all readings ``(S,)``."""
        return log_density(self.densities.log_hit, self.densities.log_stray, self.clutter)

    @property
    def belongs(self) -> FloatArray:
        """Probability that each reading is on the surface ``(S, n)``."""
        return on_surface(self.densities.log_hit, self.densities.log_stray, self.clutter)


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """The readings in the part, and the surface that each is nearest to or was turned to."""

    R: FloatArray
    p: Vectors
    g: Vectors
    distance: FloatArray
    s: FloatArray
    beside: FloatArray
    normal: Vectors
    nearest: IntArray
    met: IntArray


def explain(touches: Touches, Ts: Transforms, z: FloatArray, target: Target, priors: Priors) -> Explained:
    """Residuals, derivatives, and log densities of both explanations.

    Args:
        touches: the readings.
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors ``(S, D)``.
        target: the part.
        priors: rate of clutter, and the size of the workspace.
    """
    at = _placed(touches, Ts, z, target)
    r = at.distance * at.s
    shared = [np.einsum("sni,nid->snd", at.normal, touches.gains)] if z.shape[1] else []
    J = np.concatenate([-at.g, SO3.cross(at.g, at.p), *shared], axis=-1) * at.s[..., None]
    edges = near_edges(touches, target, at.R, at.p, at.nearest)
    known = None if edges is None else (edges.poses, edges.readings, edges.log)
    densities, tilt = _densities(touches, Ts, z, target, priors, at, known)
    if tilt is not None:
        r, J = _with_normals(touches, at, r, J, tilt)
    return Explained(r, J, densities, priors.clutter, edges)


def densities_at(touches: Touches, Ts: Transforms, z: FloatArray, target: Target, priors: Priors) -> Densities:
    """Log densities of each reading on the surface and as clutter: :func:`explain`, without derivatives."""
    at = _placed(touches, Ts, z, target)
    edges = log_near_edges(touches, target, at.R, at.p, at.nearest)
    return _densities(touches, Ts, z, target, priors, at, edges)[0]


def log_posterior(
    touches: Touches, free: FreePaths, Ts: Transforms, z: FloatArray, target: Target, priors: Priors
) -> FloatArray:
    """Log density of readings, pose and shared errors ``(S,)``, that of the pose over "anywhere".

    A box has no border here: outside it is as dense as inside (:mod:`within`).

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        Ts: poses ``(S, 4, 4)``.
        z: whitened shared errors ``(S, D)``.
        target: the part.
        priors: rate of clutter, the size of the workspace, what is known of the pose.
    """
    at = densities_at(touches, Ts, z, target, priors)
    log = log_density(at.log_hit, at.log_stray, priors.clutter)
    return log + log_beside_readings(free, Ts, z, target, priors)


def log_beside_readings(free: FreePaths, Ts: Transforms, z: FloatArray, target: Target, priors: Priors) -> FloatArray:
    """What :func:`log_posterior` adds to the likelihood: shared errors, prior of the pose, free paths ``(S,)``."""
    log = log_free_paths(free, Ts, z, target, priors) - 0.5 * np.sum(z * z, axis=1)
    if priors.pose is None:
        return np.asarray(log)
    r = prior_residuals(priors.pose, target.part, Ts)
    return np.asarray(log + log_density_within(priors.pose, priors.radius) - 0.5 * np.sum(r * r, axis=1))


def _placed(touches: Touches, Ts: Transforms, z: FloatArray, target: Target) -> _Placed:
    R = Ts[:, :3, :3]
    points = touches.points
    if z.shape[1]:
        points = points + np.einsum("nid,sd->sni", touches.gains, z)
    p = (points - Ts[:, None, :3, 3]) @ R
    phi, g, nearest = target.nearest(p)
    met = nearest.copy()
    beside = turn_to_beams(touches, target, R, p, phi, g, met) + turn_to_normals(touches, target, R, p, phi, g, met)
    normal = g @ np.swapaxes(R, 1, 2)
    if np.isnan(touches.variance):
        s = 1 / np.sqrt(((normal[:, :, None] @ touches.covs)[:, :, 0] * normal).sum(axis=-1))
    else:
        s = np.full(phi.shape, touches.variance**-0.5)
    return _Placed(R, p, g, phi - touches.radii, s, beside, normal, nearest, met)


def _densities(
    touches: Touches,
    Ts: Transforms,
    z: FloatArray,
    target: Target,
    priors: Priors,
    at: _Placed,
    edges: tuple[IntArray, IntArray, FloatArray] | None,
) -> tuple[Densities, Tilts | None]:
    """Densities of each reading, and how far sensed normals are off."""
    r, directed = at.distance * at.s, touches.directed
    log = -0.5 * (r * r + at.beside + np.log(2 * np.pi)) + np.log(at.s)
    if directed.any():
        cosine = -np.einsum("sni,ni->sn", at.normal, touches.directions)
        aimed = np.where(cosine > 0, np.log(np.maximum(cosine, GRAZING)), AWAY)
        log += np.where(directed, aimed, -np.log(target.part.area))
    else:
        log -= np.log(target.part.area)
    ball = np.log(4 / 3 * np.pi * priors.radius**3)
    stray = np.array(np.broadcast_to(np.where(directed, -np.log(2 * priors.radius), -ball), r.shape))
    rows, tilt = np.flatnonzero(touches.oriented), None
    if len(rows):
        which, turn = np.broadcast_to(rows, (len(Ts), len(rows))), np.broadcast_to(at.R[:, None], (*r.shape, 3, 3))
        m = touches.normals[rows] @ at.R
        tilt = tilts(touches, target, turn[:, rows], which, m, at.p[:, rows], at.g[:, rows], at.met[:, rows])
        log[:, rows] += tilt.log
        stray[:, rows] -= np.log(4 * np.pi)
    there = log + 0.5 * r * r
    if edges is not None:
        log[edges[0], edges[1]] = edges[2]
    if (touches.reach * directed).any():
        log[material_in_front(touches, Ts, z, target)] = -np.inf
    return Densities(log, stray, there, at.distance, at.s, target.part.triangle_face[at.met]), tilt


def _with_normals(
    touches: Touches, at: _Placed, r: FloatArray, J: FloatArray, tilt: Tilts
) -> tuple[FloatArray, FloatArray]:
    """Add the rows of sensed normals: their tilt against the surface's."""
    rows = np.flatnonzero(touches.oriented)
    gains = np.swapaxes(at.R, 1, 2)[:, None] @ touches.gains[rows, :, : J.shape[-1] - 6]
    turn, S, k = tilt.rows(at.p[:, rows], gains), len(at.R), 3 * len(rows)
    r = np.concatenate([r, tilt.gap.reshape(S, k)], axis=1)
    return r, np.concatenate([J, turn.reshape(S, k, J.shape[-1])], axis=1)


def normal_equations(touches: Touches, at: Explained, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Information ``(S, 6 + D, 6 + D)`` and gradient, every reading weighted by the probability that it belongs.

    The faces of readings near edges are taken as known, each with its share.

    Args:
        touches: the readings.
        at: what they are at some poses.
        z: whitened shared errors there ``(S, D)``.
    """
    rows, edges, all_ = np.flatnonzero(touches.oriented), at.edges, at.belongs
    belongs = all_
    if edges is not None:
        belongs = np.array(all_)
        belongs[edges.poses, edges.readings] = 0.0
    w = belongs if not len(rows) else np.concatenate([belongs, np.repeat(belongs[:, rows], 3, axis=1)], axis=1)
    JtW = np.swapaxes(at.J, 1, 2) * w[:, None, :]
    A, b = JtW @ at.J, -(JtW @ at.r[..., None])[..., 0]
    if edges is not None:
        edges.add_to(A, b, all_[edges.poses, edges.readings])
    D = z.shape[1]
    if D:
        A[:, 6:, 6:] += np.eye(D)
        b[:, 6:] -= z
    return A, b
