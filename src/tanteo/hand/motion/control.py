"""Gain of the proportional control of distances and angles, chosen from the latency.

A distance that is driven by a velocity is an integrator with dead time. With ``n`` periods between a reading and the
motion that answers it, the loop is ``d[k+1] = d[k] - g (d[k-n] - d0)`` with ``g = gain * period`` and the
characteristic polynomial ``z^(n+1) - z^n + g``. Two real poles coincide at ``g = n^n / (n+1)^(n+1)``, the largest ``g``
whose step response does not overshoot. The loop is stable up to ``g = 2 sin(pi / (4 n + 2))``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError

CALM = 0.2
"""Largest fraction of an error that is corrected in one period; with little latency the noise of the readings limits
the gain, not the dead time."""


@dataclass(frozen=True, slots=True)
class Loop:
    """Proportional control of a velocity-driven distance or angle.

    Attributes:
        gain: velocity per error [1/s].
        delay: dead time that the gain is chosen for [periods].
        period: time between two commands [s].
    """

    gain: float
    delay: int
    period: float

    @classmethod
    def of(cls, latency: float, period: float) -> Loop:
        """Return the loop with the largest gain without overshoot, limited by :data:`CALM`.

        Args:
            latency: time from a command to its motion [s].
            period: time between two commands [s].

        Raises:
            InputError: The latency is negative, or the period is not positive.
        """
        if not (latency >= 0 and period > 0 and math.isfinite(latency + period)):
            raise InputError(
                f"latency, period: expected zero or more and a positive time [s], got {latency:g} and {period:g}."
            )
        n = math.ceil(latency / period - 1e-9)
        return cls(min(n**n / (n + 1) ** (n + 1), CALM) / period, n, period)

    @property
    def limit(self) -> float:
        """Return the gain at the limit of stability [1/s]."""
        return 2 * math.sin(math.pi / (4 * self.delay + 2)) / self.period

    @property
    def gain_margin(self) -> float:
        """Return the factor by which the gain may grow before the loop is unstable."""
        return self.limit / self.gain

    @property
    def phase_margin(self) -> float:
        """Return the phase margin at the crossover frequency, where ``|exp(i w) - 1| = g`` [rad]."""
        crossover = 2 * math.asin(min(1.0, 0.5 * self.gain * self.period))
        return math.pi / 2 - (self.delay + 0.5) * crossover

    @property
    def latency_margin(self) -> float:
        """Return the largest true latency at which the loop is still stable with this gain [s]."""
        n = self.delay
        while self.gain <= 2 * math.sin(math.pi / (4 * (n + 1) + 2)) / self.period:
            n += 1
        return n * self.period

    def decay(self, delay: int) -> float:
        """Return the spectral radius of the loop for a true dead time of ``delay`` periods; below one it is stable."""
        polynomial = np.zeros(delay + 2)
        polynomial[0], polynomial[1] = 1.0, -1.0
        polynomial[-1] += self.gain * self.period
        return float(np.abs(np.roots(polynomial)).max())
