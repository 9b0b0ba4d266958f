"""What every covariance is checked for, and the read-only copies that the frozen values keep."""

from __future__ import annotations

import numpy as np

from tanteo.errors import CovarianceError
from tanteo.typing import Covariances, FloatArray

_ASYMMETRY = 1e-8
_NEGATIVE = -1e-9


def frozen_array(value: FloatArray) -> FloatArray:
    """A read-only float64 copy."""
    out = np.array(value, dtype=np.float64)
    out.setflags(write=False)
    return out


def check_covariance(name: str, C: Covariances, size: int) -> Covariances:
    """A read-only, symmetrised copy of one covariance ``(size, size)``.

    Raises:
        CovarianceError: if it has another shape, is not finite, not symmetric or not positive semidefinite.
    """
    if np.shape(C) != (size, size):
        raise CovarianceError(f"{name}: expected a {size} x {size} matrix, got shape {np.shape(C)}.")
    return check_covariances(name, C, size)


def check_covariances(name: str, C: Covariances, size: int) -> Covariances:
    """A read-only, symmetrised copy of covariances ``(*batch, size, size)``.

    Variances may differ by any factor (metres beside radians): each matrix is judged after scaling to a unit
    diagonal.

    Raises:
        CovarianceError: if one has another shape, is not finite, not symmetric or not positive semidefinite.
    """
    C = np.array(C, dtype=np.float64)
    if C.ndim < 2 or C.shape[-2:] != (size, size):
        raise CovarianceError(f"{name}: expected {size} x {size} matrices, got shape {C.shape}.")
    finite = np.isfinite(C)
    if not np.all(finite):
        raise CovarianceError(f"{name}: expected finite numbers, got {C[~finite][0]}. Check the sensor's model.")
    Ct = np.swapaxes(C, -1, -2)
    scale = np.abs(C).max(axis=(-1, -2), initial=0.0, keepdims=True)
    if np.any(np.abs(C - Ct) > _ASYMMETRY * scale):
        raise CovarianceError(f"{name}: expected a symmetric matrix, got one that differs from its transpose.")
    C = 0.5 * (C + Ct)
    variances = np.diagonal(C, axis1=-2, axis2=-1)
    d = np.sqrt(np.maximum(variances, 0.0))
    product = d[..., :, None] * d[..., None, :]
    unit = C / np.where(product > 0, product, 1.0)
    if np.any(variances < 0) or (unit.size and np.linalg.eigvalsh(unit).min() < _NEGATIVE):
        raise CovarianceError(f"{name}: expected a positive semidefinite matrix, got a negative variance in it.")
    C.setflags(write=False)
    return C
