"""Outlier rate with a stated mean, integrated over a beta prior (decision 35)."""

from __future__ import annotations

from functools import cache

import numpy as np

from tanteo.geometry.special import binomial_cdf, jacobi_nodes, laguerre_nodes
from tanteo.geometry.typing import FloatArray

JEFFREYS = 0.5
"""First parameter of the beta density of a rate, that of the prior of Jeffreys (1946)."""

LEAST_RATE = 1e-290
"""Numerical: smallest rate of outliers, whose logarithm is still a number."""

_RARE = 1e-3
"""Numerical: mean rate below which a gamma density stands for the beta density, with a relative error of as much."""

NODES = 4
"""Numerical: least number of nodes of the Gauss quadrature over a rate (decision 35)."""


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
