"""Estimate of the evidence of maxima that a search has missed, from the numbers of sources that led to those it found.

A maximum to which each source leads at a Poisson rate is found by ``c`` sources with the density of a gamma variable of
shape ``c + 1`` for the rate, if the prior of the rate is flat. For each maximum that ``c`` sources found,

    E[exp(-rate) / (1 - exp(-rate)) | c] = zeta(c + 1) - 1

others of the same rate were missed (Horvitz and Thompson 1952). These numbers sum to 1 over ``c``, so the mean equals
that of the estimate by maxima with a single source alone (Good 1953), with less scatter.
"""

from __future__ import annotations

import numpy as np
from scipy.special import zeta

from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import FloatArray, IntArray


def log_missed(log_masses: FloatArray, sources: IntArray) -> float:
    """Return the log of the total mass of the maxima that a search is expected to have missed.

    Args:
        log_masses: log masses of the maxima that were found ``(n,)``.
        sources: number of independent sources that led to each; a maximum without a source counts as one with a single
            source ``(n,)``.
    """
    if not len(log_masses):
        return -np.inf
    return float(log_sum(log_masses + np.log(zeta(np.maximum(sources, 1) + 1.0, 2.0))))
