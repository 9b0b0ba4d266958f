"""Widths of proposal densities: their roots, and where a face ends within them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry.typing import BoolArray, Covariances, FloatArray
from tanteo.posterior.settings import Settings


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
        return cls(np.sqrt(values.clip(0)), vectors, size)

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


def narrowed(axes: Axes, log_at: Callable[[FloatArray], FloatArray], own: Settings) -> Axes:
    """Return the axes with smaller widths where the density falls off earlier.

    Where it does so along an axis, the ridge may be bent, and the widths hold also between the widest two axes.

    Args:
        axes: axes of densities about maxima.
        log_at: function that returns the log density after motions from the maxima ``(m, k, 6)``.
        own: settings of the inference.
    """
    count, fall, first = len(axes.widths), 0.5 * own.search.notable_sds**2, axes.widths
    top = log_at(np.zeros((count, 1, 6))).reshape(-1, 1)
    for _ in range(np.finfo(np.float64).nmant):
        second, widest = axes.scaled[:, 4:5], axes.scaled[:, 5:]
        steps = np.concatenate([axes.scaled, widest + second, widest - second], axis=1)
        there = log_at(np.concatenate([steps, -steps], axis=1)).reshape(count, 2, 8).max(axis=1)
        steep = there[:, :6] < top - fall
        between = (there[:, 6:] < top - 2 * fall).any(axis=1) & ~steep.any(axis=1) & (axes.widths < first).any(axis=1)
        steep[:, 4:] |= between[:, None]
        axes = replace(axes, widths=np.where(steep, 0.5 * axes.widths, axes.widths))
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
