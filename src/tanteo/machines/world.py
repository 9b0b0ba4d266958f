"""Simulate contacts of a probe with a body for fake controllers; equal touches have equal noise.

This module has the true pose of the body, and uses no estimator.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import SE3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.parts import Surface, signed_distance
from tanteo.parts.shapes import ball_contact

_TRIPPED = 2e-6
"""Distance from the surface below which the ball is in contact [m]."""

_SUM, _WAVES = 12, 8e3
"""Number of sines whose sum is the noise of a touch, and standard deviation of their wave numbers [rad/m].

The noise changes little where a controller rounds positions to a tenth of a micrometre."""


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Body at a pose, and the ball of a probe.

    Attributes:
        surface: surface of the body, body frame.
        T_world_body: pose of the body ``(4, 4)`` [m].
        radius: true radius of the probe's ball [m]; 0 for a sharp tip.
        sd: standard deviation of reported contacts along the motion [m].
        seed: seed of the noise, which depends only on seed, start and end of a touch.
    """

    surface: Surface
    T_world_body: Transforms
    radius: float = 0.0
    sd: float = 0.0
    seed: int = 0

    def contact(self, start: Vectors, end: Vectors) -> float:
        """Return the distance that the ball moves until contact [m]; infinite if it reaches the end.

        Args:
            start: position of the ball's centre at the start ``(3,)``, world frame [m].
            end: position at the end ``(3,)``, world frame [m].
        """
        way = end - start
        length = float(np.linalg.norm(way))
        if length < 1e-9:
            return np.inf
        inverse, d = SE3.inverse(self.T_world_body), way / length
        place, along = SE3.apply(inverse, start), d @ self.T_world_body[:3, :3]
        return ball_contact(self.surface, place, along, self.radius, length)

    def tripped(self, place: Vectors) -> bool:
        """Return whether the ball is in contact at a position.

        Args:
            place: position of the ball's centre ``(3,)``, world frame [m].
        """
        local = SE3.apply(SE3.inverse(self.T_world_body), place)
        return bool(signed_distance(self.surface, local[None])[0][0] - self.radius < _TRIPPED)

    def noise(self, start: Vectors, end: Vectors) -> float:
        """Return the error of the reported contact of a touch [m], approximately normal and equal for equal touches.

        Args:
            start: position of the ball's centre at the start ``(3,)``, world frame [m].
            end: position towards which the ball moves ``(3,)``, world frame [m].
        """
        rng = np.random.default_rng(self.seed)
        waves, phases = rng.normal(0.0, _WAVES, (_SUM, 6)), rng.uniform(0.0, 2 * np.pi, _SUM)
        return float(self.sd * np.sqrt(2 / _SUM) * np.sin(waves @ np.concatenate([start, end]) + phases).sum())
