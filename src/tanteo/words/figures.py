"""Figures in sentences: probabilities, p-values, lengths, lists of names."""

from __future__ import annotations

import math

import numpy as np

_EPSILON = float(np.finfo(float).eps)
"""Relative precision of a double. Smaller p-values are reported as a bound, as R's ``format.pval`` does."""


def percent(p: float) -> str:
    """Return a probability in percent, never "100 %" or "0 %": a posterior is not certain, even if a float is 1."""
    if p >= 0.9995:
        return "> 99.9 %"
    return "< 0.1 %" if p < 0.0005 else f"{100 * p:.1f} %"


def excluded(gain: float) -> str:
    """Return the share of the possible parts and poses that a reading excludes, in percent.

    Args:
        gain: information of the reading [nats]; the possible volume decreases by the factor ``exp(-gain)``.
    """
    return percent(-math.expm1(-max(gain, 0.0)))


def p_equals(p: float) -> str:
    """Return a p-value with its sign: ``p = 0.012``, or ``p < 2.2e-16``."""
    return f"p = {p:.2g}" if p >= _EPSILON else f"p < {_EPSILON:.2g}"


def millimetres(metres: float, digits: int = 2) -> str:
    """Return a length in millimetres with so many digits, never in powers of ten."""
    return f"{float(f'{1e3 * metres:.{digits}g}'):g} mm"


def from_surface(distance: float, digits: int = 2) -> str:
    """Return a signed distance from a surface, which is negative inside the material."""
    return f"{millimetres(abs(distance), digits)} {'inside' if distance < 0 else 'off'}"


def listed(names: list[str], word: str = "and") -> str:
    """Return names as ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}" if names else ""


def readings(count: int) -> str:
    """Return a number of readings: ``1 reading``, ``5,000 readings``."""
    return "1 reading" if count == 1 else f"{count:,} readings"
