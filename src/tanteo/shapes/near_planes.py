"""Where the nearest surface is one plane: there the signed distance is a product, and no search tree is asked.

A point is off its face by ``|phi|``. If everything that is not on the plane of that face is farther from the centre of
its cell than ``|phi|`` and the way from there together, then no other surface is nearer, and the foot cannot have left
the face on the way: it would have crossed its border, which is shared with another plane (the sum is convex along the
way, so that both ends are enough). That is exact, not an approximation, and holds for most points near a part of
planes; for all others there is the tree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.shapes.field import DistanceField, as_signed
from tanteo.shapes.surface import Surface
from tanteo.typing import BoolArray, FloatArray, IntArray, Vectors

_LARGE = 0.005
"""Planes with a smaller share of the surface are left to the tree: it costs one tree a plane to prepare them."""

_BAND = 4
"""Cells whose centres are farther from the surface than this many cells are left to the tree."""

_ALIKE = 1e-7
"""Planes that differ by this, in radians and in diagonals of the mesh, are one."""


@dataclass(frozen=True, slots=True, eq=False)
class NearPlanes:
    """Cells of a grid with the plane that is nearest there.

    Attributes:
        origin: centre of the first cell ``(3,)`` [m].
        step: side of a cell [m].
        shape: cells along each axis.
        table: outward normal and offset of each plane ``(P, 4)``: signed distance ``n . x - offset``.
        planes: row of the table for each cell ``(cells,)``, short integers.
        triangles: one of each plane ``(P,)``.
        clearance: from the centre to all that is not on that plane, 0 where it is not nearest ``(cells,)`` [m]; single
            precision, rounded down.
    """

    origin: FloatArray
    step: float
    shape: tuple[int, int, int]
    table: FloatArray
    planes: np.ndarray
    triangles: IntArray
    clearance: np.ndarray

    def __call__(self, points: Vectors) -> tuple[IntArray, FloatArray, Vectors, BoolArray]:
        """Row of a plane ``(n,)``, signed distance ``(n,)`` and gradient ``(n, 3)`` at ``(n, 3)``; where they hold."""
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
    """Find the cells of a distance grid near which the nearest surface is one plane.

    Args:
        surface: a mesh; one that does not close has borders that belong to one plane only, so it gets no such cells.
        field: its distance grid.
    """
    cells = len(field.table)
    planes, clearance = np.zeros(cells, dtype=np.int32), np.zeros(cells, dtype=np.float32)
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
    """:func:`signed_distance` in a fraction of the time where planes are nearest.

    Args:
        surface: a mesh.
        planes: of it.
        points: ``(*batch, 3)`` in its frame [m].

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
    """Row of the plane of each triangle ``(T,)``, normal and offset of the planes ``(P, 4)``, a triangle of each."""
    offsets = np.sum(surface.normals * surface.vertices[surface.triangles[:, 0]], axis=1)
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    key = np.rint(np.column_stack([surface.normals, offsets / diagonal]) / _ALIKE)
    _, first, plane = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return plane.reshape(-1).astype(np.int64), np.column_stack([surface.normals, offsets])[first], first


def _large(surface: Surface, plane: IntArray) -> IntArray:
    """Planes that hold a share of the surface that matters."""
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    areas = np.bincount(plane, weights=np.linalg.norm(np.cross(b - a, c - a), axis=1))
    return np.flatnonzero(areas > _LARGE * areas.sum())


def _distances(surface: Surface, triangles: IntArray, points: Vectors) -> FloatArray:
    """From points to some of the triangles; infinite if there are none."""
    if not len(triangles) or not len(points):
        return np.full(len(points), np.inf)
    import igl  # slow to import

    tree = igl.AABB()
    triangles = np.ascontiguousarray(triangles)
    tree.init(surface.vertices, triangles)
    squared, _, _ = tree.squared_distance(surface.vertices, triangles, np.ascontiguousarray(points))
    return np.sqrt(np.maximum(np.asarray(squared, dtype=np.float64).reshape(-1), 0.0))
