"""Which residuals belong to the noise and which are outliers: a mixture, whose outlier fraction is estimated, too.

A good residual is normal with its own variance; an outlier one may be anywhere within the width of what the device can
report. Nothing has to be chosen: how far off an outlier must be follows from the noise, the width and how many there
are.
"""

from __future__ import annotations

import numpy as np

from tanteo.typing import FloatArray

_PASSES = 100
_SETTLED = 1e-9

_LARGEST_SHARE = 0.5
"""A device whose readings are mostly outliers is not a sensor: the rest must be explained."""


def outlier_probabilities(residuals: FloatArray, variances: FloatArray, width: FloatArray | float) -> FloatArray:
    """How probable it is that each residual is an outlier.

    Args:
        residuals: Differences from what is expected [m], ``(n,)``.
        variances: Of the good ones [m^2], ``(n,)``.
        width: Of the ranges that the device can report [m]: the density of an outlier is one over it.
    """
    good = np.exp(-0.5 * residuals**2 / variances) / np.sqrt(2 * np.pi * variances)
    outlier = 1.0 / np.broadcast_to(width, good.shape)
    share = 0.5
    p = np.zeros_like(good)
    for _ in range(_PASSES):
        p = share * outlier / (share * outlier + (1 - share) * good)
        fresh = _share(p)
        if abs(fresh - share) < _SETTLED:
            break
        share = fresh
    return np.asarray(p)


def _share(p: FloatArray) -> float:
    """Share of outliers: half an outlier and half a good one are added (Jeffreys), and most are good."""
    return float(min((p.sum() + 0.5) / (len(p) + 1), _LARGEST_SHARE))


def mixture_log_likelihood(residuals: FloatArray, variances: FloatArray, width: FloatArray | float) -> float:
    """Log likelihood of the residuals under the mixture, at the share that :func:`outlier_probabilities` settles at."""
    p = outlier_probabilities(residuals, variances, width)
    share = _share(p)
    good = np.exp(-0.5 * residuals**2 / variances) / np.sqrt(2 * np.pi * variances)
    return float(np.sum(np.log(share / np.broadcast_to(width, good.shape) + (1 - share) * good)))
