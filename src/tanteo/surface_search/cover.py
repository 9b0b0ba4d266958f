"""How much of a reading's noise is on a face that ends at lines: at an edge, at a corner, on a strip."""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from tanteo.typing import BoolArray, FloatArray


def log_cover(beta: FloatArray, beyond: FloatArray, reflex: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log of the share of the noise that is on the face ``(k, F)``; that of each strip and of reflex corners alone.

    Arguments of :func:`covered`.
    """
    log = _log_between(beyond, beta)
    cover = np.sum(log, axis=-1)
    if not reflex.any():
        return cover, log, cover
    either = np.log(np.maximum(-np.expm1(np.sum(log_ndtr(-beta), axis=-1)), 1e-300))
    return np.where(reflex, either, cover), log, either


def covered(beta: FloatArray, beyond: FloatArray, reflex: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log of the share of the noise that is on the face ``(k, F)``, and its first and negative second derivatives.

    Between both lines and the far sides of the face from them, or at a reflex corner inside one of the two lines; exact
    where all are at right angles.

    Args:
        beta: distance inside each line, in standard deviations ``(k, F, 2)``.
        beyond: distance past the far side ``(k, F, 2)``.
        reflex: whether one line is enough ``(k, F)``.
    """
    cover, log, either = log_cover(beta, beyond, reflex)
    near, far = _normal_density(beta), _normal_density(beyond)
    share = np.exp(-np.maximum(log, -700.0))
    pull = (near - far) * share
    if reflex.any():
        outside = np.exp(log_ndtr(-beta))[..., ::-1] * np.exp(-either)[..., None]
        pull = np.where(reflex[..., None], near * outside, pull)
    finite, past = np.where(np.isfinite(beta), beta, 0.0), np.where(np.isfinite(beyond), beyond, 0.0)
    hold = pull**2 + (finite * near - past * far) * share
    return cover, pull, np.where(reflex[..., None], 0.0, np.maximum(hold, 0.0))


def _normal_density(x: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-0.5 * np.minimum(x * x, 1500.0)) / np.sqrt(2 * np.pi))


def _log_between(low: FloatArray, high: FloatArray) -> FloatArray:
    """Log of the normal probability between two limits, accurate in both tails."""
    with np.errstate(invalid="ignore"):  # no line at all: between minus and plus infinity
        mirrored = low + high > 0
        a, b = np.where(mirrored, -high, low), np.where(mirrored, -low, high)
    top = log_ndtr(b)
    return np.asarray(top + np.log1p(-np.exp(np.minimum(log_ndtr(a) - top, -1e-12))))
