"""Outlier rate with a stated mean, integrated over a beta prior (decision 35)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import numpy as np

from tanteo.geometry.special import binomial_cdf, jacobi_nodes, laguerre_nodes, log_sum
from tanteo.geometry.typing import BoolArray, FloatArray, Vectors
from tanteo.posterior.settings import SearchSettings

ArrayT = TypeVar("ArrayT", float, FloatArray)

JEFFREYS = 0.5
"""First parameter of the beta density of a rate, that of the prior of Jeffreys (1946)."""

LEAST_RATE = 1e-290
"""Numerical: smallest rate of outliers, whose logarithm is still a number."""

_RARE = 1e-3
"""Numerical: mean rate below which a gamma density stands for the beta density, with a relative error of as much."""

NODES = 4
"""Numerical: least number of nodes of the Gauss quadrature over a rate (decision 35)."""


@dataclass(frozen=True, slots=True, eq=False)
class DistantPoints:
    """Points that are on no object of the size of the parts which has the other points.

    They are outliers, or the object is larger. A size exceeds that of the parts by a factor with the inverse of the
    factor as probability.

    Attributes:
        rows: mask of the points ``(n,)``.
        larger: probability that an unknown object is large enough for all points.
    """

    rows: BoolArray
    larger: float

    @classmethod
    def of(cls, points: Vectors, placed: BoolArray, radius: float) -> DistantPoints:
        """Return the points that are farther from the median of all than the diameter of the largest part.

        Args:
            points: points of the readings ``(n, 3)`` [m].
            placed: mask of the points that must be on the object, outliers excepted ``(n,)``.
            radius: radius of the largest part [m].
        """
        if not placed.any():
            return cls(placed, 1.0)
        factors = np.linalg.norm(points - np.median(points[placed], axis=0), axis=1) / (2 * radius)
        factors = np.where(placed, factors, 0.0)
        rows = factors > max(1.0, float(factors[placed].min()))
        return cls(rows, 1 / float(factors.max()) if rows.any() else 1.0)

    def mean(self, outliers: ArrayT, larger: ArrayT) -> ArrayT:
        """Return the log of the mean of a density over both explanations.

        Args:
            outliers: log density if the points are outliers, the probability of that included.
            larger: log density if the object is large enough for them.
        """
        if not self.rows.any():
            return larger
        return np.logaddexp(np.log1p(-self.larger) + outliers, np.log(self.larger) + larger)


def outlier_rates(mean: float, n: int) -> tuple[FloatArray, FloatArray]:
    """Return rates of outliers and their weights ``(K,)``: nodes of Gauss quadrature under the beta prior.

    Args:
        mean: stated mean rate, above 0 and below 1.
        n: number of readings; more readings determine the rate better and need closer nodes.
    """
    return _rates(mean, max(NODES, int(np.ceil(1.2 * np.sqrt(n)))))


@cache
def _rates(mean: float, nodes: int) -> tuple[FloatArray, FloatArray]:
    if mean < _RARE:
        x, w = laguerre_nodes(nodes, JEFFREYS - 1)
        return np.clip(mean / JEFFREYS * x, LEAST_RATE, 1.0), w
    x, w = jacobi_nodes(nodes, JEFFREYS / mean - JEFFREYS - 1, JEFFREYS - 1)
    return (1 + x) / 2, w


def log_all_outliers(count: int, mean: float) -> float:
    """Return the log probability that some readings are all outliers; 0 of none.

    Args:
        count: number of the readings.
        mean: stated mean rate, above 0 and below 1.
    """
    rates, weights = outlier_rates(mean, count**2)
    return float(log_sum(np.log(weights) + count * np.log(rates)))


def are_unexpected(outliers: int, n: int, rate: float, own: SearchSettings) -> bool:
    """Return whether readings have more outliers than their rate explains; of a few readings any outlier counts.

    Args:
        outliers: number of outliers.
        n: number of readings.
        rate: stated mean rate.
        own: settings of the search.
    """
    return outliers > (n * rate + own.notable_sds * np.sqrt(n * rate) if n > own.any_outlier else 0)


def beta_binomial_tail(outliers: int, n: int, mean: float) -> float:
    """Return the probability of at least this number of outliers among ``n`` readings; 0 of any if ``mean`` is 0."""
    if outliers == 0 or mean == 0:
        return float(outliers == 0)
    rates, weights = outlier_rates(mean, n)
    return float(weights @ (1 - binomial_cdf(outliers - 1, n, rates)))


def log_by_rate(log_hit: FloatArray, log_outlier: FloatArray, rates: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the joint log density of all readings and each outlier rate ``(K, S)``.

    Args:
        log_hit: log densities of the readings on the part ``(S, n)``.
        log_outlier: log densities of the readings as outliers ``(n,)`` or ``(S, n)``.
        rates: outlier rates, nodes of a quadrature ``(K,)``.
        weights: weights of the nodes ``(K,)``.
    """
    top = np.maximum(log_hit, log_outlier)
    hit, outlier = np.exp(log_hit - top), np.exp(log_outlier - top)
    each = [np.sum(np.log((1 - rate) * hit + rate * outlier), axis=-1) for rate in rates]
    return np.asarray(np.log(weights)[:, None] + np.stack(each) + top.sum(axis=-1))
