"""Maximum likelihood planes from points with any covariances; ``math.md`` section 8.

The fit minimizes ``sum (n . q - c)^2 / (n' S n)``, the profile likelihood of the errors-in-variables model. Re-weighted
least squares ignores the derivative of the weights by the plane. Abscissae corrected by ``S n z / s^2`` include it, so
that the fixed point is the exact stationary point.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.errors import DegenerateError, InputError, SideError
from tanteo.features import Feature
from tanteo.features.kinds import PLANE
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

_NARROW = (
    "plane: expected points spread over {least} standard deviations in two directions, got {spread} across {along}; "
    "the tilt about it is free. Add a point further to its side."
)
_ALONG = 0.05
"""A direction with a smaller cosine to the normal lies in the surface and does not determine its outward side."""

_PASSES = 100
_CONVERGED = 1e-20


def plane_ml(points: Vectors, covs: Covariances) -> Estimate:
    """Fit planes to ``(*batch, n, 3)`` points by maximum likelihood; the side of the normal is arbitrary.

    The origin is the weighted centroid and x, y are the principal directions, which makes ``P`` diagonal over
    ``(z, wx, wy)``. ``chi2`` has ``n - 3`` degrees of freedom.

    Args:
        points: measured points ``(*batch, n, 3)`` in the world [m].
        covs: their independent covariances ``(*batch, n, 3, 3)``, positive along every possible normal.

    Raises:
        InputError: for fewer than three points, or shapes that do not fit.
        DegenerateError: if the points of some fit are collinear, coincident or too near each other for their noise.
    """
    points, covs = check_points(points, covs, 3, "plane")

    def linearize(R: FloatArray) -> tuple[FloatArray, FloatArray]:
        local, w, Sa = _local(points, covs, R)
        z = local[..., 2]
        # corrected abscissae: the exact gradient of the profile likelihood
        x, y = (local[..., k] - Sa[..., k] * z * w for k in (0, 1))
        return _tilt_information(local, w), np.stack([np.sum(w * z * y, axis=-1), -np.sum(w * z * x, axis=-1)], axis=-1)

    def moved(R: FloatArray, tilt: FloatArray) -> FloatArray:
        return R @ SO3.exp(np.concatenate([tilt, np.zeros_like(tilt[..., :1])], axis=-1))

    R, steps = maximize(_first_frames(points, covs), linearize, moved, _PASSES, _CONVERGED)
    check_converged(steps, "plane")
    R = R @ _to_principal(points, covs, R)
    return _finish(points, covs, R)


def _first_frames(points: Vectors, covs: Covariances) -> FloatArray:
    """Return frames with z along the direction of least scatter, and refuse points without a plane."""
    total = np.trace(covs, axis1=-2, axis2=-1)
    _refuse_exact(total)
    w = 1 / total
    w = w / w.sum(axis=-1, keepdims=True)
    centred = points - np.sum(w[..., None] * points, axis=-2, keepdims=True)
    scatter = np.swapaxes(centred, -1, -2) @ (w[..., None] * centred)
    values, vectors = np.linalg.eigh(scatter)
    size = np.sqrt(np.maximum(values, 0.0))
    if np.any(size[..., 2] <= 1e-12 + 1e-9 * np.abs(points).max()):
        raise DegenerateError(
            "plane: expected points apart, got coincident ones. Sense two more points away from them."
        )
    if np.any(size[..., 1] <= 1e-6 * size[..., 2]):
        _refuse_collinear(vectors[..., 2], size)
    return SO3.frame_from_axis(vectors[..., 0], 2)


def _refuse_exact(variance: FloatArray) -> None:
    if not np.all(variance > 0):
        raise InputError(
            "plane, covs: expected a positive variance along the normal, got zero or less. Give the noise."
        )


def _refuse_collinear(along: Vectors, size: FloatArray) -> None:
    k = np.unravel_index(np.argmin(size[..., 1]), size.shape[:-1])
    u = along[k]
    raise DegenerateError(
        f"plane: expected points that are not on one line, got all of them along ({u[0]:.3g}, {u[1]:.3g}, {u[2]:.3g}); "
        f"the tilt about that line is free. Add a point beside it, {size[(*k, 2)]:.3g} m or more away."
    )


def _local(points: Vectors, covs: Covariances, R: FloatArray) -> tuple[Vectors, FloatArray, Vectors]:
    """Return points about their weighted centroid in the frame, weights ``1 / n'Sn`` and ``R' S n``."""
    a = R[..., :, 2]
    Sa = (covs @ a[..., None, :, None])[..., 0]
    s2 = np.sum(Sa * a[..., None, :], axis=-1)
    if not np.all(s2 > 0):
        raise InputError(
            "plane, covs: expected a positive variance along the normal, got zero or less. Give the noise."
        )
    w = 1 / s2
    centroid = np.sum(w[..., None] * points, axis=-2) / np.sum(w, axis=-1)[..., None]
    return (points - centroid[..., None, :]) @ R, w, Sa @ R


def _tilt_information(local: Vectors, w: FloatArray) -> FloatArray:
    x, y = local[..., 0], local[..., 1]
    xx, xy, yy = (np.sum(w * a * b, axis=-1) for a, b in ((x, x), (x, y), (y, y)))
    return np.stack([yy, -xy, -xy, xx], axis=-1).reshape(*xx.shape, 2, 2)


def _to_principal(points: Vectors, covs: Covariances, R: FloatArray) -> FloatArray:
    """Turn frames about z so that the weighted scatter is diagonal, longest direction first."""
    local, w, _ = _local(points, covs, R)
    M = _tilt_information(local, w)
    turn = np.zeros((*M.shape[:-2], 3))
    turn[..., 2] = 0.5 * np.arctan2(-2 * M[..., 0, 1], M[..., 1, 1] - M[..., 0, 0])
    return SO3.exp(turn)


def _finish(points: Vectors, covs: Covariances, R: FloatArray) -> Estimate:
    local, w, _ = _local(points, covs, R)
    n = points.shape[-2]
    h = np.stack([-np.ones_like(w), -local[..., 1], local[..., 0]], axis=-1)
    information = np.swapaxes(h, -1, -2) @ (w[..., None] * h)
    refuse_narrow(np.sqrt(np.minimum(information[..., 1, 1], information[..., 2, 2]) / n), R, _NARROW)
    P = inverse_spd(information)
    hP = h @ P
    leftover = np.maximum(1 / w - np.sum(hP * h, axis=-1), 1e-9 / w)
    a = R[..., :, 2]
    shared_jacobian = -hP[..., None] * w[..., None, None] * a[..., None, None, :]
    z = local[..., 2]
    centroid = np.sum(w[..., None] * points, axis=-2) / np.sum(w, axis=-1)[..., None]
    return Estimate(
        SE3.from_parts(R, centroid),
        P,
        np.sum(w * z * z, axis=-1),
        n - 3,
        z[..., None],
        z / np.sqrt(leftover),
        shared_jacobian,
    )


def fit_plane(
    points: Vectors,
    covs: Covariances,
    *,
    outward: Vectors | None = None,
    directions: Vectors | None = None,
    normals: Vectors | None = None,
    radius: float = 0.0,
    label: str = "",
    readings: Sequence[str] = (),
    shared: SharedReadings = (),
) -> tuple[Feature, FitReport]:
    """Fit the plane of sensed points, with z along the outward normal (paper section 3).

    Args:
        points: surface points, or centres of the tip's ball if ``radius`` is given ``(n, 3)`` in the world [m].
        covs: their independent covariances ``(n, 3, 3)`` [m^2].
        outward: vector that points out of the material; one of this, ``directions`` and ``normals`` is needed.
        directions: directions of the beam or of the tip's motion, into the material ``(n, 3)``.
        normals: sensed outward normals ``(n, 3)``.
        radius: radius of the tip's ball [m]; the surface is one radius from the centres, against the outward normal.
        label: name of the feature.
        readings: ids of the readings.
        shared: errors that the points have in common, beyond ``covs``.

    Raises:
        InputError: if the side is unknown, or shapes do not fit; ``SideError`` if it is contradictory.
        DegenerateError: if the points do not determine a plane; the message states which direction is free.
    """
    points, covs = check_points(points, covs, 3, f"plane {label!r}")
    if points.ndim != 2:
        raise InputError(
            f"plane {label!r}, points: expected shape (n, 3), got {points.shape}. Use plane_ml for batches."
        )
    estimate = _facing(plane_ml(points, covs), _outward_side(outward, directions, normals, label), label)
    T = np.array(estimate.T)
    n = T[:3, 2]
    T[:3, 3] -= radius * n
    rows = SE3.adjoint_inverse(T)[list(PLANE.rows)]
    feature = Feature(
        PLANE, T, estimate.P, label, shared_terms(points, estimate, rows, shared), points - radius * n, tuple(readings)
    )
    return feature, make_report(estimate, readings)


def _outward_side(outward: Vectors | None, directions: Vectors | None, normals: Vectors | None, label: str) -> Vectors:
    """Return vectors with a positive component along the outward normal ``(k, 3)``."""
    for side, sign in ((outward, 1.0), (normals, 1.0), (directions, -1.0)):
        if side is not None:
            vectors = sign * np.asarray(side, dtype=np.float64).reshape(-1, 3)
            vectors = vectors[np.isfinite(vectors).all(axis=-1)]
            lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
            if len(vectors) and np.all(lengths > 0):
                return vectors / lengths
    raise InputError(
        f"plane {label!r}: expected to know which side is outside, got neither outward, normals nor directions. "
        "Give the direction of each touch (into the material), the surface normal, or outward=."
    )


def _facing(estimate: Estimate, side: Vectors, label: str) -> Estimate:
    """Return the estimate with its normal on that side."""
    along = side @ estimate.T[:3, 2]
    if np.all(np.abs(along) < _ALONG):
        raise SideError(
            f"plane {label!r}: expected the readings to agree on which side is outside, got directions or normals that "
            "lie in the surface. Check for swapped columns (x, y, z, dx, dy, dz) and for labels of other faces."
        )
    if abs(along.mean()) < 0.05 or np.any(along * np.sign(along.mean()) < -0.2):
        raise SideError(
            f"plane {label!r}: expected the readings to agree on which side is outside, got vectors with components "
            f"{along.min():.2f} to {along.max():.2f} along the fitted normal. Check directions, normals and label."
        )
    if along.mean() > 0:
        return estimate
    # half a turn about x: z and wy change sign, wx does not
    flip = np.array([-1.0, 1.0, -1.0])
    return Estimate(
        estimate.T @ np.diag([1.0, -1.0, -1.0, 1.0]),
        estimate.P * np.outer(flip, flip),
        estimate.chi2,
        estimate.dof,
        -estimate.residuals,
        -estimate.standardised,
        estimate.shared_jacobian * flip[:, None],
    )
