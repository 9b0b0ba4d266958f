"""What labels say of an object that is not the part: points of one label share a plane, a line or a point of it.

Points that are anywhere hardly ever lie in one plane. So a label whose points do is no proof of whichever part has such
a face.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.geometry.special import log_even, log_sum
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Vectors

_COUNT = 6
"""Points of a label that count (decision 62). A made face is off by the same for all of them, so that more points state
no more of whether it is the part's."""

_SIZES = 6
"""Sizes of faces and edges, each half of the last, that are equally likely."""


@dataclass(frozen=True, slots=True, eq=False)
class Facets:
    """Pieces of planes that the measurements show: labelled planes, and sensed normals with their points; and edges.

    Attributes:
        normals: outward, or of either sign where nobody knows; of edges their directions ``(K, 3)``.
        covariances: of them ``(K, 3, 3)`` [rad^2].
        points: of each ``(K, 3)`` [m].
        variances: of these along the normal, infinite for edges ``(K,)`` [m^2].
    """

    normals: Vectors
    covariances: Covariances
    points: Vectors
    variances: FloatArray

    def __len__(self) -> int:
        return len(self.normals)


@dataclass(frozen=True, slots=True, eq=False)
class Elsewhere:
    """Measurements off the part, beside as many outliers that know nothing of each other.

    Attributes:
        log_odds: of each group, log density of its points on a surface of their own, over that of outliers ``(G,)``.
        facets: what is known of surfaces.
    """

    log_odds: FloatArray
    facets: Facets


def groups_of(points: ContactPoints) -> IntArray:
    """Number of the label of each point ``(n,)``; -1 where it has none, or is alone with it and says no more."""
    counts: dict[tuple[str, str], int] = {}
    keys = list(zip(points.labels, points.kinds, strict=True))
    for key in keys:
        counts[key] = counts.get(key, 0) + 1
    surface = {key for key, factor in zip(keys, points.factors, strict=True) if factor.on_surface}
    several = [key for key, count in counts.items() if key[0] and count > 1 and key in surface]
    number = {key: k for k, key in enumerate(several)}
    return np.array([number.get(key, -1) for key in keys], dtype=np.int32)


def elsewhere(points: ContactPoints, groups: IntArray, radius: float) -> Elsewhere:
    """What the labels say of an object of which nothing else is known.

    Args:
        points: the measurements.
        groups: of :func:`groups_of`.
        radius: of the ball in which the object is [m].
    """
    alone = np.flatnonzero(points.oriented & (groups < 0) & ~points.centres)
    n, sd = points.normals[alone], points.normal_sds[alone]
    at = points.points[alone] - points.radii[alone, None] * n
    variances = np.einsum("ni,nij,nj->n", n, points.covs[alone], n)
    rows = list(zip(n, sd[:, None, None] ** 2 * np.eye(3), at, variances, strict=True))
    log_odds = np.zeros(groups.max(initial=-1) + 1)
    for g in range(len(log_odds)):
        own = points.take(np.flatnonzero(groups == g))
        free = 3 - own.factors[0].codimension
        if own.factors[0].round_face:  # a wall may bend in any way
            continue
        if len(own) <= free:  # two points tell the direction of an edge, or that they meet, and nothing of a face
            continue
        log, facet = _shared(own, radius)
        if len(own) > 2 or not free:
            log_odds[g] = log_even(log * min(1.0, _COUNT / len(own)))
        if facet is not None and log > 0:
            rows.append(facet)
    columns = (
        zip(*rows, strict=True) if rows else (np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0))
    )
    return Elsewhere(log_odds, Facets(*(np.array(column) for column in columns)))


_Row: TypeAlias = tuple[Vectors, Covariances, Vectors, FloatArray]


