"""A part as the hand comes to it: which of its places it sees, and how much of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.parts import Part, Surface

FACING = 0.5
"""A face is gone to if its normal has at least this product with the direction towards the hand."""

_WIDTH = 12**0.5
"""Width of a strip over the standard deviation of its area across."""

_AROUND, _RISE = (0.02, 0.04), 0.005
"""What rises beside a place, at these distances and by more than this, is in the hand's way [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A part as the hand comes to it, in the part's frame."""

    part: Part
    surface: Surface
    towards: FloatArray

    def cosine(self, plane: int) -> float:
        """How squarely a plane faces the hand."""
        return float(self.part.planes.normals[plane] @ self.towards)

    def value(self, plane: int, point: FloatArray, length: float = np.inf) -> float:
        """Of a plane, or of an edge so long: what of its lesser width the hand sees, less where it has no room."""
        width = min(length, _WIDTH * float(self.part.planes.gyration[plane, 1]))
        return width * self.cosine(plane) * self._room(plane, point)

    def _room(self, plane: int, point: FloatArray) -> float:
        """Share of the places around a point beside which nothing rises over its plane; a little at least."""
        T, away = self.part.planes.Ts_part_feature[plane], 2 * self.part.diagonal
        turns = np.arange(8) * np.pi / 4
        ring = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ T[:3, :2].T
        places = point + np.concatenate([r * ring for r in _AROUND])
        hits = self.surface.cast(places + away * T[:3, 2], np.broadcast_to(-T[:3, 2], places.shape)).distances
        return float(np.mean(hits > away - _RISE)) + 0.05

    def open(self, plane: int, point: FloatArray) -> bool:
        """Whether a place of a plane is met first by what comes along its normal."""
        normal, away = self.part.planes.normals[plane], 2 * self.part.diagonal
        hit = self.surface.cast(point + away * normal, -normal)
        return bool(abs(float(hit.distances) - away) < 1e-6 * away) and self._on(plane, int(hit.triangles))

    def _on(self, plane: int, triangle: int) -> bool:
        return bool(self.part.triangle_face[triangle] == self.part.planes.faces[plane])
