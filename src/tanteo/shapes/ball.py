"""Compute the path of a ball until it touches a surface."""

from __future__ import annotations

import numpy as np

from tanteo.shapes.field import signed_distance
from tanteo.shapes.surface import Surface
from tanteo.typing import Vectors

_STEPS, _NEAR = 200, 1e-7
"""Largest number of steps, and the distance that counts as contact [m]."""


def ball_contact(surface: Surface, origin: Vectors, direction: Vectors, radius: float, reach: float = np.inf) -> float:
    """Return the path length of a ball's centre along a direction until contact [m]; infinite without contact.

    The steps are as long as the distance to the surface (sphere tracing, Hart 1996).

    Args:
        surface: body, in its own frame.
        origin: centre of the ball at the start, same frame ``(3,)`` [m].
        direction: unit direction ``(3,)``.
        radius: radius of the ball [m]; 0 for a sharp tip.
        reach: path length at which the search ends [m].
    """
    way = 0.0
    for _ in range(_STEPS):
        gap = float(signed_distance(surface, (origin + way * direction)[None])[0][0]) - radius
        way += gap
        if gap < _NEAR:
            return max(way, 0.0) if way <= reach else np.inf
        if way > reach:
            break
    return np.inf
