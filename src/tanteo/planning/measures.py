"""Measures of the expected information of one reading (``math.md`` section 11).

The weight of hypothesis ``h`` is ``w_h``. Under it the reading is normal with mean ``mu_h`` and covariance ``S_h``.
All information is in nats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.features import chi2_limit, chi2_statistic
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import Covariances, FloatArray, Vectors

_REACH = 12.0
"""Half width of the interval of integration [standard deviations]; over it the trapezoid rule is exact to rounding."""
_STEP = 0.125
"""Step of the trapezoid rule, as a multiple of the smallest standard deviation."""
_PANEL = 0.25
"""Width of a quadrature panel [standard deviations], used if the variances differ too much for one step."""


def kl_divergence(m1: Vectors, S1: Covariances, m2: Vectors, S2: Covariances) -> FloatArray:
    """Return the Kullback-Leibler divergence of the normal ``(m1, S1)`` from ``(m2, S2)`` ``(*batch,)`` [nats]."""
    S1, S2 = np.asarray(S1, dtype=np.float64), np.asarray(S2, dtype=np.float64)
    L1, L2 = np.linalg.cholesky(S1), np.linalg.cholesky(S2)
    A = np.linalg.solve(L2, L1)
    trace = np.sum(A * A, axis=(-1, -2))
    d = np.linalg.solve(L2, np.asarray(m2 - m1)[..., None])[..., 0]
    return 0.5 * (trace - d.shape[-1] + np.sum(d * d, axis=-1)) + _half_log_det(S2) - _half_log_det(S1)


def bhattacharyya(m1: Vectors, S1: Covariances, m2: Vectors, S2: Covariances) -> FloatArray:
    """Return the Bhattacharyya distance of two normals ``(*batch,)`` [nats]; ``exp(-B)`` bounds their overlap."""
    S1, S2 = np.asarray(S1, dtype=np.float64), np.asarray(S2, dtype=np.float64)
    mean = 0.5 * (S1 + S2)
    d = np.linalg.solve(np.linalg.cholesky(mean), np.asarray(m2 - m1)[..., None])[..., 0]
    own = 0.5 * (_half_log_det(S1) + _half_log_det(S2))
    return np.sum(d * d, axis=-1) / 8 + _half_log_det(mean) - own


def _half_log_det(S: Covariances) -> FloatArray:
    L = np.linalg.cholesky(S)
    return np.sum(np.log(np.diagonal(L, axis1=-2, axis2=-1)), axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class AcceptProbability:
    """Probability that a chi-square gate accepts a hypothesis with a wrong prediction.

    Attributes:
        noncentrality: squared Mahalanobis distance between wrong and true prediction ``(*batch,)``.
        p: probability of acceptance ``(*batch,)``.
    """

    noncentrality: FloatArray
    p: FloatArray


def accept_probability(delta: Vectors, S: Covariances, significance: float) -> AcceptProbability:
    """Return the probability that the chi-square gate of the paper's equation (25) accepts a wrong hypothesis.

    The gate is used in its joint form, over all ``m`` components of a reading.

    Args:
        delta: difference between the predictions of the wrong and the true hypothesis ``(*batch, m)``.
        S: covariance of a reading under either hypothesis ``(*batch, m, m)``.
        significance: fraction of true matches that the gate rejects.
    """
    from scipy.special import chndtr  # slow to import

    noncentrality = chi2_statistic(np.asarray(delta, dtype=np.float64), np.asarray(S, dtype=np.float64))
    m = np.shape(delta)[-1]
    return AcceptProbability(noncentrality, np.asarray(chndtr(chi2_limit(significance, m), m, noncentrality)))


@dataclass(frozen=True, slots=True, eq=False)
class GateDiscrimination:
    """Measures of how well one scalar reading discriminates hypotheses.

    Attributes:
        accept: ``A_ij``, probability that hypothesis ``j`` passes the gate when ``i`` is true ``(n, n)``.
        expected_remaining: expected number of hypotheses after the gate.
        mutual_information: exact mutual information of hypothesis and reading [nats].
        mi_lower: pairwise lower bound of the mutual information, by which readings are chosen [nats].
        mi_upper: pairwise upper bound of the mutual information [nats].
        error_bound: bound on the probability of a wrong hypothesis after the reading.
    """

    accept: FloatArray
    expected_remaining: float
    mutual_information: float
    mi_lower: float
    mi_upper: float
    error_bound: float


def gate_discrimination(
    weights: FloatArray, means: FloatArray, variances: FloatArray, significance: float
) -> GateDiscrimination:
    """Return all measures of one scalar reading with ``y | i ~ N(means_i, variances_i)`` (``math.md`` section 11).

    Args:
        weights: weights of the hypotheses that sum to one ``(n,)``.
        means: predicted readings ``(n,)``.
        variances: variances of the predicted readings, positive ``(n,)``.
        significance: significance level of the gate.

    Raises:
        InputError: the weights are not a probability distribution, or a variance is not positive.
    """
    w, mu, var = _check(weights, means, variances)
    accept = accept_matrix(mu, var, significance)
    lower, upper = information_bounds(w, mu, var)
    B = _pairwise_bhattacharyya(mu, var)
    overlap = np.sqrt(np.outer(w, w)) * np.exp(-B)
    return GateDiscrimination(
        accept,
        float(w @ accept.sum(axis=1)),
        mutual_information(w, mu, var),
        lower,
        upper,
        float(np.sum(np.triu(overlap, 1))),
    )


def accept_matrix(means: FloatArray, variances: FloatArray, significance: float) -> FloatArray:
    """Return the matrix ``A_ij``: probability that the gate of hypothesis ``j`` accepts a reading of hypothesis ``i``.

    Args:
        means: predicted readings ``(n,)``.
        variances: variances of the predicted readings ``(n,)``.
        significance: fraction of true readings that the gate rejects.
    """
    from scipy.special import ndtr  # slow to import

    D = np.sqrt(chi2_limit(significance))
    mu, sd = np.asarray(means), np.sqrt(variances)
    low = (mu - D * sd - mu[:, None]) / sd[:, None]
    high = (mu + D * sd - mu[:, None]) / sd[:, None]
    # from the side where both are small, so that far tails keep their digits
    flip = low > 0
    a, b = np.where(flip, -high, low), np.where(flip, -low, high)
    return np.asarray(ndtr(b) - ndtr(a))


def information_bounds(weights: FloatArray, means: FloatArray, variances: FloatArray) -> tuple[float, float]:
    """Return the lower and the upper bound of Kolchinsky and Tracey (2017) on the mutual information [nats].

    Readings are chosen by the lower bound. In nine of ten random cases it ranks them like the exact value.
    """
    w, mu, var = _check(weights, means, variances)
    KL = 0.5 * ((mu[:, None] - mu) ** 2 / var + var[:, None] / var - 1 + np.log(var / var[:, None]))
    return _mixed(w, _pairwise_bhattacharyya(mu, var)), _mixed(w, KL)


def _mixed(w: FloatArray, distance: FloatArray) -> float:
    """Return ``-sum w_i ln sum w_j exp(-d_ij)``."""
    used = w > 0
    return float(-w[used] @ np.log(np.exp(-distance[np.ix_(used, used)]) @ w[used]))


def _pairwise_bhattacharyya(mu: FloatArray, var: FloatArray) -> FloatArray:
    total = var[:, None] + var
    return (mu[:, None] - mu) ** 2 / (4 * total) + 0.5 * np.log(total / (2 * np.sqrt(np.outer(var, var))))


def mutual_information(weights: FloatArray, means: FloatArray, variances: FloatArray) -> float:
    """Return the mutual information of hypothesis and reading [nats], exact to rounding.

    The term of each hypothesis is integrated over its own 12 standard deviations, by the trapezoid rule or, if others
    are much sharper, by Gauss-Legendre panels. The integrand avoids the cancellation of a difference of entropies.
    """
    w, mu, var = _check(weights, means, variances)
    sd, total = np.sqrt(var), 0.0
    with np.errstate(divide="ignore"):
        log_w = np.log(w)
    for k in np.flatnonzero(w > 0):
        y, weight = _nodes(mu, sd, int(k))
        z = (y[:, None] - mu) / sd
        log_p = -0.5 * z * z - np.log(sd)
        log_mix = log_sum(log_p + log_w, axis=1)
        total += w[k] * float(weight @ (np.exp(-0.5 * z[:, k] ** 2) * (log_p[:, k] - log_mix)))
    return float(total / np.sqrt(2 * np.pi))


def _nodes(mu: FloatArray, sd: FloatArray, k: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes ``y`` and weights, in units of ``sd_k``, for integrals over hypothesis ``k``."""
    sharpest = float(sd.min() / sd[k])
    if sharpest > 1 / 64:
        step = _STEP * min(1.0, sharpest)
        t = np.arange(-np.ceil(_REACH / step), np.ceil(_REACH / step) + 1) * step
        return mu[k] + sd[k] * t, np.full(len(t), step)
    edges = (mu[:, None] + sd[:, None] * np.arange(-_REACH, _REACH + _PANEL, _PANEL)).ravel()
    low, high = mu[k] - _REACH * sd[k], mu[k] + _REACH * sd[k]
    edges = np.unique(np.clip(edges, low, high))
    x, weight = np.polynomial.legendre.leggauss(16)
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    return (middle[:, None] + half[:, None] * x).ravel(), (half[:, None] * weight / sd[k]).ravel()


def _check(weights: FloatArray, means: FloatArray, variances: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    w, mu, var = (np.asarray(a, dtype=np.float64) for a in (weights, means, variances))
    if np.any(w < 0) or abs(w.sum() - 1) > 1e-6:
        raise InputError(f"weights: expected a distribution that sums to 1, got {w.tolist()}. Normalize them.")
    if not np.all(var > 0):
        raise InputError(f"variances: expected positive numbers, got {var.tolist()}. Add the sensor's own variance.")
    return w, mu, var
