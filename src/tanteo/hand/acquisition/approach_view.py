"""Evaluate how well a hand can approach and sense points of a part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.parts import Part, Surface

FACING = 0.5
"""Smallest product of a face's normal with the direction towards the hand for an approach."""

_WIDTH = 12**0.5
"""Width of a strip, as a multiple of the standard deviation of its area across."""

_DISTANCES, _RISE = (0.02, 0.04), 0.005
"""Distances from a point at which the surface is checked, and its largest height there that does not obstruct the hand
[m]."""


@dataclass(frozen=True, slots=True, eq=False)
class ApproachView:
    """Part and direction of approach, in the part's frame.

    Attributes:
        part: part to sense.
        surface: surface of the part.
        towards: unit direction towards the hand ``(3,)``.
    """

    part: Part
    surface: Surface
    towards: FloatArray

    def cosine(self, plane: int) -> float:
        """Return the cosine between the normal of a plane and the direction towards the hand.

        Args:
            plane: index of the plane.
        """
        return float(self.part.planes.normals[plane] @ self.towards)

    def value(self, plane: int, point: FloatArray, length: float = np.inf) -> float:
        """Return the value of a plane or edge for sensing: visible width times the fraction of free surroundings [m].

        Args:
            plane: index of the plane.
            point: point to sense ``(3,)`` [m].
            length: length of an edge [m]; infinite for a plane.
        """
        width = min(length, _WIDTH * float(self.part.planes.gyration[plane, 1]))
        return width * self.cosine(plane) * self._free_fraction(plane, point)

    def _free_fraction(self, plane: int, point: FloatArray) -> float:
        """Return the fraction of the surroundings of a point that do not rise over its plane, plus 0.05."""
        T, away = self.part.planes.Ts_part_feature[plane], 2 * self.part.diagonal
        turns = np.arange(8) * np.pi / 4
        ring = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ T[:3, :2].T
        places = point + np.concatenate([r * ring for r in _DISTANCES])
        hits = self.surface.cast(places + away * T[:3, 2], np.broadcast_to(-T[:3, 2], places.shape)).distances
        return float(np.mean(hits > away - _RISE)) + 0.05

    def open(self, plane: int, point: FloatArray) -> bool:
        """Return whether an approach along the normal of a plane reaches a point on it first.

        Args:
            plane: index of the plane.
            point: point on the plane ``(3,)`` [m].
        """
        normal, away = self.part.planes.normals[plane], 2 * self.part.diagonal
        hit = self.surface.cast(point + away * normal, -normal)
        return bool(abs(float(hit.distances) - away) < 1e-6 * away) and self._on(plane, int(hit.triangles))

    def _on(self, plane: int, triangle: int) -> bool:
        return bool(self.part.triangle_face[triangle] == self.part.planes.faces[plane])
