"""Test constraints: the scalar gate (25) and joint chi-square tests (``math.md`` sections 4.7 and 9)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Gate:
    """Result of a test at one significance level.

    Attributes:
        D2: squared Mahalanobis distances ``(*batch,)``.
        D_M: largest accepted Mahalanobis distance, (25).
        accept: mask of accepted values, ``D2 <= D_M^2`` ``(*batch,)``.
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
    """Return ``D_M^2``, the quantile that chi-square exceeds with probability ``significance``.

    Args:
        significance: rejection rate of true matches.
        dof: degrees of freedom.

    Raises:
        InputError: the significance is not in (0, 1), or ``dof`` is below 1.
    """
    if dof < 1:
        raise InputError(f"dof: expected at least 1, got {dof}.")
    from scipy import special  # slow to import

    return float(special.chdtri(dof, _level(significance)))


def chi2_p_value(D2: FloatArray, dof: int | FloatArray) -> FloatArray:
    """Return the probability that chi-square exceeds ``D2``.

    Args:
        D2: squared Mahalanobis distances ``(*batch,)``.
        dof: degrees of freedom.
    """
    from scipy import special  # slow to import

    return np.asarray(special.chdtrc(dof, np.asarray(D2, dtype=np.float64)), dtype=np.float64)


def sidak(significance: float, tests: int) -> float:
    """Return the level of each of several independent tests so that together they reject ``significance`` (Sidak 1967).

    Args:
        significance: joint rejection rate of true matches.
        tests: number of tests.

    Raises:
        InputError: the significance is not in (0, 1), or ``tests`` is below 1.
    """
    if tests < 1:
        raise InputError(f"tests: expected at least 1, got {tests}.")
    return float(-np.expm1(np.log1p(-_level(significance)) / tests))


def chi2_statistic(value: FloatArray, covariance: Covariances) -> FloatArray:
    """Return ``value' S^-1 value`` ``(*batch,)``, by a scaled Cholesky factorization, so that m and rad may mix.

    Args:
        value: values ``(*batch, m)``.
        covariance: covariances ``(*batch, m, m)``, positive definite.
    """
    sd = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    unit = covariance / (sd[..., :, None] * sd[..., None, :])
    white = np.linalg.solve(np.linalg.cholesky(unit), (value / sd)[..., None])[..., 0]
    return np.sum(white * white, axis=-1)


def gate(
    value: FloatArray | float, variance: FloatArray | float, model: FloatArray | float, significance: float
) -> Gate:
    """Test one number by (25): accept ``|c_model - c| <= sqrt(Var c) D_M``.

    Args:
        value: sensed values; broadcast against ``model``.
        variance: variances of the sensed values.
        model: values in the model.
        significance: rejection rate of true matches *per test*; for k tests use ``sidak(alpha, k)``.

    Raises:
        InputError: the significance is not in (0, 1), or a variance is not positive.
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
    """Test a vector: ``(model - value)' S^-1 (model - value)`` against chi-square with ``m`` degrees of freedom.

    Args:
        value: sensed value ``(m,)``.
        covariance: covariance of the sensed value ``(m, m)``, positive definite.
        model: values in the model ``(*batch, m)``.
        significance: rejection rate of true matches, see :func:`gate`.
    """
    value = np.asarray(value, dtype=np.float64)
    sd = np.sqrt(np.diag(covariance))
    L = np.linalg.cholesky(covariance / np.outer(sd, sd))
    whiten = np.linalg.solve(L, np.diag(1 / sd))
    white = (np.asarray(model) - value) @ whiten.T
    limit = chi2_limit(significance, len(value))
    D2 = np.sum(white * white, axis=-1)
    return Gate(D2, float(np.sqrt(limit)), limit >= D2)
