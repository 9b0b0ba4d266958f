"""Compute the signed distance to a surface, exactly or from a grid, and the path of a ball until contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.parts.shapes.surface import ClosestPoints, Surface

CELLS = 40
"""Number of grid cells along the longest side."""

_MARGIN = 0.3
"""Margin of the grid around the surface, in diagonals of its box."""


def signed_distance(surface: Surface, points: Vectors) -> tuple[FloatArray, Vectors]:
    """Return the distance to the surface, negative inside, and its gradient.

    The sign follows from the angle-weighted pseudonormal at the closest point (Baerentzen and Aanaes 2005), or from the
    winding number if the mesh is open. On the surface the gradient is the outward normal.

    Args:
        surface: closed mesh.
        points: points in its frame ``(*batch, 3)`` [m].

    Returns:
        Distances ``(*batch,)`` [m] and unit gradients ``(*batch, 3)``.
    """
    return as_signed(surface, points, surface.closest(points))


def as_signed(surface: Surface, points: Vectors, near: ClosestPoints) -> tuple[FloatArray, Vectors]:
    """Return :func:`signed_distance` from known closest points.

    Args:
        surface: closed mesh.
        points: points in its frame ``(*batch, 3)`` [m].
        near: closest points of ``points``.
    """
    gap = points - near.points
    known = surface.pseudonormals
    if known is None:
        inside = surface.inside(points)
    else:
        side = known.at(near.points, near.triangles)
        inside = gap[..., 0] * side[..., 0] + gap[..., 1] * side[..., 1] + gap[..., 2] * side[..., 2] < 0
    sign = np.where(inside, -1.0, 1.0)
    touching = near.distances < 1e-9
    gradient = (sign / np.where(touching, 1.0, near.distances))[..., None] * gap
    if touching.any():
        gradient[touching] = surface.normals[near.triangles[touching]]
    return np.where(touching, 0.0, sign) * near.distances, gradient


@dataclass(frozen=True, slots=True, eq=False)
class DistanceField:
    """Signed distance and gradient at the cell centres of a grid, linear inside each cell.

    Attributes:
        origin: centre of the first cell ``(3,)`` [m].
        step: side of a cell [m].
        shape: number of cells along each axis.
        table: distance [m] and gradient of every cell ``(cells, 4)``, single precision.
    """

    origin: FloatArray
    step: float
    shape: tuple[int, int, int]
    table: np.ndarray

    def __call__(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """Return distances ``(*batch,)`` [m] and gradients ``(*batch, 3)`` at points; linear outside the grid.

        Args:
            points: points in the surface frame ``(*batch, 3)`` [m].
        """
        local = (points - self.origin) * (1.0 / self.step)
        cell = np.clip(np.rint(local), 0, np.array(self.shape) - 1)
        index = (cell[..., 0] * self.shape[1] + cell[..., 1]) * self.shape[2] + cell[..., 2]
        found = self.table.take(index.astype(np.int64), axis=0)
        local -= cell
        gradient = found[..., 1:].astype(np.float64)
        along = local[..., 0] * gradient[..., 0] + local[..., 1] * gradient[..., 1] + local[..., 2] * gradient[..., 2]
        return found[..., 0] + self.step * along, gradient


def distance_field(surface: Surface, cells: int = CELLS) -> DistanceField:
    """Return a grid of the signed distance of a surface.

    Args:
        surface: closed mesh.
        cells: number of cells along the longest side of the grid, including margins.
    """
    low = surface.vertices.min(axis=0)
    high = surface.vertices.max(axis=0)
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


_STEPS, _NEAR = 200, 1e-7
"""Largest number of steps, and the distance that counts as contact [m]."""


def ball_contact(surface: Surface, origin: Vectors, direction: Vectors, radius: float, reach: float = np.inf) -> float:
    """Return the path length of a ball's centre along a direction until contact [m]; infinite without contact.

    The steps are as long as the distance to the surface (sphere tracing, Hart 1996).

    Args:
        surface: body, in its own frame.
        origin: centre of the ball at the start, same frame ``(3,)`` [m].
        direction: unit direction ``(3,)``.
        radius: radius of the ball [m]; 0 for a sharp tip.
        reach: path length at which the search ends [m].
    """
    way = 0.0
    for _ in range(_STEPS):
        gap = float(signed_distance(surface, (origin + way * direction)[None])[0][0]) - radius
        way += gap
        if gap < _NEAR:
            return max(way, 0.0) if way <= reach else np.inf
        if way > reach:
            break
    return np.inf
