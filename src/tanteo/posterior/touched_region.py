"""The region that measurements without a direction touch, which may be a small part of the surface.

A person touches where the hand can reach. Half of the prior belongs to places that are even over the part, each with
the density 1 / A. A quarter belongs to places that are even over one region of area a: each has the density 1 / a, and
the region the probability a / A. The region has the size of the touched patch, for every part. A quarter belongs to
places that are even over the touched faces, whose area the core finds at each pose. Beams of known direction have no
density per area, so that the design does not change them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors

LARGER = 1.2
"""Largest size of an unknown object over that of the ball of its readings (decision 56); the size of a touched region
over that of the patch of its readings."""

_TREE = 0.6331
"""Definition: length of the minimum spanning tree of n even points on an area A over the root of n A, for many points
(Cortina-Borja and Robinson 2000)."""

_BRIDGE = 3.0
"""Numerical: length of an edge of the tree over their mean, beyond which it is a gap between patches."""

_MOST = 500
"""Numerical: number of points from which the size of a patch is computed; more points give the same size."""


@dataclass(frozen=True, slots=True, eq=False)
class TouchedRegion:
    """Size of the region of the measurements without a direction.

    Attributes:
        area: area of the region on faces [m^2]; 0 without such measurements.
        length: length of the region on edges [m]; 0 without such measurements.
        groups: area or length of the region of each label ``(G,)``.
        firsts: number of points on faces that are the first of their label, or have none, and have no direction.
    """

    area: float
    length: float
    groups: FloatArray
    firsts: int

    def log_gain_of_unknown(self, area: float) -> float:
        """Return the log density of the places in one region of an unknown object, over that of places even over it.

        Points of a label beyond the first count on its own surface (:mod:`tanteo.posterior.labels`).

        Args:
            area: surface area of the unknown object [m^2].
        """
        if self.firsts < 2 or self.area >= area:
            return 0.0
        return float((self.firsts - 1) * np.log(area / self.area))


def touched_region(points: ContactPoints, groups: IntArray, rows: IntArray, distant: BoolArray) -> TouchedRegion:
    """Return the region that measurements without a direction touch.

    Args:
        points: the measurements.
        groups: index of the label of each point ``(n,)``; -1 without a label.
        rows: rows of the points that are not on furniture.
        distant: mask of the points that no object of the size of the parts has; they count for their labels alone
            ``(n,)``.
    """
    codimensions = np.array([f.codimension if f.on_surface else 0 for f in points.factors], dtype=np.int64)
    free = np.zeros(len(points), dtype=np.bool_)
    free[rows] = ~points.directed[rows]
    face, edge = free & (codimensions == 1), free & (codimensions == 2)
    floor = float(np.median(points.sd)) if len(points) else 0.0  # repeated touches of one place
    area, length = _area(points.points[face & ~distant], floor), _length(points.points[edge & ~distant], floor)
    sizes = np.zeros(groups.max(initial=-1) + 1)
    for g in range(len(sizes)):
        own = groups == g
        on_face = own & face
        size, most = (
            (_area(points.points[on_face], floor), area)
            if on_face.any()
            else (_length(points.points[own & edge], floor), length)
        )
        sizes[g] = min(size, most) if most > 0 else size
    face &= ~distant
    firsts = int(np.sum(face & (groups < 0))) + len(np.unique(groups[face & (groups >= 0)]))
    return TouchedRegion(area, length, sizes, firsts)


def _area(points: Vectors, floor: float) -> float:
    """Return the area that points cover [m^2]; 0 without points."""
    points = points[:: len(points) // _MOST + 1]
    n = len(points)
    return float(max((LARGER * _tree(points).sum() / _TREE) ** 2 / n, np.pi * floor**2)) if n else 0.0


def _length(points: Vectors, floor: float) -> float:
    """Return the length that points cover [m]; 0 without points."""
    points = points[:: len(points) // _MOST + 1]
    n = len(points)
    return float(max(LARGER * _tree(points).sum() * n / max(n - 1, 1), floor)) if n else 0.0


def _tree(points: Vectors) -> FloatArray:
    """Return the lengths of the edges of the minimum spanning tree, gaps between patches shortened ``(n - 1,)``."""
    n = len(points)
    gaps, out = points[:, None] - points, np.zeros(max(n - 1, 0))
    squares = np.sum(gaps * gaps, axis=-1)
    at, nearest = 0, np.full(n, np.inf)
    for k in range(n - 1):
        nearest = np.minimum(nearest, squares[at])
        nearest[at], squares[:, at] = np.inf, np.inf  # its distance is in the tree
        at = int(nearest.argmin())
        out[k] = np.sqrt(nearest[at])
    return np.asarray(np.minimum(out, _BRIDGE * out.mean())) if n > 1 else out
