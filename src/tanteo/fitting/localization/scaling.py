"""Metres and radians made comparable: motions measured by the size of a part, about its middle."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, Vectors


def motions_about(middle: Vectors, count: int = 6) -> FloatArray:
    """Motions of a frame at ``middle`` ``(3,)`` of a part as motions of the part's own frame ``(count, count)``.

    The origin of a CAD file may lie far from its part, and a turn about it moves the part far. Coordinates behind the
    first six stay as they are.
    """
    out = np.eye(count)
    out[:3, 3:6] = SO3.hat(np.asarray(middle, dtype=np.float64))
    return out


def motion_scale(length: float, middle: Vectors) -> FloatArray:
    """Motions that shift a part by its size or turn it by a radian about its middle, as columns ``(6, 6)``.

    ``xi = scale @ u``: a tangent ``xi = [v, w]`` of the part's own frame, whose origin may lie anywhere, and the same
    motion ``u = [v / length, w]`` of a frame at the middle. Every axis of ``u`` moves the part about as far.

    Args:
        length: size of the part [m].
        middle: of the part, in its frame ``(3,)`` [m].
    """
    return motions_about(middle) * np.r_[np.full(3, length), np.ones(3)]
