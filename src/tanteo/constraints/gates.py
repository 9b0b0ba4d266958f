"""Accept or reject: (25) and the joint tests that it needs beside it; ``math.md`` sections 4.7 and 9."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.typing import BoolArray, Covariances, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Gate:
    """Outcome of a test at one level.

    Attributes:
        D2: squared Mahalanobis distances ``(*batch,)``.
        D_M: the largest accepted Mahalanobis distance, (25).
        accept: ``D2 <= D_M^2``.
    """

    D2: FloatArray
    D_M: float
    accept: BoolArray


def _level(significance: float) -> float:
    if not 0 < significance < 1:
        raise InputError(
            f"significance: expected a rejection rate between 0 and 1, got {significance}. Give for example 0.05."
        )
    return float(significance)


def chi2_limit(significance: float, dof: int = 1) -> float:
    """What chi-square with ``dof`` degrees of freedom exceeds with probability ``significance``: ``D_M^2``."""
    if dof < 1:
        raise InputError(f"dof: expected at least 1, got {dof}.")
    from scipy import special  # slow to import

    return float(special.chdtri(dof, _level(significance)))


def chi2_p_value(D2: FloatArray, dof: int | FloatArray) -> FloatArray:
    """Probability that chi-square with ``dof`` degrees of freedom exceeds ``D2``."""
    from scipy import special  # slow to import

    return np.asarray(special.chdtrc(dof, np.asarray(D2, dtype=np.float64)), dtype=np.float64)


def sidak(significance: float, tests: int) -> float:
    """Level of each of ``tests`` independent one-shot tests so that together they reject ``significance``."""
    if tests < 1:
        raise InputError(f"tests: expected at least 1, got {tests}.")
    return float(-np.expm1(np.log1p(-_level(significance)) / tests))


def chi2_statistic(value: FloatArray, covariance: Covariances) -> FloatArray:
    """``value' S^-1 value`` for ``(*batch, m)`` values; by Cholesky, scaled, so that m and rad may mix."""
    sd = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    unit = covariance / (sd[..., :, None] * sd[..., None, :])
    white = np.linalg.solve(np.linalg.cholesky(unit), (value / sd)[..., None])[..., 0]
    return np.sum(white * white, axis=-1)


def gate(
    value: FloatArray | float, variance: FloatArray | float, model: FloatArray | float, significance: float
) -> Gate:
    """The paper's test (25) of one number: accept ``|c_model - c| <= sqrt(Var c) D_M``.

    Args:
        value: sensed values; broadcasts against ``model``.
        variance: theirs.
        model: the values in the model, as many as wanted.
        significance: rejected share of true matches *per test*: with k tests give ``sidak(alpha, k)``.

    Raises:
        InputError: if alpha is no probability or a variance is not positive.
    """
    variance = np.asarray(variance, dtype=np.float64)
    if not np.all(variance > 0):
        raise InputError(
            f"variance: expected positive numbers, got {np.min(variance)}. Give the constraint's variance."
        )
    limit = chi2_limit(significance)
    D2 = (np.asarray(model) - value) * (1 / np.sqrt(variance))
    D2 = np.square(D2, out=D2) if D2.ndim else np.square(D2)
    return Gate(D2, float(np.sqrt(limit)), limit >= D2)


def joint_gate(value: FloatArray, covariance: Covariances, model: FloatArray, significance: float) -> Gate:
    """The same for vectors: ``(model - value)' S^-1 (model - value)`` against chi-square with ``m`` dof.

    Args:
        value: ``(m,)``.
        covariance: ``(m, m)``, positive definite.
        model: ``(*batch, m)``.
        significance: as in :func:`gate`.
    """
    value = np.asarray(value, dtype=np.float64)
    sd = np.sqrt(np.diag(covariance))
    L = np.linalg.cholesky(covariance / np.outer(sd, sd))
    whiten = np.linalg.solve(L, np.diag(1 / sd))
    white = (np.asarray(model) - value) @ whiten.T
    limit = chi2_limit(significance, len(value))
    D2 = np.sum(white * white, axis=-1)
    return Gate(D2, float(np.sqrt(limit)), limit >= D2)
