"""Samples of a region beside what they would be if it were normal: a control variate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.posterior.settings import DEFAULTS, POSE_DOF, SampleSettings


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Samples of a region beside what they would be if it were normal: a control variate.

    Attributes:
        weights: of the samples ``(N,)``.
        normal: what they would be, times the factor with which they come nearest to them, 1 at most ``(N,)``; 0 where
            the curvature is not known.
        expected: what the sum of those is without the noise of the samples.
        gaps: squared lengths of the motions from the maximum, by its curvature ``(N,)``.
        settings: numbers of the sampling.
    """

    weights: FloatArray
    normal: FloatArray
    expected: float
    gaps: FloatArray
    settings: SampleSettings = DEFAULTS.samples

    @classmethod
    def alone(cls, weights: FloatArray, settings: SampleSettings = DEFAULTS.samples) -> Compared:
        """Return samples without a normal density to compare them with."""
        return cls(weights, np.zeros(len(weights)), 0.0, np.ones(len(weights)), settings)

    @property
    def rest(self) -> FloatArray:
        """What the samples tell beyond what is known ``(N,)``."""
        return self.weights - self.normal

    @property
    def mass(self) -> float:
        """Of the region."""
        return float(self.rest.sum()) + self.expected

    @property
    def ess(self) -> float:
        """How many samples of a normal density would tell its spread as well."""
        noise = float(np.sum((self.rest * self.gaps) ** 2))
        spread = 1 + 2 / POSE_DOF  # mean square of a squared normal length, over its squared mean
        return spread * float(self.weights @ self.gaps) ** 2 / noise if noise > 0 else 0.0

    @property
    def is_normal(self) -> bool:
        """Whether the weights are nearly those of a normal density, as far as they tell."""
        squares = float(self.weights @ self.weights)
        told = squares > 0 and self.weights.sum() ** 2 >= self.settings.shape * squares
        return told and float(self.rest @ self.rest) < self.settings.share * squares
