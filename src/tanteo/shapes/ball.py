"""How far a ball moves until it meets a surface."""

from __future__ import annotations

import numpy as np

from tanteo.shapes.field import signed_distance
from tanteo.shapes.surface import Surface
from tanteo.typing import Vectors

_STEPS, _NEAR = 200, 1e-7
"""Of the ball towards the surface, and how near it is then [m]."""


def ball_contact(surface: Surface, origin: Vectors, direction: Vectors, radius: float, reach: float = np.inf) -> float:
    """The way of a ball's centre along a direction until the ball touches [m]; infinite where it does not.

    Args:
        surface: the body, in its own frame.
        origin: centre of the ball at the start ``(3,)``, same frame.
        direction: unit ``(3,)``.
        radius: of the ball [m]; 0 for a sharp tip.
        reach: where it is given up [m].
    """
    way = 0.0
    for _ in range(_STEPS):  # by steps as long as the ball has room for
        gap = float(signed_distance(surface, (origin + way * direction)[None])[0][0]) - radius
        way += gap
        if gap < _NEAR:
            return max(way, 0.0) if way <= reach else np.inf
        if way > reach:
            break
    return np.inf
