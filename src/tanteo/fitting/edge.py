"""Maximum likelihood edges from points with any covariances; ``math.md`` section 8."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.features import Feature
from tanteo.features.kinds import EDGE
from tanteo.fitting.estimate import (
    Estimate,
    FitReport,
    SharedReadings,
    check_converged,
    check_points,
    inverse_spd,
    make_report,
    shared_terms,
)
from tanteo.fitting.flatness import refuse_narrow
from tanteo.geometry import SE3, SO3, maximize
from tanteo.geometry.typing import Covariances, FloatArray, Vectors

_SHORT = (
    "edge: expected points spread over {least} standard deviations, got {spread}; its direction is free. Add a point "
    "further along {along} or on the other side."
)
_PASSES = 100
_CONVERGED = 1e-20


def edge_ml(points: Vectors, covs: Covariances) -> Estimate:
    """Fit lines to ``(*batch, n, 3)`` points by maximum likelihood, x from the first point towards the last.

    The origin is the weighted centroid; ``P`` is over ``(y, z, wy, wz)`` and ``chi2`` has ``2 n - 4`` degrees of
    freedom. Abscissae corrected by ``S_x_perp S_perp^-1 r`` make the fixed point the exact stationary point.

    Args:
        points: measured points ``(*batch, n, 3)`` in the world [m].
        covs: their independent covariances ``(*batch, n, 3, 3)``, positive definite across the line.

    Raises:
        InputError: for fewer than two points, or shapes that do not fit.
        DegenerateError: if the points of some fit coincide or are too near each other for their noise.
    """
    points, covs = check_points(points, covs, 2, "edge")

    def linearize(frame: tuple[FloatArray, Vectors]) -> tuple[FloatArray, FloatArray]:
        local, W, shift = _local(points, covs, *frame)
        H, Hc = _design(local[..., 0]), _design(local[..., 0] - shift)
        information = np.sum(np.swapaxes(H, -1, -2) @ W @ H, axis=-3)
        return information, -np.sum(np.swapaxes(Hc, -1, -2) @ (W @ local[..., 1:, None]), axis=-3)[..., 0]

    def moved(frame: tuple[FloatArray, Vectors], p: FloatArray) -> tuple[FloatArray, Vectors]:
        turn = np.concatenate([np.zeros_like(p[..., :1]), p[..., 2:]], axis=-1)
        return frame[0] @ SO3.exp(turn), frame[1] + (frame[0][..., :, 1:] @ p[..., :2, None])[..., 0]

    start = SO3.frame_from_axis(_first_directions(points), 0), points.mean(axis=-2)
    (R, c), steps = maximize(start, linearize, moved, _PASSES, _CONVERGED)
    check_converged(steps, "edge")
    c = _to_centroid(points, _local(points, covs, R, c)[1], R, c)
    return _finish(points, covs, R, c)


def _first_directions(points: Vectors) -> Vectors:
    centred = points - points.mean(axis=-2, keepdims=True)
    values, vectors = np.linalg.eigh(np.swapaxes(centred, -1, -2) @ centred)
    if np.any(np.sqrt(np.maximum(values[..., 2], 0)) <= 1e-12 + 1e-9 * np.abs(points).max()):
        raise DegenerateError("edge: expected points apart, got coincident ones. Sense another point along the edge.")
    u = vectors[..., 2]
    along = np.sum(u * (points[..., -1, :] - points[..., 0, :]), axis=-1)
    return np.where(along < 0, -1.0, 1.0)[..., None] * u


def _local(points: Vectors, covs: Covariances, R: FloatArray, c: Vectors) -> tuple[Vectors, FloatArray, FloatArray]:
    """Return points in the frame, inverse lateral covariances, and corrections of the abscissae."""
    local = (points - c[..., None, :]) @ R
    S = np.swapaxes(R, -1, -2)[..., None, :, :] @ covs @ R[..., None, :, :]
    a, b, d = S[..., 1, 1], S[..., 1, 2], S[..., 2, 2]
    det = a * d - b * b
    if not np.all(det > 1e-12 * a * d) or not np.all(a > 0):
        raise InputError("edge, covs: expected positive variances across the edge, got a singular one. Give the noise.")
    W = np.stack([d, -b, -b, a], axis=-1).reshape(*det.shape, 2, 2) / det[..., None, None]
    Wr = (W @ local[..., 1:, None])[..., 0]
    return local, W, np.sum(S[..., 0, 1:] * Wr, axis=-1)


def _design(x: FloatArray) -> FloatArray:
    """Return ``H`` ``(*batch, n, 2, 4)``: derivatives of ``(y, z)`` of a point by ``(dy, dz, wy, wz)`` of the frame."""
    H = np.zeros((*x.shape, 2, 4))
    H[..., 0, 0] = H[..., 1, 1] = -1.0
    H[..., 0, 3], H[..., 1, 2] = -x, x
    return H


def _to_centroid(points: Vectors, W: FloatArray, R: FloatArray, c: Vectors) -> Vectors:
    """Move the origin along the line to the weighted centroid."""
    w = np.trace(W, axis1=-2, axis2=-1)
    u = R[..., :, 0]
    x = np.sum((points - c[..., None, :]) * u[..., None, :], axis=-1)
    return c + (np.sum(w * x, axis=-1) / np.sum(w, axis=-1))[..., None] * u


def _finish(points: Vectors, covs: Covariances, R: FloatArray, c: Vectors) -> Estimate:
    local, W, _ = _local(points, covs, R, c)
    n = points.shape[-2]
    H = _design(local[..., 0])
    HtW = np.swapaxes(H, -1, -2) @ W
    information = np.sum(HtW @ H, axis=-3)
    refuse_narrow(np.sqrt(np.minimum(information[..., 2, 2], information[..., 3, 3]) / n), R, _SHORT)
    P = inverse_spd(information)
    r = local[..., 1:]
    Wr = (W @ r[..., None])[..., 0]
    each = np.sum(r * Wr, axis=-1)
    shared_jacobian = -P[..., None, :, :] @ HtW @ np.swapaxes(R, -1, -2)[..., None, 1:, :]
    freedom = 2 - np.trace(HtW @ H @ P[..., None, :, :], axis1=-2, axis2=-1)
    standardised = np.sqrt(2 * each / np.maximum(freedom, 1e-9))
    return Estimate(SE3.from_parts(R, c), P, np.sum(each, axis=-1), 2 * n - 4, r, standardised, shared_jacobian)


def fit_edge(
    points: Vectors,
    covs: Covariances,
    *,
    label: str = "",
    readings: Sequence[str] = (),
    shared: SharedReadings = (),
) -> tuple[Feature, FitReport]:
    """Fit an edge to sensed points, x along it from the first point to the last (paper section 3).

    Args:
        points: points ``(n, 3)`` in the world [m].
        covs: their independent covariances ``(n, 3, 3)`` [m^2].
        label: name of the feature.
        readings: ids of the readings.
        shared: errors that the points have in common, beyond ``covs``.

    Raises:
        InputError: if shapes do not fit or a covariance is singular across the edge.
        DegenerateError: if the points do not determine a line.
    """
    points, covs = check_points(points, covs, 2, f"edge {label!r}")
    if points.ndim != 2:
        raise InputError(f"edge {label!r}, points: expected shape (n, 3), got {points.shape}. Use edge_ml for batches.")
    estimate = edge_ml(points, covs)
    rows = SE3.adjoint_inverse(estimate.T)[list(EDGE.rows)]
    terms = shared_terms(points, estimate, rows, shared)
    feature = Feature(EDGE, estimate.T, estimate.P, label, terms, points, tuple(readings))
    return feature, make_report(estimate, readings)
