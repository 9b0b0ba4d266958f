"""Compute signed distances without a search tree where the nearest surface is one plane.

A point has distance ``|phi|`` from the plane of its face. Suppose that everything off that plane is farther from the
centre of the point's cell than ``|phi|`` plus the distance from that centre. Then no other surface is nearer. The foot
also lies on the face: otherwise the segment from the centre would have crossed the face's border, which another plane
shares (the sum is convex along the segment, so checking both ends suffices). The result is exact, and covers most
points near a part with planar faces. The search tree handles all other points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors
from tanteo.parts.shapes.field import DistanceField, as_signed
from tanteo.parts.shapes.surface import Surface

_LARGE = 0.005
"""Area fraction below which planes are handled by the search tree; preparing a plane needs its own tree."""

_BAND = 4
"""Distance of a cell centre from the surface, in cells, above which the search tree is used."""

_COPLANAR = 1e-7
"""Largest difference of coplanar triangles, in radians and in diagonals of the mesh."""


@dataclass(frozen=True, slots=True, eq=False)
class NearPlanes:
    """Grid cells with the plane that is nearest there.

    Attributes:
        origin: centre of the first cell ``(3,)`` [m].
        step: side of a cell [m].
        shape: number of cells along each axis.
        table: outward normal and offset of each plane ``(P, 4)``; the signed distance is ``n . x - offset``.
        planes: plane index of each cell ``(cells,)``.
        triangles: one triangle of each plane ``(P,)``.
        clearance: distance from the cell centre to everything off its plane ``(cells,)`` [m], rounded down; 0 where the
            plane is not nearest.
    """

    origin: FloatArray
    step: float
    shape: tuple[int, int, int]
    table: FloatArray
    planes: np.ndarray
    triangles: IntArray
    clearance: np.ndarray

    def __call__(self, points: Vectors) -> tuple[IntArray, FloatArray, Vectors, BoolArray]:
        """Return plane index, signed distance [m] and gradient at points, and the mask where they are exact.

        Args:
            points: points in the surface frame ``(n, 3)`` [m].

        Returns:
            Plane indices ``(n,)``, distances ``(n,)``, gradients ``(n, 3)`` and mask ``(n,)``.
        """
        local = (points - self.origin) * (1.0 / self.step)
        cell = np.clip(np.rint(local), 0, np.array(self.shape) - 1)
        index = ((cell[:, 0] * self.shape[1] + cell[:, 1]) * self.shape[2] + cell[:, 2]).astype(np.int64)
        local -= cell
        away = self.step * np.sqrt(local[:, 0] ** 2 + local[:, 1] ** 2 + local[:, 2] ** 2)
        row = self.planes.take(index)
        plane = self.table.take(row, axis=0)
        phi = plane[:, 0] * points[:, 0] + plane[:, 1] * points[:, 1] + plane[:, 2] * points[:, 2] - plane[:, 3]
        return row, phi, plane[:, :3], np.abs(phi) + away < self.clearance.take(index)


def near_planes(surface: Surface, field: DistanceField) -> NearPlanes:
    """Return the grid cells near which the nearest surface is one plane.

    Args:
        surface: mesh; an open mesh gets no such cells, because its borders belong to only one plane.
        field: distance grid of the mesh.
    """
    cells = len(field.table)
    planes = np.zeros(cells, dtype=np.int32)
    clearance = np.zeros(cells, dtype=np.float32)
    plane, table, triangles = _planes(surface)
    if surface.pseudonormals is not None:
        rows = np.flatnonzero(np.abs(field.table[:, 0]) < _BAND * field.step)
        index = np.stack(np.unravel_index(rows, field.shape), axis=1)
        centres = field.origin + field.step * index
        near = surface.closest(centres)
        planes[rows] = plane[near.triangles]
        off = np.abs(np.sum(table[planes[rows], :3] * centres, axis=1) - table[planes[rows], 3])
        inside = near.distances <= off + 1e-9 * float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
        for k in _large(surface, plane):
            some = np.flatnonzero(inside & (planes[rows] == k))
            gaps = _distances(surface, surface.triangles[plane != k], centres[some])
            clearance[rows[some]] = np.where(gaps > off[some], (1 - 1e-6) * gaps, 0.0)
    return NearPlanes(field.origin, field.step, field.shape, table, planes, triangles, clearance)


def nearest(surface: Surface, planes: NearPlanes, points: Vectors) -> tuple[FloatArray, Vectors, IntArray]:
    """Return :func:`signed_distance`, computed faster where a plane is nearest.

    Args:
        surface: mesh.
        planes: planes of the mesh, see :func:`near_planes`.
        points: points in its frame ``(*batch, 3)`` [m].

    Returns:
        Distances ``(*batch,)`` [m], unit gradients ``(*batch, 3)``, and a triangle of the nearest plane ``(*batch,)``.
    """
    flat = points.reshape(-1, 3)
    row, phi, g, exact = planes(flat)
    triangles = planes.triangles.take(row)
    rest = np.flatnonzero(~exact)
    if len(rest):
        near = surface.closest(flat[rest])
        phi[rest], g[rest] = as_signed(surface, flat[rest], near)
        triangles[rest] = near.triangles
    batch = points.shape[:-1]
    return phi.reshape(batch), g.reshape(points.shape), triangles.reshape(batch)


def _planes(surface: Surface) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the plane of each triangle ``(T,)``, normal and offset of planes ``(P, 4)``, and a triangle of each."""
    offsets = np.sum(surface.normals * surface.vertices[surface.triangles[:, 0]], axis=1)
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    key = np.rint(np.column_stack([surface.normals, offsets / diagonal]) / _COPLANAR)
    _, first, plane = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return plane.reshape(-1).astype(np.int64), np.column_stack([surface.normals, offsets])[first], first


def _large(surface: Surface, plane: IntArray) -> IntArray:
    """Return the planes with a sufficient area fraction."""
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    areas = np.bincount(plane, weights=np.linalg.norm(np.cross(b - a, c - a), axis=1))
    return np.flatnonzero(areas > _LARGE * areas.sum())


def _distances(surface: Surface, triangles: IntArray, points: Vectors) -> FloatArray:
    """Return the distances from points to some triangles; infinite if there are none."""
    if not len(triangles) or not len(points):
        return np.full(len(points), np.inf)
    import igl  # slow to import

    tree = igl.AABB()
    triangles = np.ascontiguousarray(triangles)
    tree.init(surface.vertices, triangles)
    squared, _, _ = tree.squared_distance(surface.vertices, triangles, np.ascontiguousarray(points))
    return np.sqrt(np.maximum(np.asarray(squared, dtype=np.float64).reshape(-1), 0.0))
