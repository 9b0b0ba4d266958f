"""Widths of proposal densities: their roots, and where a face ends within them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tanteo.geometry.typing import Covariances, FloatArray
from tanteo.posterior.settings import Settings


def narrowed(
    covariances: Covariances,
    size: FloatArray,
    log_at: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    own: Settings,
) -> Covariances:
    """Return covariances narrowed along their axes where the density falls off earlier.

    Args:
        covariances: covariances about maxima ``(m, 6, 6)`` [m, rad].
        size: unit of each coordinate for the axes ``(6,)``.
        log_at: function that returns the log density after motions from the maxima ``(m, k, 6)``, and the other states.
        own: settings of the inference.
    """
    values, vectors = np.linalg.eigh(covariances / (size[:, None] * size))
    widths, axes = np.sqrt(values.clip(0)), np.swapaxes(vectors, 1, 2) * size
    top = log_at(np.zeros((len(covariances), 1, 6)))[0]
    for _ in range(np.finfo(np.float64).nmant):
        x = (widths[..., None] * axes)[:, :, None] * np.array([1.0, -1.0])[:, None]
        there = log_at(x.reshape(-1, 12, 6))[0].reshape(-1, 6, 2).max(axis=-1)
        steep = there < top.reshape(-1, 1) - 0.5 * own.search.notable_sds**2
        widths = np.where(steep, 0.5 * widths, widths)
        if not steep.any():
            break
    scaled = widths[..., None] * axes
    return np.asarray(np.swapaxes(scaled, 1, 2) @ scaled, dtype=np.float64)


def roots(covariances: Covariances) -> FloatArray:
    """Return lower Cholesky roots ``(m, 6, 6)``; directions without spread get a small width."""
    width = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 1e-30))
    unit = covariances / (width[:, :, None] * width[:, None])
    values, vectors = np.linalg.eigh(unit)
    if values.min(initial=1.0) < 0:  # by rounding: a nearly free direction beside a sharp one
        unit = (vectors * values.clip(0.0)[:, None]) @ np.swapaxes(vectors, 1, 2)
    return np.asarray(width[:, :, None] * np.linalg.cholesky(unit + 1e-8 * np.eye(6)))
