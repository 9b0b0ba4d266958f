"""Distance from all that may stand there at once: tabulated in the world, as it is asked for at very many places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.answers import box_corners
from tanteo.errors import InputError
from tanteo.inference import PreparedPart
from tanteo.lie import SE3
from tanteo.typing import FloatArray, IntArray, Transforms, Vectors

_STEP, FAR = 0.008, 0.045
"""Of the grid [m], and the distance beyond which it says no more than that."""

_NODES = 5e7
"""The most nodes of a grid: what it takes is 400 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Occupied:
    """Least distance from some parts at poses, on a grid.

    Attributes:
        origin: its first node ``(3,)`` in the world [m].
        table: distances at its nodes, negative inside, :data:`FAR` where it is that or more ``(nx, ny, nz)`` [m].
    """

    origin: FloatArray
    table: FloatArray

    @classmethod
    def by(cls, targets: tuple[PreparedPart, ...], part: IntArray, Ts: Transforms) -> Occupied:
        """By parts at poses ``(K, 4, 4)``; a bit less than it is, by half a cell of the parts' own grids."""
        if not len(Ts):
            return cls(np.zeros(3), np.full((1, 1, 1), FAR))
        ends = np.array([_reach(targets[k], T) for k, T in zip(part, Ts, strict=True)])
        origin = ends[:, 0].min(axis=0)
        first = np.floor((ends[:, 0] - origin) / _STEP).astype(np.int64)
        last = np.ceil((ends[:, 1] - origin) / _STEP).astype(np.int64) + 1
        if np.prod(last.max(axis=0).astype(np.float64)) > _NODES:
            size = " x ".join(f"{v:.3g}" for v in ends[:, 1].max(axis=0) - origin)
            raise InputError(
                f"prior pose: expected the parts within some metres, got {size} m in which they may be. Say better "
                "where they are ([prior] of the scene, --pose-prior, or an image)."
            )
        table = np.full(last.max(axis=0), FAR)
        for k, T, a, b in zip(part, Ts, first, last, strict=True):
            axes = [origin[i] + _STEP * np.arange(a[i], b[i]) for i in range(3)]
            nodes, own = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), targets[k].field
            block = table[a[0] : b[0], a[1] : b[1], a[2] : b[2]]
            np.minimum(block, own(SE3.apply(SE3.inverse(T), nodes))[0] - 0.5 * own.step, out=block)
        return cls(origin, table)

    def __call__(self, points: Vectors) -> FloatArray:
        """Distances at ``(*batch, 3)``, linear between the nodes ``(*batch,)`` [m]."""
        from scipy.ndimage import map_coordinates

        at = np.moveaxis((points - self.origin) / _STEP, -1, 0)
        return np.asarray(map_coordinates(self.table, at, order=1, mode="constant", cval=FAR, prefilter=False))


def _reach(target: PreparedPart, T: Transforms) -> FloatArray:
    """Corners of the box in the world outside of which the part is farther away than :data:`FAR` ``(2, 3)`` [m]."""
    corners = SE3.apply(T, box_corners(target.part))
    return np.stack([corners.min(axis=0) - FAR, corners.max(axis=0) + FAR])
