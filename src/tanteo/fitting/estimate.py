"""Results of all fits, and the effect of shared errors on a fitted feature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.features import SharedError, SharedTerm
from tanteo.geometry.special import chi2_survival
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors

SharedReadings = Sequence[tuple[SharedError, FloatArray]]
"""Shared errors with their Jacobians ``(n, 3, d)``: true point = measured point + ``J c``, in the world."""

_RIGID = 1e-9
"""Largest relative misfit of a common motion that still counts as rigid."""


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Fitted frames over batches: ``T = T_mean exp(B' p)``, ``p ~ N(0, P)`` over the rows of the kind.

    Attributes:
        T: frames ``T_world_feature`` ``(*batch, 4, 4)``.
        P: covariances from the independent errors of the points ``(*batch, size, size)``.
        chi2: weighted sum of squares of the residuals ``(*batch,)``.
        dof: its degrees of freedom.
        residuals: residual of each point across the feature ``(*batch, n, k)`` [m].
        standardised: each point's residual in its own standard deviations ``(*batch, n)``.
        shared_jacobian: ``K`` ``(*batch, n, size, 3)``: points off by ``dq`` move the feature by ``p = sum K dq``.
    """

    T: Transforms
    P: Covariances
    chi2: FloatArray
    dof: int
    residuals: FloatArray
    standardised: FloatArray
    shared_jacobian: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class FitReport:
    """Agreement of the points with the fitted feature.

    Attributes:
        chi2: weighted sum of squares.
        dof: degrees of freedom of ``chi2``; 0 without redundant points.
        p_value: probability of a larger ``chi2`` if the model is right; 1 without degrees of freedom.
        rms: root mean square distance of the points from the feature [m].
        worst: id (or number from 1) of the reading that agrees least.
        worst_sds: its residual in standard deviations.
        p_worst: largest probability that the worst reading is farther off if all are right.
    """

    chi2: float
    dof: int
    p_value: float
    rms: float
    worst: str
    worst_sds: float
    p_worst: float


def make_report(estimate: Estimate, readings: Sequence[str]) -> FitReport:
    """Return the report of one fit, without batch axes, with the ids of its readings."""
    chi2, dof = float(estimate.chi2), estimate.dof
    k = int(np.argmax(np.abs(estimate.standardised)))
    return FitReport(
        chi2,
        dof,
        chi2_survival(chi2, dof) if dof else 1.0,
        float(np.sqrt(np.mean(np.sum(estimate.residuals**2, axis=-1)))),
        readings[k] if readings else str(k + 1),
        float(np.abs(estimate.standardised[k])),
        p_of_worst(estimate.standardised, estimate.residuals.shape[-1]) if dof else 1.0,
    )


def p_of_worst(standardised: FloatArray, size: int) -> float:
    """Return Bonferroni's bound of the p-value of the largest of several residuals.

    A fit reduces every residual, so the residuals are smaller than the bound assumes.
    """
    return min(len(standardised) * chi2_survival(float(np.max(np.abs(standardised)) ** 2), size), 1.0)


def check_points(points: Vectors, covs: Covariances, least: int, what: str) -> tuple[Vectors, Covariances]:
    """Return points ``(*batch, n, 3)`` and covariances ``(*batch, n, 3, 3)`` as float64 arrays of equal shape.

    Raises:
        InputError: for other shapes, numbers that are not finite, or fewer than ``least`` points.
    """
    points, covs = np.asarray(points, dtype=np.float64), np.asarray(covs, dtype=np.float64)
    if points.ndim < 2 or points.shape[-1] != 3:
        raise InputError(f"{what}, points: expected shape (n, 3), got {points.shape}.")
    if covs.ndim < 2 or covs.shape[-2:] != (3, 3):
        raise InputError(f"{what}, covs: expected shape (n, 3, 3), got {covs.shape}.")
    if points.shape[-2] < least:
        raise InputError(f"{what}: expected at least {least} points, got {points.shape[-2]}. Sense more of them.")
    if not (np.isfinite(points).all() and np.isfinite(covs).all()):
        raise InputError(f"{what}: expected finite points and covariances, got some that are not.")
    return points, np.broadcast_to(covs, (*points.shape, 3))


