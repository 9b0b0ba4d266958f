"""Tests whether all points of a feature agree with it, and whether those of a plane bend.

The joint test of a feature has as many degrees of freedom as points. It hardly detects a surface that bends a little,
or a step between two rows of points. A separate test does: does a surface of the second degree fit better than its
three further parameters explain?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.features import Feature, chi2_p_value, whitened_test
from tanteo.fitting.estimate import FitReport, SharedReadings, p_of_worst
from tanteo.fitting.round_estimate import round_distances
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Vectors

_LEAST_CURVATURE = 1e-3
"""Least fraction of a curvature that no plane explains; below it, noise of the abscissae decides the value."""


@dataclass(frozen=True, slots=True, eq=False)
class Bending:
    """Improvement of a surface of the second degree over a plane.

    Attributes:
        gain: decrease of the weighted sum of squares.
        dof: number of further parameters that the points determine.
        p_value: probability of a larger gain if the surface is a plane; 1 without further parameters.
    """

    gain: float
    dof: int
    p_value: float


def jointly(
    report: FitReport,
    feature: Feature,
    points: Vectors,
    covs: Covariances,
    shared: SharedReadings,
    readings: Sequence[str],
    radius: float = 0.0,
) -> FitReport:
    """Return the report with joint tests of all points and of the worst one, shared errors included.

    A shared error that is not one rigid motion of the points, such as a tip on a hand that turns between touches, makes
    the points scatter, although no reading is wrong.
    """
    if not shared:
        return report
    across = residuals_of(feature, points, radius)
    g, G = _rows(across, covs, shared)
    test = whitened_test(g, G)
    size = across.f.shape[1]
    left = np.linalg.norm((g + G @ test.xi)[: size * len(points)].reshape(-1, size), axis=1)
    worst = int(np.argmax(left))
    return replace(
        report,
        chi2=test.D2,
        dof=test.dof,
        p_value=test.p_value,
        worst=readings[worst],
        worst_sds=float(left[worst]),
        p_worst=p_of_worst(left, size) if test.dof else 1.0,
    )


def bending(plane: Feature, points: Vectors, covs: Covariances, shared: SharedReadings, radius: float = 0.0) -> Bending:
    """Return the improvement of a surface of the second degree over the plane of points.

    Args:
        plane: the fitted plane.
        points: its points, centres of the ball if ``radius`` is given ``(n, 3)`` in the world [m].
        covs: their independent covariances ``(n, 3, 3)`` [m^2].
        shared: errors that the points share, with their Jacobians.
        radius: radius of the tip's ball [m].
    """
    g, G = _rows(residuals_of(plane, points, radius), covs, shared)
    x, y = SE3.apply(SE3.inverse(plane.T_world_feature), points)[:, :2].T
    second = np.zeros((len(g), 3))
    second[: len(points)] = np.stack([x * x, x * y, y * y], axis=1) / _sds(plane, covs)[:, None]
    whole = np.linalg.norm(second, axis=0)
    second /= np.where(whole > 0, whole, 1.0)
    G = G / np.maximum(np.linalg.norm(G, axis=0), 1e-300)
    both = np.column_stack([g, second])
    left = both - G @ np.linalg.lstsq(G, both, rcond=1e-10)[0]  # residuals after the best plane
    U, s, _ = np.linalg.svd(left[:, 1:], full_matrices=False)
    U = U[:, s > _LEAST_CURVATURE]
    gain, dof = float(np.sum((U.T @ left[:, 0]) ** 2)), U.shape[1]
    return Bending(gain, dof, float(chi2_p_value(np.asarray(gain), dof)) if dof else 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """Distances of points from a feature, ``k`` numbers for each point.

    Attributes:
        f: distances across the feature, without the tip's ball ``(n, k)`` [m].
        G: derivatives by the points in the world ``(n, k, 3)``.
        H: derivatives by the feature's perturbation, and by its size if that was fitted ``(n, k, m)``.
    """

    f: FloatArray
    G: FloatArray
    H: FloatArray


def residuals_of(feature: Feature, points: Vectors, radius: float = 0.0) -> Residuals:
    """Return distances of points ``(n, 3)`` [m] from a feature, less the ``radius`` of the tip's ball."""
    R = feature.T_world_feature[:3, :3]
    local = SE3.apply(SE3.inverse(feature.T_world_feature), points)
    if feature.size is not None:
        found = round_distances(feature.kind, local, feature.size.value)
        side = {True: 1.0, False: -1.0, None: 0.0}[feature.convex]
        turn = SO3.cross(np.broadcast_to(local[:, None], found.G.shape), found.G)
        H = -np.concatenate([found.G, turn], axis=-1)[..., list(feature.kind.rows)]
        fitted = feature.size.variance > 0
        H = np.concatenate([H, found.by_size[..., None]], axis=-1) if fitted else H
        return Residuals(found.F - side * radius, found.G @ R.T, H)
    across = [i for i in feature.kind.rows if i < 3]
    move = np.concatenate([np.broadcast_to(-np.eye(3), (len(points), 3, 3)), SO3.hat(local)], axis=-1)
    G = np.broadcast_to(R.T[across], (len(points), len(across), 3))
    return Residuals(local[:, across] - radius, G, move[:, across] @ feature.kind.B.T)


def _rows(across: Residuals, covs: Covariances, shared: SharedReadings) -> tuple[FloatArray, FloatArray]:
    """Return whitened residuals across the feature and derivatives by its perturbation and the shared errors.

    The last rows are the prior on the shared errors, which the points alone do not constrain.
    """
    f, G = across.f, across.G
    gains = [G @ J @ _root(error.covariance) for error, J in shared]
    H = np.concatenate([across.H, *gains], axis=-1)
    L = np.linalg.cholesky(G @ covs @ np.swapaxes(G, -1, -2))
    white = np.linalg.solve(L, np.concatenate([f[..., None], H], axis=-1)).reshape(f.size, -1)
    own, count = across.H.shape[-1], white.shape[1] - 1
    stated = np.eye(count)[own:]
    return np.r_[white[:, 0], np.zeros(count - own)], np.concatenate([white[:, 1:], stated])


def _sds(plane: Feature, covs: Covariances) -> FloatArray:
    n = plane.T_world_feature[:3, 2]
    return np.sqrt(np.einsum("i,nij,j->n", n, covs, n))


def _root(C: Covariances) -> FloatArray:
    """Return a root of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(C)
    return vectors * np.sqrt(np.maximum(values, 0.0))