def _shared(points: ContactPoints, radius: float) -> tuple[float, _Row | None]:
    """Log density of points on one plane, line or point that is anywhere, over that of outliers; the plane or line.

    The integral over the plane, line or point is Laplace's, about their least squares fit.
    """
    middle = points.points.mean(axis=0)
    axes = np.linalg.svd((points.points - middle).T @ (points.points - middle))[2]
    free = 3 - points.factors[0].codimension  # directions along what they share come first
    across, along = axes[free:], axes[:free]
    off = (points.points - middle) @ across.T
    if free == 2:
        off = off - _outward(points, across[0]) * points.radii[:, None]
    m = len(across)
    lever = (points.points - middle) @ along.T
    levers = [lever[:, k, None, None] * np.eye(m) for k in range(free)]
    J = np.concatenate(
        [np.broadcast_to(np.eye(m), (len(points), m, m)), *levers, -across @ points.shared_jacobian], axis=2
    )
    log, best, C = _integral(points, across @ points.covs @ across.T, J, off, radius)
    if not points.directed.any():
        log += _log_together(float(np.linalg.norm(lever, axis=1).max(initial=0.0)), len(points), free, radius)
    if free == 1:
        direction = along[0] + best[2:4] @ across
        direction /= np.linalg.norm(direction)
        return log, (direction, across.T @ C[2:4, 2:4] @ across, middle, np.array(np.inf))
    if free == 0:
        return log, None
    normal = across[0] - best[1:3] @ along
    normal /= np.linalg.norm(normal)
    if points.directed.any():
        log += float(np.log(np.maximum(np.abs(points.directions[points.directed] @ normal), 1e-3)).sum())
    return log, (normal, along.T @ C[1:3, 1:3] @ along, middle + best[0] * across[0], C[0, 0])


def _integral(
    points: ContactPoints, S: Covariances, J: FloatArray, off: FloatArray, radius: float
) -> tuple[float, FloatArray, Covariances]:
    """Log of the integral over a plane, line or point, over the density of outliers; its states and their covariance.

    Args:
        points: that are on it.
        S: their covariances across it ``(n, m, m)`` [m^2].
        J: how they move with its states, the shared errors last ``(n, m, k)``.
        off: how far they are from the first guess of it ``(n, m)`` [m].
        radius: of the object [m].
    """
    m = off.shape[1]
    states = m * (4 - m)  # of the plane, line or point, before the shared errors
    room = {1: 2 * radius, 2: np.pi * radius**2, 3: 4 / 3 * np.pi * radius**3}[m]
    turns = {1: 4 * np.pi if points.inward.any() else 2 * np.pi, 2: 2 * np.pi, 3: 1.0}[m]
    W = np.linalg.inv(S)
    H = np.einsum("nai,nab,nbj->ij", J, W, J)
    H += np.diag(np.r_[np.full(m, radius**-2), np.ones(len(H) - m)])
    pull = np.einsum("nai,nab,nb->i", J, W, off)
    best = np.linalg.solve(H, pull)
    chi2 = float(np.einsum("na,nab,nb->", off, W, off) - pull @ best)
    log = -np.log(room * turns) + 0.5 * states * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1] - 0.5 * chi2
    log += len(points) * (np.log(room) - 0.5 * m * np.log(2 * np.pi)) - 0.5 * np.linalg.slogdet(S)[1].sum()
    return float(log), best, np.linalg.inv(H)


def _log_together(reach: float, n: int, free: int, radius: float) -> float:
    """Log density of where points are on a face, or along an edge, that is as large as it may be, over anywhere.

    Args:
        reach: of the points from their middle [m].
        n: number of points.
        free: two for a face, one for an edge, none for a corner.
        radius: of the object [m].
    """
    sizes = radius * 0.5 ** np.arange(_SIZES)
    held = sizes[sizes >= min(reach, radius)]
    anywhere, own = {
        0: (1.0, 1.0 + 0 * held),
        1: (4 / 3 * radius, 2 * held),
        2: (2 / 3 * np.pi * radius**2, np.pi * held**2),
    }[free]
    return float(log_sum((n - 1) * np.log(anywhere / own)) - np.log(_SIZES))


def _outward(points: ContactPoints, normal: Vectors) -> float:
    """1 where the normal looks towards the sensor, -1 where away; 1 where nobody knows."""
    return -1.0 if float(np.sum(points.inward @ normal)) > 0 else 1.0
