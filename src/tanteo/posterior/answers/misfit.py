"""Goodness of fit where the noise is known up to a factor: p-value and estimated noise scale."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry.special import chi2_survival, chi2_survivals

_REACH, _STEPS = 4.0, 41
"""Numerical: extent of the sum over the log of the noise scale, in logs of the factor to which it is known, and number
of terms. The density is exp(-16) at the ends."""


_PRIOR_INFORMATION = math.gamma(0.25) / (4 * math.gamma(0.75))
"""Definition: one over the variance of the density proportional to exp(-z^4 / 16), the prior of the noise scale."""

_ENOUGH = 60
"""Numerical: Newton steps on a convex function of one number, which converges from anywhere long before."""


@dataclass(frozen=True, slots=True)
class Misfit:
    """Squared residuals of measurements, in stated standard deviations.

    Attributes:
        noise: sum of the squares that the noise scale divides.
        rest: sum of all other squares: sensed normals, shared errors, the prior of the pose.
        dof: degrees of freedom of ``noise`` and ``rest``; 0 or less if nothing was checked.
        log_factor: log of the factor to which the noise is known; 0 if it is exactly as stated.
        noise_dof: degrees of freedom of ``noise`` alone: measurements less the states that they determine.
    """

    noise: float
    rest: float
    dof: int
    log_factor: float = 0.0
    noise_dof: float = 0.0

    @property
    def chi2(self) -> float:
        """Return the joint squared Mahalanobis distance with the noise as stated."""
        return self.noise + self.rest

    @property
    def p_value(self) -> float:
        """Return the probability of a fit as bad or worse, averaged over the prior of the noise scale (Box 1980)."""
        if self.dof <= 0:
            return 1.0
        if self.log_factor == 0:
            return chi2_survival(self.chi2, self.dof)
        z = np.linspace(-_REACH, _REACH, _STEPS)
        weights = np.exp(-(z**4) / 16)
        p = chi2_survivals(self.noise * np.exp(-2 * self.log_factor * z) + self.rest, self.dof)
        return float(weights @ p / weights.sum())

    def with_more(self, rest: float, dof: int, noise_dof: float = 0.0) -> Misfit:
        """Return the misfit with further squared residuals that the noise scale does not divide.

        Args:
            rest: sum of the further squares.
            dof: their degrees of freedom.
            noise_dof: number of states that these residuals determine, in place of the noise residuals.
        """
        return replace(self, rest=self.rest + rest, dof=self.dof + dof, noise_dof=self.noise_dof + noise_dof)

    def noise_scale(self) -> tuple[float, float, float]:
        """Return the estimated noise over the stated one: the mode, and both ends of its 95 % interval.

        Each state that the measurements determine uses one degree of freedom. The prior is flat up to the factor to
        which the noise is known, and falls steeply beyond it.
        """
        if self.log_factor == 0:
            return 1.0, 1.0, 1.0
        dof, unit, z = max(self.noise_dof, 0.0), self.log_factor, 0.0
        for _ in range(_ENOUGH):
            scaled = self.noise * math.exp(-2 * unit * z)
            curved = 2 * scaled * unit**2 + max(0.75 * z * z, _PRIOR_INFORMATION)
            z += max(min(((scaled - dof) * unit - z**3 / 4) / curved, 1.0), -1.0)
        sd = curved**-0.5
        low, likeliest, high = (math.exp(unit * (z + k * sd)) for k in (-1.96, 0.0, 1.96))
        return likeliest, low, high
