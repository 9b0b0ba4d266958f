"""How the noise of a range grows with the range: one law for presets, rigs, calibration and simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.typing import FloatArray

_LARGEST_EXPONENT = 20.0
"""The exponential is cut at 5e8: far beyond any device's range, only so that nothing overflows."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseLaw:
    """Standard deviation of a range from reading to reading, along the beam. Numbers, or arrays over sensors.

    Floor, proportional and quadratic part are independent of each other and add in quadrature. Where there is an
    exponential law the floor is ``const (1 + exp(k (d - d0)))``: hardly more than the constant up to ``d0``, then
    growing fast (Crazyflie firmware, ``zranger.c``).

    Attributes:
        const: Floor [m].
        prop: Part proportional to the range.
        quad: Part proportional to the range squared [1/m].
        exp_d0: Range at which the exponential law has doubled the floor [m].
        exp_k: Rate of the exponential law [1/m]; 0 for none.

    Raises:
        InputError: a part is negative.
    """

    const: FloatArray
    prop: FloatArray
    quad: FloatArray
    exp_d0: FloatArray
    exp_k: FloatArray
    _explodes: bool = field(init=False, repr=False)
    _grows: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("const", "prop", "quad", "exp_k"):  # NaN where a device does not say
            value = getattr(self, name)
            if np.any(value < 0):
                raise InputError(f"noise law, {name}: expected 0 or more, got {np.nanmin(value):g}. Correct it.")
        # a simulator asks a thousand times a second: what the law needs is found out once
        object.__setattr__(self, "_explodes", bool(np.any(self.exp_k > 0)))
        object.__setattr__(self, "_grows", bool(np.any(self.prop > 0) or np.any(self.quad > 0)))

    @classmethod
    def of(
        cls, const: float, prop: float = 0.0, quad: float = 0.0, exp_d0: float = 0.0, exp_k: float = 0.0
    ) -> NoiseLaw:
        """The law of one device."""
        return cls(*(np.asarray(x, dtype=np.float64) for x in (const, prop, quad, exp_d0, exp_k)))

    @classmethod
    def stack(cls, laws: Sequence[NoiseLaw]) -> NoiseLaw:
        """One law with arrays over the devices, last axis."""
        names = ("const", "prop", "quad", "exp_d0", "exp_k")
        return cls(*(np.stack([getattr(law, name) for law in laws], axis=-1) for name in names))

    @property
    def depends_on_range(self) -> bool:
        """The noise grows with the range, so the range must be known."""
        return self._explodes or self._grows

    def sigma(self, d: FloatArray | float) -> FloatArray:
        """Standard deviation [m] at range ``d`` [m]; a law that is constant ignores the range, even NaN."""
        d = np.asarray(d, dtype=np.float64)
        if not (self._explodes or self._grows):
            return np.array(np.broadcast_to(self.const, np.broadcast_shapes(d.shape, self.const.shape)))
        variance = self.const**2
        if self._explodes:
            growth = np.exp(np.minimum(self.exp_k * (d - self.exp_d0), _LARGEST_EXPONENT))
            variance = np.where(self.exp_k > 0, self.const * (1 + growth), self.const) ** 2
        if self._grows:
            variance = variance + d * d * (self.prop**2 + (self.quad * d) ** 2)
        return np.sqrt(variance)
