"""Test whether a motion maps a part onto itself: planes to planes, and surface points to the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.parts.part import Part
from tanteo.shapes import Surface
from tanteo.typing import FloatArray

TOLERANCE = 2e-4
"""Largest distance of a mapped point from the surface, relative to the diagonal of the part's box."""

FREEFORM_SLACK = 1e-3
"""Largest assumed error of the mesh of a free form, relative to the diagonal."""

PROBES = 4000
"""Largest number of test points."""


_FEW = 64
"""Number of planes up to which planes are compared before points."""


@dataclass(frozen=True, slots=True, eq=False)
class SymmetryProbe:
    """Test points of a part's surface with their tolerances.

    Attributes:
        part: part to test.
        surface: surface of the part.
        points: points on the surface ``(n, 3)`` [m].
        slack: largest error of the mesh at the points ``(n,)`` [m].
        face_slack: largest error of the mesh of each face ``(F,)`` [m].
        base: tolerance for mapped points in addition to the mesh error [m].
    """

    part: Part
    surface: Surface
    points: FloatArray
    slack: FloatArray
    face_slack: FloatArray
    base: float

    @staticmethod
    def of(part: Part) -> SymmetryProbe:
        """Return the probe of a part: its vertices and triangle centroids, or a random subset of them.

        Args:
            part: the part.
        """
        most = np.array([np.inf if face.surface != "freeform" else FREEFORM_SLACK for face in part.faces])
        slacks = np.minimum([face.sagitta for face in part.faces], most * part.diagonal)
        sagitta = slacks[part.triangle_face]
        centres = part.vertices[part.triangles].mean(axis=1)
        at_vertex = np.zeros(len(part.vertices))
        np.maximum.at(at_vertex, part.triangles.reshape(-1), sagitta.repeat(3))
        points = np.concatenate([part.vertices, centres])
        slack = np.concatenate([at_vertex, sagitta])
        if len(points) > PROBES:
            chosen = np.random.default_rng(0).choice(len(points), PROBES, replace=False)
            points, slack = points[chosen], slack[chosen]
        surface = Surface(part.vertices, part.triangles)
        return SymmetryProbe(part, surface, points, slack, slacks, TOLERANCE * part.diagonal)

    def accepts(self, T: FloatArray) -> bool:
        """Return whether a motion maps planes to planes and the surface to itself.

        Args:
            T: motion of the part frame ``(4, 4)`` [m].
        """
        if len(self.part.planes) <= _FEW and not self._planes_match(T):
            return False
        # a few points reject most candidates
        few, every = slice(None, None, 1 + len(self.points) // 64), slice(None)
        return self._on_surface(T, few) and self._planes_match(T) and self._on_surface(T, every)

    def _on_surface(self, T: FloatArray, chosen: slice) -> bool:
        moved = self.points[chosen] @ T[:3, :3].T + T[:3, 3]
        hits = self.surface.closest(moved)
        there = self.face_slack[self.part.triangle_face[hits.triangles]]
        return bool((hits.distances <= self.base + 2.0 * np.maximum(self.slack[chosen], there)).all())

    def _planes_match(self, T: FloatArray) -> bool:
        planes = self.part.planes
        if not len(planes):
            return True
        size = self.part.diagonal
        normals = planes.normals @ T[:3, :3].T
        centroids = planes.centroids @ T[:3, :3].T + T[:3, 3]
        sagitta = 2.0 * float(self.face_slack.max())
        far = np.linalg.norm(centroids[:, None] - planes.centroids[None], axis=2)
        offsets = np.abs(np.einsum("ijk,jk->ij", centroids[:, None] - planes.centroids[None], planes.normals))
        aligned = normals @ planes.normals.T > 1.0 - 1e-5
        spread = np.abs(planes.gyration[:, None] - planes.gyration[None]).max(axis=2)
        near = (far < 10.0 * self.base + sagitta) & (offsets < self.base) & (spread < 3.0 * self.base + sagitta)
        areas = np.abs(planes.areas[:, None] - planes.areas[None]) <= (3.0 * self.base + sagitta) * size
        return bool((aligned & near & areas).any(axis=1).all())
