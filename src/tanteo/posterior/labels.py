"""Evidence of labels for an unknown object: points of one label share a plane, a line or a point.

Points anywhere in space hardly ever lie in one plane. But a label whose points do is no evidence for the parts that
have such a face, because an unknown object has flat faces, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.geometry.special import log_even, log_sum
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Vectors

_COUNT = 6
"""Number of points of a label that count (decision 62). A made face deviates equally for all of them, so more points
carry no more information on whether the face is the part's."""

_SIZES = 6
"""Number of equally probable sizes of faces and edges, each half of the previous one."""


@dataclass(frozen=True, slots=True, eq=False)
class Facets:
    """Pieces of planes and edges that the measurements show: labelled ones, and sensed normals with their points.

    Attributes:
        normals: outward normals, or of either sign where the side is unknown; for edges their directions ``(K, 3)``.
        covariances: covariances of the normals ``(K, 3, 3)`` [rad^2].
        points: a point on each ``(K, 3)`` [m].
        variances: variances of these points along the normal ``(K,)`` [m^2]; infinite for edges.
    """

    normals: Vectors
    covariances: Covariances
    points: Vectors
    variances: FloatArray

    def __len__(self) -> int:
        return len(self.normals)


@dataclass(frozen=True, slots=True, eq=False)
class LabelEvidence:
    """Densities of measurements on an unknown object, over those of independent outliers.

    Attributes:
        log_odds: log density of the points of each label on a surface of their own, over that of outliers ``(G,)``.
        facets: surfaces that the measurements show.
    """

    log_odds: FloatArray
    facets: Facets


def groups_of(points: ContactPoints) -> IntArray:
    """Return the index of the label of each point ``(n,)``; -1 if its label gives no information."""
    counts: dict[tuple[str, str], int] = {}
    keys = list(zip(points.labels, points.kinds, strict=True))
    for key in keys:
        counts[key] = counts.get(key, 0) + 1
    surface = {key for key, factor in zip(keys, points.factors, strict=True) if factor.on_surface}
    several = [key for key, count in counts.items() if key[0] and count > 1 and key in surface]
    number = {key: k for k, key in enumerate(several)}
    return np.array([number.get(key, -1) for key in keys], dtype=np.int32)


def label_evidence(points: ContactPoints, groups: IntArray, radius: float) -> LabelEvidence:
    """Return the densities of labelled points on an unknown object.

    Args:
        points: the measurements.
        groups: labels as :func:`groups_of` numbers them.
        radius: radius of the ball that contains the object [m].
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
        if len(own) <= free:  # two points fix the direction of an edge, but no face
            continue
        log, facet = _shared(own, radius)
        if len(own) > 2 or not free:
            log_odds[g] = log_even(log * min(1.0, _COUNT / len(own)))
        if facet is not None and log > 0:
            rows.append(facet)
    columns = (
        zip(*rows, strict=True) if rows else (np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0))
    )
    return LabelEvidence(log_odds, Facets(*(np.array(column) for column in columns)))


_Row: TypeAlias = tuple[Vectors, Covariances, Vectors, FloatArray]


def _shared(points: ContactPoints, radius: float) -> tuple[float, _Row | None]:
    """Return the log density of points on one unknown plane, line or point over that of outliers, and its estimate.

    The integral over plane, line or point is Laplace's approximation about the least squares fit.
    """
    middle = points.points.mean(axis=0)
    axes = np.linalg.svd((points.points - middle).T @ (points.points - middle))[2]
    free = 3 - points.factors[0].codimension  # directions along what they share come first
    across, along = axes[free:], axes[:free]
    off = (points.points - middle) @ across.T
    if free == 2:
        inward = np.sum(points.inward @ across[0]) > 0  # False as well if the side is unknown
        off = off + (points.radii[:, None] if inward else -points.radii[:, None])
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
    """Return the log integral over a plane, line or point, over the density of outliers; its state and covariance.

    Args:
        points: points on the plane, line or point.
        S: covariances of the points across it ``(n, m, m)`` [m^2].
        J: derivatives of the points by its states, the shared errors last ``(n, m, k)``.
        off: deviations of the points from its first estimate ``(n, m)`` [m].
        radius: radius of the object [m].
    """
    m = off.shape[1]
    states = m * (4 - m)  # of the plane, line or point, before the shared errors
    volume = {1: 2 * radius, 2: np.pi * radius**2, 3: 4 / 3 * np.pi * radius**3}[m]
    turns = {1: 4 * np.pi if points.inward.any() else 2 * np.pi, 2: 2 * np.pi, 3: 1.0}[m]
    W = np.linalg.inv(S)
    H = np.einsum("nai,nab,nbj->ij", J, W, J)
    H += np.diag(np.r_[np.full(m, radius**-2), np.ones(len(H) - m)])
    pull = np.einsum("nai,nab,nb->i", J, W, off)
    best = np.linalg.solve(H, pull)
    chi2 = float(np.einsum("na,nab,nb->", off, W, off) - pull @ best)
    log = -np.log(volume * turns) + 0.5 * states * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1] - 0.5 * chi2
    log += len(points) * (np.log(volume) - 0.5 * m * np.log(2 * np.pi)) - 0.5 * np.linalg.slogdet(S)[1].sum()
    return float(log), best, np.linalg.inv(H)


def _log_together(reach: float, n: int, free: int, radius: float) -> float:
    """Return the log density of points on a face or edge of any possible size, over that anywhere.

    Args:
        reach: largest distance of the points from their middle [m].
        n: number of points.
        free: two for a face, one for an edge, none for a corner.
        radius: radius of the object [m].
    """
    sizes = radius * 0.5 ** np.arange(_SIZES)
    possible = sizes[sizes >= min(reach, radius)]
    anywhere, own = {
        0: (1.0, 1.0 + 0 * possible),
        1: (4 / 3 * radius, 2 * possible),
        2: (2 / 3 * np.pi * radius**2, np.pi * possible**2),
    }[free]
    return float(log_sum((n - 1) * np.log(anywhere / own)) - np.log(_SIZES))
