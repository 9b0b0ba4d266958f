"""Signed distance to a surface: exact, and from a grid for many points at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.shapes.surface import Surface
from tanteo.typing import BoolArray, FloatArray, IntArray, Vectors

_ON_BORDER = 1e-6
"""Barycentric coordinates below this put the closest point on an edge or corner of its triangle."""

CELLS = 40
"""Cells of the grid along its longest side."""

_MARGIN = 0.3
"""How far the grid reaches beyond the surface, in diagonals of its box."""


def signed_distance(surface: Surface, points: Vectors) -> tuple[FloatArray, Vectors]:
    """Distance to the surface, negative inside, and its gradient.

    The sign comes from the closest triangle where the closest point is inside it, else from the winding number. On the
    surface itself the gradient is the outward normal.

    Args:
        surface: a closed mesh.
        points: ``(*batch, 3)`` in its frame [m].

    Returns:
        Distances ``(*batch,)`` [m] and unit gradients ``(*batch, 3)``.
    """
    near = surface.closest(points)
    gap = points - near.points
    normal = surface.normals[near.triangles]
    outward = np.sum(gap * normal, axis=-1)
    doubtful = np.asarray(_on_border(surface, near.points, near.triangles) & (near.distances > 1e-9))
    positive = np.asarray(outward >= 0)
    if doubtful.any():
        positive[doubtful] = ~surface.inside(points[doubtful])
    sign = np.where(positive, 1.0, -1.0)
    touching = near.distances < 1e-9
    safe = np.where(touching, 1.0, near.distances)
    gradient = np.where(touching[..., None], normal, sign[..., None] * gap / safe[..., None])
    return sign * near.distances, gradient


def _on_border(surface: Surface, points: Vectors, triangles: IntArray) -> BoolArray:
    """Whether surface points lie on an edge or corner of their triangle."""
    a, b, c = (surface.vertices[surface.triangles[triangles, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.maximum(np.sum(normal * normal, axis=-1), 1e-300)
    parts = [np.sum(np.cross(q - p, points - p) * normal, axis=-1) / area for p, q in ((a, b), (b, c), (c, a))]
    return np.asarray(np.min(parts, axis=0) < _ON_BORDER, dtype=np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Signed distance and gradient at the centres of a grid's cells; within a cell it is taken as linear.

    Attributes:
        origin: centre of the first cell ``(3,)`` [m].
        step: side of a cell [m].
        shape: cells along each axis.
        table: distance [m] and gradient of every cell ``(cells, 4)``, single precision.
    """

    origin: FloatArray
    step: float
    shape: tuple[int, int, int]
    table: np.ndarray

    def __call__(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """Distances ``(*batch,)`` and gradients ``(*batch, 3)`` at ``(*batch, 3)``; linear beyond the grid."""
        local = (points - self.origin) / self.step
        last = np.array(self.shape) - 1
        cell = np.clip(np.rint(local), 0, last)
        index = (cell[..., 0] * self.shape[1] + cell[..., 1]) * self.shape[2] + cell[..., 2]
        found = self.table[index.astype(np.int64)]
        gradient = found[..., 1:].astype(np.float64)
        return found[..., 0] + self.step * np.sum((local - cell) * gradient, axis=-1), gradient


def distance_field(surface: Surface, cells: int = CELLS) -> DistanceField:
    """Tabulate the signed distance of a surface.

    Args:
        surface: a closed mesh.
        cells: along the longest side of the grid, margins included.
    """
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    margin = _MARGIN * float(np.linalg.norm(high - low))
    size = high - low + 2 * margin
    step = float(size.max()) / cells
    shape = tuple(int(n) for n in np.ceil(size / step).astype(int) + 1)
    origin = low - margin
    axes = [origin[k] + step * np.arange(shape[k]) for k in range(3)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distance, gradient = signed_distance(surface, centres)
    table = np.column_stack([distance, gradient]).astype(np.float32)
    table.setflags(write=False)
    return DistanceField(origin, step, (shape[0], shape[1], shape[2]), table)
