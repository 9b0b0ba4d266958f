"""The control law: how fast an error may be taken back, when it is known late.

One gain is chosen from the latency: a distance that is steered by a velocity is an integrator with a dead time. With
``n`` periods between a reading and the motion that answers it, the loop is ``d[k+1] = d[k] - g (d[k-n] - d0)`` with
``g = gain * period``; its characteristic polynomial is ``z^(n+1) - z^n + g``. Two real poles meet at
``g = n^n / (n+1)^(n+1)``: the largest ``g`` whose step response does not overshoot. The loop is stable up to
``g = 2 sin(pi / (4 n + 2))``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError

CALM = 0.2
"""Largest share of an error that is taken back in one period: with little latency the noise of the readings, and not
the dead time, limits the gain."""


@dataclass(frozen=True, slots=True)
class Loop:
    """Proportional control of a velocity-driven distance or angle.

    Attributes:
        gain: Velocity per error [1/s].
        delay: Whole periods of dead time that it is chosen for.
        period: [s].
    """

    gain: float
    delay: int
    period: float

    @classmethod
    def of(cls, latency: float, period: float) -> Loop:
        """The largest gain without overshoot for this latency, or :data:`CALM`.

        Raises:
            InputError: A negative latency or a period that is not positive.
        """
        if not (latency >= 0 and period > 0 and math.isfinite(latency + period)):
            raise InputError(
                f"latency, period: expected zero or more and a positive time [s], got {latency:g} and {period:g}."
            )
        n = math.ceil(latency / period - 1e-9)
        return cls(min(n**n / (n + 1) ** (n + 1), CALM) / period, n, period)

    @property
    def limit(self) -> float:
        """Gain at which the loop begins to oscillate [1/s]."""
        return 2 * math.sin(math.pi / (4 * self.delay + 2)) / self.period

    @property
    def gain_margin(self) -> float:
        """How many times the gain may grow."""
        return self.limit / self.gain

    @property
    def phase_margin(self) -> float:
        """At the crossover, ``|exp(i w) - 1| = g`` [rad]."""
        crossover = 2 * math.asin(min(1.0, 0.5 * self.gain * self.period))
        return math.pi / 2 - (self.delay + 0.5) * crossover

    @property
    def latency_margin(self) -> float:
        """Largest true latency at which the loop is still stable with this gain [s]."""
        n = self.delay
        while self.gain <= 2 * math.sin(math.pi / (4 * (n + 1) + 2)) / self.period:
            n += 1
        return n * self.period

    def decay(self, delay: int) -> float:
        """Largest modulus of the loop's poles when the true dead time is ``delay`` periods; below one it settles."""
        polynomial = np.zeros(delay + 2)
        polynomial[0], polynomial[1] = 1.0, -1.0
        polynomial[-1] += self.gain * self.period
        return float(np.abs(np.roots(polynomial)).max())
