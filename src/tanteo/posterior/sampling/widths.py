"""Widths of proposal densities: their roots, and where a face ends within them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray
from tanteo.posterior.settings import POSE_DOF, Settings


@dataclass(frozen=True, slots=True, eq=False)
class Axes:
    """Principal axes of proposal densities.

    Attributes:
        widths: standard deviations along the axes, the smallest first ``(m, 6)``.
        vectors: axes as columns, orthonormal in coordinates over their units ``(m, 6, 6)``.
        size: unit of each coordinate ``(6,)``.
    """

    widths: FloatArray
    vectors: FloatArray
    size: FloatArray

    @classmethod
    def of(cls, covariances: Covariances, size: FloatArray) -> Axes:
        """Return the axes of covariances ``(m, 6, 6)`` [m, rad], with coordinates over the units ``size``."""
        values, vectors = np.linalg.eigh(covariances / (size[:, None] * size))
        least = np.finfo(float).eps * values[:, -1:]  # rounding of the smallest values
        return cls(np.sqrt(np.maximum(values, least)), vectors, size)

    def take(self, rows: BoolArray) -> Axes:
        """Return the axes of some densities."""
        return replace(self, widths=self.widths[rows], vectors=self.vectors[rows])

    @property
    def scaled(self) -> FloatArray:
        """Return motions by one width along each axis, as rows ``(m, 6, 6)``."""
        return np.asarray(self.widths[..., None] * (np.swapaxes(self.vectors, 1, 2) * self.size))

    @property
    def covariances(self) -> Covariances:
        """Return the covariances ``(m, 6, 6)`` [m, rad]."""
        return np.asarray(np.swapaxes(self.scaled, 1, 2) @ self.scaled)


def narrowed(axes: Axes, log_at: Callable[[IntArray, FloatArray], FloatArray], own: Settings) -> Axes:
    """Return the axes with smaller widths where the density falls off earlier.

    Where it does so along an axis, the ridge may be bent, and the widths hold also between the widest two axes.

    Args:
        axes: axes of densities about maxima.
        log_at: function that returns the log density after motions ``(N, 6)`` from some of the maxima ``(N,)``.
        own: settings of the inference.
    """
    count, fall, first = len(axes.widths), 0.5 * own.search.notable_sds**2, axes.widths
    top = log_at(np.arange(count), np.zeros((count, 6)))

    def falls(rows: IntArray, steps: FloatArray, by: float) -> BoolArray:
        """Return whether the density falls by more than a limit after steps and after their opposites ``(N,)``."""
        least = top[rows] - by
        low = log_at(rows, steps) < least
        low[low] = log_at(rows[low], -steps[low]) < least[low]
        return low

    changed = np.ones((count, POSE_DOF), dtype=bool)
    for _ in range(np.finfo(np.float64).nmant):
        rows, which = np.nonzero(changed)
        steep = np.zeros_like(changed)
        steep[rows, which] = falls(rows, axes.scaled[rows, which], fall)
        calm = changed.any(axis=1) & ~steep.any(axis=1) & (axes.widths < first).any(axis=1)
        rows = np.flatnonzero(calm)
        second, widest = axes.scaled[rows, 4], axes.scaled[rows, 5]
        between = falls(np.tile(rows, 2), np.concatenate([widest + second, widest - second]), 2 * fall)
        steep[rows, 4:] = np.any(between.reshape(2, -1), axis=0, keepdims=True).T
        axes, changed = replace(axes, widths=np.where(steep, 0.5 * axes.widths, axes.widths)), steep
        if not steep.any():
            break
    return axes


def roots(covariances: Covariances) -> FloatArray:
    """Return lower Cholesky roots ``(m, 6, 6)``; directions without spread get a small width."""
    width = np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 1e-30))
    unit = covariances / (width[:, :, None] * width[:, None])
    values, vectors = np.linalg.eigh(unit)
    if values.min(initial=1.0) < 0:  # by rounding: a nearly free direction beside a sharp one
        unit = (vectors * values.clip(0.0)[:, None]) @ np.swapaxes(vectors, 1, 2)
    return np.asarray(width[:, :, None] * np.linalg.cholesky(unit + 1e-8 * np.eye(6)))
