"""A probability in words."""

from __future__ import annotations


def percent(p: float) -> str:
    """A probability; never "100 %" or "0 %": a posterior is not certain, even where float says 1."""
    if p >= 0.9995:
        return "> 99.9 %"
    return "< 0.1 %" if p < 0.0005 else f"{100 * p:.1f} %"
