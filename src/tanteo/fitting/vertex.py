"""Vertices from points, and from the edges that meet in them; ``math.md`` sections 4.2 and 8."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.features import Feature, SharedTerm, collect_shared, relate_all
from tanteo.features.kinds import VERTEX
from tanteo.fitting.estimate import (
    Estimate,
    FitReport,
    SharedReadings,
    check_points,
    inverse_spd,
    make_report,
    rigid_motion,
    shared_terms,
)
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors

_PASSES = 200
_CONVERGED = 1e-13


def vertex_ml(points: Vectors, covs: Covariances) -> Estimate:
    """Return weighted means of ``(*batch, n, 3)`` points; ``chi2`` has ``3 n - 3`` degrees of freedom.

    Raises:
        InputError: without points, or if a covariance is not positive definite.
    """
    points, covs = check_points(points, covs, 1, "vertex")
    try:
        np.linalg.cholesky(covs)
    except np.linalg.LinAlgError:
        raise InputError("vertex, covs: expected positive definite covariances, got a singular one.") from None
    W = np.linalg.inv(covs)
    P = inverse_spd(W.sum(axis=-3))
    first = points[..., :1, :]
    X = first[..., 0, :] + (P @ np.sum(W @ (points - first)[..., None], axis=-3))[..., 0]
    r = points - X[..., None, :]
    each = np.sum(r * (W @ r[..., None])[..., 0], axis=-1)
    shared_jacobian = P[..., None, :, :] @ W
    freedom = 3 - np.trace(shared_jacobian, axis1=-2, axis2=-1)
    standardised = np.sqrt(3 * each / np.maximum(freedom, 1e-9))
    T = SE3.from_parts(np.broadcast_to(np.eye(3), (*X.shape, 3)), X)
    return Estimate(T, P, np.sum(each, axis=-1), 3 * points.shape[-2] - 3, r, standardised, shared_jacobian)


def fit_vertex(
    points: Vectors,
    covs: Covariances,
    *,
    label: str = "",
    readings: Sequence[str] = (),
    shared: SharedReadings = (),
) -> tuple[Feature, FitReport]:
    """Fit a vertex to points sensed on it; one point is enough.

    Args:
        points: points ``(n, 3)`` in the world [m].
        covs: their independent covariances ``(n, 3, 3)`` [m^2].
        label: name of the feature.
        readings: ids of the readings.
        shared: errors that the points have in common, beyond ``covs``.

    Raises:
        InputError: for other shapes, or covariances that are not positive definite.
    """
    points, covs = check_points(points, covs, 1, f"vertex {label!r}")
    if points.ndim != 2:
        raise InputError(f"vertex {label!r}, points: expected shape (n, 3), got {points.shape}. Use vertex_ml.")
    estimate = vertex_ml(points, covs)
    rows = SE3.adjoint_inverse(estimate.T)[list(VERTEX.rows)]
    terms = shared_terms(points, estimate, rows, shared)
    return Feature(VERTEX, estimate.T, estimate.P, label, terms, points, tuple(readings)), make_report(
        estimate, readings
    )


@dataclass(frozen=True, slots=True, eq=False)
class Corner:
    """Common points of lines, over batches.

    Attributes:
        X: points ``(*batch, 3)`` [m].
        P: covariances ``(*batch, 3, 3)``.
        chi2: squared distances between the lines ``(*batch,)``; ``2 k - 3`` degrees of freedom for ``k`` lines.
        shared_jacobian: derivatives of the point by each line's four perturbations ``(*batch, k, 3, 4)``.
    """

    X: Vectors
    P: Covariances
    chi2: FloatArray
    shared_jacobian: FloatArray


def intersect_lines(T: Transforms, P: Covariances) -> Corner:
    """Return the maximum likelihood common point of ``k`` lines, weighted by lateral covariances there.

    Args:
        T: frames of the edges ``(*batch, k, 4, 4)``.
        P: covariances over ``(y, z, wy, wz)`` ``(*batch, k, 4, 4)``.

    Raises:
        DegenerateError: if all lines of a set are parallel.
    """
    E = np.swapaxes(T[..., :3, 1:3], -1, -2)
    c, u = T[..., :3, 3], T[..., :3, 0]
    middle = c.mean(axis=-2)
    offset = (E @ (c - middle[..., None, :])[..., None])[..., 0]
    if np.any(np.linalg.svd(np.sum(np.swapaxes(E, -1, -2) @ E, axis=-3))[1][..., 2] < 1e-12):
        raise DegenerateError(
            "vertex from edges: expected edges that are not all parallel, got parallel ones. Sense another edge."
        )
    x = np.zeros_like(middle)
    for _ in range(_PASSES):
        s = np.sum((x[..., None, :] + middle[..., None, :] - c) * u, axis=-1)
        L = _lateral(s)
        W = np.linalg.inv(L @ P @ np.swapaxes(L, -1, -2))
        EtW = np.swapaxes(E, -1, -2) @ W
        information = np.sum(EtW @ E, axis=-3)
        new = np.linalg.solve(information, np.sum(EtW @ offset[..., None], axis=-3))[..., 0]
        step, x = np.abs(new - x).max(initial=0.0), new
        if step <= _CONVERGED * np.abs(offset).max(initial=0.0):
            break
    cov = inverse_spd(information)
    r = (E @ x[..., None, :, None])[..., 0] - offset
    chi2 = np.sum(r * (W @ r[..., None])[..., 0], axis=(-1, -2))
    return Corner(x + middle, cov, chi2, cov[..., None, :, :] @ EtW @ L)


def _lateral(s: FloatArray) -> FloatArray:
    """Return the ``(y, z)`` displacement of a line at abscissa ``s`` by its perturbations ``(*batch, 2, 4)``."""
    L = np.zeros((*s.shape, 2, 4))
    L[..., 0, 0] = L[..., 1, 1] = 1.0
    L[..., 0, 3], L[..., 1, 2] = s, -s
    return L


def intersect_edges(features: Sequence[Feature], label: str = "") -> tuple[Feature, FitReport]:
    """Return the vertex in which sensed edges meet (paper section 3).

    The vertex inherits shared errors of the edges. The report's ``worst`` names the edge farthest from the point.

    Raises:
        InputError: for fewer than two edges or another kind of feature.
        DegenerateError: if no two of the edges make an angle of ten standard deviations or more.
    """
    if len(features) < 2 or any(feature.kind.name != "edge" for feature in features):
        got = ", ".join(feature.kind.name for feature in features) or "nothing"
        raise InputError(f"vertex {label!r}: expected two or more edges, got {got}.")
    if not relate_all(features).column("edge_gap").present.any():
        raise DegenerateError(
            f"vertex {label!r}: expected edges that are not parallel within 10 sigma, got "
            f"{', '.join(repr(f.label) for f in features)}. Sense an edge in another direction."
        )
    T = np.stack([feature.T_world_feature for feature in features])
    P = np.stack([feature.P for feature in features])
    corner = intersect_lines(T, P)
    T_world_vertex = np.eye(4)
    T_world_vertex[:3, 3] = corner.X
    local = SE3.apply(SE3.inverse(T), corner.X)
    L = _lateral(local[:, 0])
    r = local[:, 1:]
    each = np.sqrt(np.sum(r * np.linalg.solve(L @ P @ np.swapaxes(L, 1, 2), r[..., None])[..., 0], axis=-1))
    estimate = Estimate(T_world_vertex, corner.P, corner.chi2, 2 * len(features) - 3, r, each, corner.shared_jacobian)
    rows = SE3.adjoint_inverse(T_world_vertex)[list(VERTEX.rows)]
    terms = inherit(features, list(corner.shared_jacobian), rows)
    readings = tuple(r for feature in features for r in feature.readings)
    vertex = Feature(VERTEX, T_world_vertex, corner.P, label, terms, corner.X[None], readings)
    return vertex, make_report(estimate, [feature.label for feature in features])


def inherit(
    features: Sequence[Feature], shared_jacobian: Sequence[FloatArray], rows: FloatArray
) -> tuple[SharedTerm, ...]:
    """Return shared terms of a feature from others by given gains; exact for rigid errors (``math.md`` section 6)."""
    errors, _, parts = collect_shared(features)
    world = np.concatenate([SE3.adjoint_inverse(f.T_world_feature)[list(f.kind.rows)] for f in features])
    terms, start = [], 0
    for error in errors:
        block = slice(start, start + len(error.covariance))
        start = block.stop
        M = rigid_motion(world, np.concatenate(parts)[:, block])
        own = sum((K @ A[:, block] for K, A in zip(shared_jacobian, parts, strict=True)), np.zeros((len(rows), 1)))
        terms.append(SharedTerm(error, rows @ M if M is not None else own))
    return tuple(terms)
