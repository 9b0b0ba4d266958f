"""Check covariances, and make read-only copies for immutable values."""

from __future__ import annotations

import numpy as np

from tanteo.errors import CovarianceError
from tanteo.geometry.typing import Covariances, FloatArray

_ASYMMETRY = 1e-8
"""Largest accepted difference from the transpose, relative to the largest entry."""
_NEGATIVE = 1e-9
"""Fraction of the variances by which a covariance may fail to be positive semidefinite."""
_ROUNDING = 1e-13
"""Fraction of the largest entry that counts as a rounding error of zero."""


def frozen_array(value: FloatArray) -> FloatArray:
    """Return a read-only float64 copy.

    Args:
        value: array to copy.
    """
    out = np.array(value, dtype=np.float64)
    out.setflags(write=False)
    return out


def freeze(value: object, *names: str) -> None:
    """Replace the named arrays of a frozen value by read-only float64 copies.

    Args:
        value: frozen data class.
        names: names of its arrays.
    """
    for name in names:
        object.__setattr__(value, name, frozen_array(getattr(value, name)))


def check_covariance(name: str, C: Covariances, size: int) -> Covariances:
    """Return a read-only, symmetrized copy of one covariance ``(size, size)``.

    Args:
        name: name of the covariance, for messages.
        C: covariance.
        size: number of rows.

    Raises:
        CovarianceError: the matrix has another shape, is not finite, not symmetric or not positive semidefinite.
    """
    if np.shape(C) != (size, size):
        raise CovarianceError(f"{name}: expected a {size} x {size} matrix, got shape {np.shape(C)}.")
    return check_covariances(name, C, size)


def check_covariances(name: str, C: Covariances, size: int) -> Covariances:
    """Return a read-only, symmetrized copy of covariances ``(*batch, size, size)``.

    Variances may differ by any factor (metres and radians), so each matrix is scaled to a unit diagonal for the test.
    Negative variances within rounding are set to zero.

    Args:
        name: name of the covariances, for messages.
        C: covariances.
        size: number of rows.

    Raises:
        CovarianceError: a matrix has another shape, is not finite, not symmetric or not positive semidefinite.
    """
    C = np.array(C, dtype=np.float64)
    if C.ndim < 2 or C.shape[-2:] != (size, size):
        raise CovarianceError(f"{name}: expected {size} x {size} matrices, got shape {C.shape}.")
    finite = np.isfinite(C)
    if not np.all(finite):
        raise CovarianceError(f"{name}: expected finite numbers, got {C[~finite][0]}. Check the sensor's model.")
    largest = np.abs(C).max(axis=(-1, -2), initial=0.0, keepdims=True)
    if np.any(np.abs(C - np.swapaxes(C, -1, -2)) > _ASYMMETRY * largest):
        raise CovarianceError(f"{name}: expected a symmetric matrix, got one that differs from its transpose.")
    C = symmetrised(C)
    if not _is_semidefinite(C, largest[..., 0]):
        raise CovarianceError(f"{name}: expected a positive semidefinite matrix, got a negative variance in it.")
    diagonal = np.arange(size)
    C[..., diagonal, diagonal] = np.maximum(C[..., diagonal, diagonal], 0.0)
    C.setflags(write=False)
    return C


def symmetrised(C: Covariances) -> Covariances:
    """Return half the sum of ``C`` and its transpose.

    Args:
        C: matrices ``(*batch, n, n)``.
    """
    return 0.5 * (C + np.swapaxes(C, -1, -2))


def unit_diagonal(C: Covariances) -> tuple[FloatArray, FloatArray]:
    """Return ``C`` scaled to a unit diagonal, and the standard deviations ``d`` with ``C = unit d d'``.

    Zeros stay zero.

    The scaling makes metres and radians comparable for eigenvalues, inverses and ranks.

    Args:
        C: covariances ``(*batch, n, n)``.
    """
    d = np.sqrt(np.maximum(np.diagonal(C, axis1=-2, axis2=-1), 0.0))
    scale = np.where(d > 0, d, 1.0)
    return C / (scale[..., :, None] * scale[..., None, :]), d


def _is_semidefinite(C: Covariances, largest: FloatArray) -> bool:
    """Return whether ``C``, scaled and with its variances increased by the tolerances, has a Cholesky factor."""
    variances = np.diagonal(C, axis1=-2, axis2=-1)
    raised = (1 + _NEGATIVE) * variances + _ROUNDING * largest
    if np.any(raised < 0):
        return False
    d = np.sqrt(np.where(raised > 0, raised, 1.0))  # zero matrices become the identity below
    unit = C / (d[..., :, None] * d[..., None, :])
    diagonal = np.arange(C.shape[-1])
    unit[..., diagonal, diagonal] = 1.0
    try:
        np.linalg.cholesky(unit)
    except np.linalg.LinAlgError:
        return False
    return True
