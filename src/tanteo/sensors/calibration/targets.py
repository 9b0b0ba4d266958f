"""Define known targets of a calibration: a plane, a ball, a point or a part at a pose with a covariance.

A surface reports where beams hit it, and the tangent plane there. To first order a range depends on the surface by
this plane alone, so that all targets have the derivatives of a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tanteo.geometry import freeze
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors

TARGET = ("x", "y", "z", "turn x", "turn y", "turn z")
"""Parameters of a target: the body error of its pose."""


class Surface(Protocol):
    """Surface of a target in its own frame."""

    def cast(self, origins: Vectors, directions: Vectors) -> tuple[FloatArray, Vectors]:
        """Return the ranges of beams and the outward normals where they hit the surface.

        Args:
            origins: origins of the beams ``(m, 3)`` [m].
            directions: unit directions ``(m, 3)``.

        Returns:
            Ranges ``(m,)`` [m], infinite for a beam that passes, and unit normals ``(m, 3)``.
        """


@dataclass(frozen=True, slots=True)
class Flat:
    """Plane z = 0 with its outward normal along z."""

    def cast(self, origins: Vectors, directions: Vectors) -> tuple[FloatArray, Vectors]:
        """Return the ranges of beams to the plane, and its normal; see :class:`Surface`."""
        approach = -directions[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges = origins[:, 2] / approach
        return np.where(approach > 0, ranges, np.inf), np.broadcast_to([0.0, 0.0, 1.0], origins.shape)


@dataclass(frozen=True, slots=True)
class Ball:
    """Ball about the origin.

    Attributes:
        radius: radius [m].
    """

    radius: float

    def cast(self, origins: Vectors, directions: Vectors) -> tuple[FloatArray, Vectors]:
        """Return the ranges of beams to the near side of the ball, and its normals; see :class:`Surface`."""
        ahead = -np.sum(origins * directions, axis=1)
        inside = self.radius**2 - np.sum((origins + ahead[:, None] * directions) ** 2, axis=1)
        ranges = np.where(inside >= 0, ahead - np.sqrt(np.maximum(inside, 0.0)), np.inf)
        hits = origins + np.where(inside >= 0, ranges, ahead)[:, None] * directions
        return ranges, hits / np.linalg.norm(hits, axis=1, keepdims=True)


@dataclass(frozen=True, slots=True)
class Point:
    """Point at the origin at which every beam is aimed, as a divot under a laser.

    Its range is that of the plane through the point across the beam, and the beam passes it within ``aim_sd``.

    Attributes:
        aim_sd: standard deviation of the distance of the beam from the point, along two axes across it [m].
    """

    aim_sd: float

    def cast(self, origins: Vectors, directions: Vectors) -> tuple[FloatArray, Vectors]:
        """Return the ranges to the point along the beams, and normals against them; see :class:`Surface`."""
        return -np.sum(origins * directions, axis=1), -directions


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Target on which all readings of a log are.

    Attributes:
        surface: surface in the target's frame.
        T_world_target: pose of the target ``(4, 4)`` [m]; None for an unknown place, found from the log.
        cov: covariance of the body error of this pose ``(6, 6)`` [m, rad]; zero where it is exact or has no effect.
        name: name of the target for messages.
    """

    surface: Surface
    T_world_target: Transforms | None
    cov: Covariances
    name: str = "target"

    def __post_init__(self) -> None:
        freeze(self, "cov")
