"""The object is none of the parts: its readings are anywhere, or on something that is only like a part."""

from __future__ import annotations

import numpy as np

from tanteo.matching.evidence import Priors, log_sum
from tanteo.surface_search.touches import Touches
from tanteo.typing import BoolArray, FloatArray

NEGLIGIBLE = 12.0
"""Log odds below everything else at which a pose is not reported, and forgotten."""


def unknown_log_density(touches: Touches, priors: Priors) -> FloatArray:
    """Log density of each reading if the part is none of these: anywhere in the workspace ``(n,)``."""
    ball = np.log(4 / 3 * np.pi * priors.radius**3)
    log: FloatArray = np.where(touches.directed, -np.log(2 * priors.radius), -ball)
    return np.asarray(log - np.where(touches.oriented, np.log(4 * np.pi), 0.0))


def reported(log_mass: FloatArray, log_kin: FloatArray, total: float) -> BoolArray:
    """Which modes are reported: what is probable, and the likeliest object that is only like a part, as that part.

    Args:
        log_mass: log evidence of each mode.
        log_kin: of an object like the part there, its prior included.
        total: of everything together.
    """
    out = np.asarray(log_mass > total - NEGLIGIBLE)
    if len(out) and not out.any() and log_kin.max() > total - NEGLIGIBLE:
        out[np.argmax(log_kin)] = True
    return out


def log_none(log_anywhere: float, log_kin: FloatArray, priors: Priors) -> float:
    """Log evidence of "none of these", its prior included: readings anywhere, or on a part that is like one of these.

    Args:
        log_anywhere: log evidence of readings anywhere, the prior of "none of these" included.
        log_kin: log evidence of objects like the parts, at each mode.
        priors: what is assumed beforehand.
    """
    kin = float(log_sum(log_kin)) if len(log_kin) else -np.inf
    return float(np.logaddexp(np.log1p(-priors.kin) + log_anywhere, np.log(priors.unknown) + np.log(priors.kin) + kin))