def check_converged(steps: FloatArray, what: str) -> None:
    """Refuse a fit that has not converged.

    Args:
        steps: squared length of the last step of each fit, in standard deviations ``(*batch,)``.
        what: name of the feature in the message.

    Raises:
        DegenerateError: a step is 1e-10 or more.
    """
    if not np.all(steps < 1e-10):
        raise DegenerateError(
            f"{what}: expected points that determine it, got a fit that does not converge: the noise is as large as "
            "the spread of the points. Add points further apart, or check the covariances."
        )


def inverse_spd(A: FloatArray) -> FloatArray:
    """Return symmetric inverses of positive definite matrices of mixed units, scaled to unit diagonal first."""
    d = 1 / np.sqrt(np.diagonal(A, axis1=-2, axis2=-1))
    scale = d[..., :, None] * d[..., None, :]
    inverse = np.asarray(np.linalg.inv(A * scale), dtype=np.float64) * scale
    return 0.5 * (inverse + np.swapaxes(inverse, -1, -2))


def rigid_motion(rows: FloatArray, moved: FloatArray) -> FloatArray | None:
    """Return the rigid motions ``M`` ``(6, d)`` of the world with ``rows @ M = moved``; None if there are none.

    Args:
        rows: derivatives of the quantities by a left error ``[v, w]`` of the world ``(m, 6)``.
        moved: derivatives of the quantities by the shared error ``(m, d)``.
    """
    scale = np.abs(moved).max(initial=0.0)
    if scale == 0:
        return np.zeros((6, moved.shape[1]))
    arms = np.abs(rows).max(axis=0)
    unit = rows / np.where(arms > 0, arms, 1.0)
    M = np.linalg.lstsq(unit, moved, rcond=1e-13)[0] / np.where(arms > 0, arms, 1.0)[:, None]
    return M if np.abs(rows @ M - moved).max() <= _RIGID * scale else None


def shared_terms(
    points: Vectors, estimate: Estimate, rows_of_feature: FloatArray, shared: SharedReadings
) -> tuple[SharedTerm, ...]:
    """Return the effect of shared errors on one fitted feature (``math.md`` section 6).

    An error that moves all readings like one rigid body moves the feature with them. Its gain is exactly ``B
    Ad(T^-1)``, so constraints between such features are independent of it. Other errors have the gain of the estimator.

    Args:
        points: measured points ``(n, 3)``.
        estimate: the fit.
        rows_of_feature: ``B Ad(T^-1)`` ``(size, 6)``.
        shared: errors and Jacobians.
    """
    terms = []
    for error, jacobian in shared:
        M = rigid_error(points, error, jacobian)
        moved = rows_of_feature @ M if M is not None else np.sum(estimate.shared_jacobian @ jacobian, axis=0)
        terms.append(SharedTerm(error, moved))
    return tuple(terms)


def rigid_error(points: Vectors, error: SharedError, jacobian: FloatArray) -> FloatArray | None:
    """Return a shared error as rigid motions of the world ``(6, d)`` of all points; None if it is not rigid.

    Raises:
        InputError: for a Jacobian of another shape than ``(n, 3, d)``.
    """
    n, d, J = len(points), len(error.covariance), np.asarray(jacobian, dtype=np.float64)
    if J.shape != (n, 3, d):
        raise InputError(
            f"shared error {error.name!r}: expected a Jacobian of shape {(n, 3, d)}, got {J.shape}. "
            "Give one 3 x d block for each point."
        )
    world = np.zeros((n, 3, 6))
    world[..., :3] = np.eye(3)
    x, y, z = points.T
    world[:, 0, 4], world[:, 0, 5] = z, -y
    world[:, 1, 3], world[:, 1, 5] = -z, x
    world[:, 2, 3], world[:, 2, 4] = y, -x
    return rigid_motion(world.reshape(3 * n, 6), J.reshape(3 * n, d))
