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
from tanteo.posterior.touched_region import LARGER

_COUNT = 6
"""Number of points of a label that count (decision 62). A made face deviates equally for all of them, so more points
carry no more information on whether the face is the part's."""

SMALLEST = 1 / 32
"""Shortest side of a face, and shortest edge, over the diameter of the object; sides are log-uniform above it."""

ANGLES = 16
"""Numerical: number of angles of the sides of a face over a quarter of a turn."""


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
        log_designs: log density of the points of each label on a surface of their own, over that of outliers, if their
            places are even over it, and if they are even over a patch of it that was chosen ``(2, G)``.
        facets: surfaces that the measurements show.
    """

    log_designs: FloatArray
    facets: Facets

    @property
    def log_odds(self) -> FloatArray:
        """Return the log densities of the labels, each with the mean over the two designs ``(G,)``."""
        return np.asarray(log_sum(self.log_designs, axis=0) - np.log(2))


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


def label_evidence(points: ContactPoints, groups: IntArray, radius: float, patches: FloatArray) -> LabelEvidence:
    """Return the densities of labelled points on an unknown object.

    Args:
        points: the measurements.
        groups: labels as :func:`groups_of` numbers them.
        radius: radius of the ball that contains the object [m].
        patches: area or length of the patch that the points of each label cover ``(G,)`` [m^2 or m].
    """
    alone = np.flatnonzero(points.oriented & (groups < 0) & ~points.centres)
    n, sd = points.normals[alone], points.normal_sds[alone]
    at = points.points[alone] - points.radii[alone, None] * n
    variances = np.einsum("ni,nij,nj->n", n, points.covs[alone], n)
    rows = list(zip(n, sd[:, None, None] ** 2 * np.eye(3), at, variances, strict=True))
    log_designs = np.zeros((2, len(patches)))
    for g, patch in enumerate(patches):
        own = points.take(np.flatnonzero(groups == g))
        free = 3 - own.factors[0].codimension
        if own.factors[0].round_face:  # a wall may bend in any way
            continue
        if len(own) <= free:  # two points fix the direction of an edge, but no face
            continue
        log, facet = _shared(own, radius, float(patch))
        log_designs[:, g] = log_even(log * min(1.0, _COUNT / len(own)))
        if facet is not None and log.max() > 0:
            rows.append(facet)
    columns = (
        zip(*rows, strict=True) if rows else (np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros(0))
    )
    return LabelEvidence(log_designs, Facets(*(np.array(column) for column in columns)))


_Row: TypeAlias = tuple[Vectors, Covariances, Vectors, FloatArray]


def _shared(points: ContactPoints, radius: float, patch: float) -> tuple[FloatArray, _Row | None]:
    """Return the log densities of points on one unknown plane, line or point over that of outliers, and its estimate.

    There is one for each design of the places ``(2,)``. The integral over plane, line or point is Laplace's
    approximation about the least squares fit.
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
    surface, best, C = _integral(points, across @ points.covs @ across.T, J, off, radius)
    log = np.full(2, surface)
    if not points.directed.any() and free:
        anywhere = {1: 4 / 3 * radius, 2: 2 / 3 * np.pi * radius**2}[free]
        log += [_log_together(lever, radius, anywhere), (len(points) - 1) * np.log(anywhere / patch)]
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


def _log_together(places: FloatArray, radius: float, anywhere: float) -> float:
    """Return the log density of points on a rectangular face or an edge of any possible size, over that anywhere.

    The rectangle has any place and angle. Its sides are independent, and even up to the diameter of the object: larger
    faces are touched more often. The points are even on it.

    Args:
        places: places of the points in the plane, or along the edge ``(n, free)`` [m].
        radius: radius of the object [m].
        anywhere: mean area or length of sections of the object [m^2 or m].
    """
    n, free = places.shape
    angles = np.arange(ANGLES) * np.pi / (2 * ANGLES) if free == 2 else np.zeros(1)
    axes = np.stack([np.cos(angles), np.sin(angles), -np.sin(angles), np.cos(angles)], axis=1).reshape(-1, 2, 2)
    along = places @ axes[:, :free, :free]  # (angles, n, free)
    log = _log_interval(along.max(axis=1) - along.min(axis=1), n, 2 * radius).sum(axis=1)
    return float((n - 1) * np.log(anywhere) + log_sum(log) - np.log(len(log)))


def _log_interval(extents: FloatArray, n: int, longest: float) -> FloatArray:
    """Return the log density of two or more even points on an interval of even length, times the range of its middle.

    With the points of extent ``s`` on an interval of length ``a`` the middle is in a range of ``a - s``, so that the
    density is the mean of ``(a - s) / a^n`` over the lengths.

    Args:
        extents: extents of the points ``(*batch)`` [m].
        n: number of points.
        longest: longest interval, unless the points need more [m].
    """
    shortest = SMALLEST * longest
    low, high = np.maximum(extents, shortest), np.maximum(longest, LARGER * extents)
    log_ratio = np.log(low / high)
    first = -log_ratio if n == 2 else -np.expm1((n - 2) * log_ratio) / (n - 2)
    second = -np.expm1((n - 1) * log_ratio) / (n - 1)
    return np.asarray((2 - n) * np.log(low) + np.log(first - extents / low * second) - np.log(high - shortest))
