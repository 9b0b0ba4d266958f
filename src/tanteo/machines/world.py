"""What a fake's probe meets: a body that lies somewhere, a ball, noise that is the same for the same touch.

It knows the truth and no estimator.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.parts import Surface, ball_contact, signed_distance

_TRIPPED = 2e-6
"""Nearer than this the ball is in contact [m]."""

_SUM, _WAVES = 12, 8e3
"""Noise is a sum of so many sines of the touch's places, of so many radians a metre: a tenth of a micrometre that a
controller rounds off leaves it as it is."""


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """A body and the probe before it.

    Attributes:
        surface: of the body, in its own frame.
        T_world_body: where it lies ``(4, 4)``.
        radius: of the probe's ball, as it is [m]; 0 for a sharp tip.
        sd: of where a contact is reported along its motion [m].
        seed: of that; the same touch is reported alike whenever it is made.
    """

    surface: Surface
    T_world_body: Transforms
    radius: float = 0.0
    sd: float = 0.0
    seed: int = 0

    def contact(self, start: Vectors, end: Vectors) -> float:
        """How far the ball gets on the way from ``start`` to ``end`` [m]; infinite if it gets there."""
        way = end - start
        length = float(np.linalg.norm(way))
        if length < 1e-9:
            return np.inf
        inverse, d = SE3.inverse(self.T_world_body), way / length
        place, along = SE3.apply(inverse, start), d @ self.T_world_body[:3, :3]
        return ball_contact(self.surface, place, along, self.radius, length)

    def tripped(self, place: Vectors) -> bool:
        """Whether the ball is in contact at a place ``(3,)``."""
        local = SE3.apply(SE3.inverse(self.T_world_body), place)
        return bool(signed_distance(self.surface, local[None])[0][0] - self.radius < _TRIPPED)

    def noise(self, start: Vectors, end: Vectors) -> float:
        """Of the report of the touch from ``start`` towards ``end`` [m]: about normal, the same for the same touch."""
        rng = np.random.default_rng(self.seed)
        waves, phases = rng.normal(0.0, _WAVES, (_SUM, 6)), rng.uniform(0.0, 2 * np.pi, _SUM)
        return float(self.sd * np.sqrt(2 / _SUM) * np.sin(waves @ np.concatenate([start, end]) + phases).sum())
