"""Scales that make shifts [m] and rotations [rad] of a part comparable."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, Vectors


def motions_about(middle: Vectors, count: int = 6) -> FloatArray:
    """Return motions of a frame at ``middle`` ``(3,)`` as motions of the part's own frame ``(count, count)``.

    The origin of a CAD file may be far from its part, and a rotation about it moves the part far. Coordinates after the
    first six are unchanged.
    """
    out = np.eye(count)
    out[:3, 3:6] = SO3.hat(np.asarray(middle, dtype=np.float64))
    return out


def motion_scale(length: float, middle: Vectors) -> FloatArray:
    """Return unit motions as columns ``(6, 6)``: shifts by the part's size, rotations by 1 rad about its middle.

    In ``xi = scale @ u``, ``xi = [v, w]`` is a tangent of the part's own frame, and ``u = [v / length, w]`` the same
    motion of a frame at the middle. Every axis of ``u`` moves the part about equally far.

    Args:
        length: size of the part [m].
        middle: middle of the part in its frame ``(3,)`` [m].
    """
    return motions_about(middle) * np.r_[np.full(3, length), np.ones(3)]
