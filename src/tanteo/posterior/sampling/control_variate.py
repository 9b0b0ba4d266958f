"""Control variate: samples of a region compared with a normal density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.posterior.settings import DEFAULTS, POSE_DOF, SampleSettings


@dataclass(frozen=True, slots=True, eq=False)
class ControlVariate:
    """Weights of the samples of a region, and of a normal density as control variate.

    Attributes:
        weights: weights of the samples ``(N,)``.
        normal: weights under the normal density, times the best factor up to 1 ``(N,)``; 0 without curvature.
        expected: expected sum of ``normal``.
        gaps: squared Mahalanobis distances from the maximum by its curvature ``(N,)``.
        settings: settings of the sampler.
    """

    weights: FloatArray
    normal: FloatArray
    expected: float
    gaps: FloatArray
    settings: SampleSettings = DEFAULTS.samples

    @classmethod
    def alone(cls, weights: FloatArray, settings: SampleSettings = DEFAULTS.samples) -> ControlVariate:
        """Return the weights without a control variate."""
        return cls(weights, np.zeros(len(weights)), 0.0, np.ones(len(weights)), settings)

    @property
    def rest(self) -> FloatArray:
        """Return the weights less those of the normal density ``(N,)``."""
        return self.weights - self.normal

    @property
    def mass(self) -> float:
        """Return the mass of the region."""
        return float(self.rest.sum()) + self.expected

    @property
    def ess(self) -> float:
        """Return the effective sample size: samples of a normal density with the same error of the spread."""
        noise = float(np.sum((self.rest * self.gaps) ** 2))
        spread = 1 + 2 / POSE_DOF  # mean square of a squared normal length, over its squared mean
        return spread * float(self.weights @ self.gaps) ** 2 / noise if noise > 0 else 0.0

    @property
    def is_normal(self) -> bool:
        """Return whether the weights are nearly those of a normal density, and suffice to decide it."""
        squares = float(self.weights @ self.weights)
        enough = squares > 0 and self.weights.sum() ** 2 >= self.settings.shape * squares
        return enough and float(self.rest @ self.rest) < self.settings.min_fraction * squares
