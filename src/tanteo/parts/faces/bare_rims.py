"""Find circular openings of flat faces of an open surface: the rims of holes whose walls the file does not have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.parts.part import Part
from tanteo.parts.readers.topology import components

_LEAST = 8
"""Smallest number of corners of a circle's mesh; fewer may be a polygon."""

_ROUND = 2e-3
"""Numerical: largest distance of a rim's corners from their circle, over the radius; a mesh has exact corners."""


@dataclass(frozen=True, slots=True, eq=False)
class BareRim:
    """Circular opening of a flat face.

    Attributes:
        centre: centre in the part frame ``(3,)`` [m].
        normal: outward normal of the face ``(3,)``.
        radius: radius [m].
        face: index into :attr:`Part.faces`.
        residual: largest distance of a corner from the circle [m].
    """

    centre: Vectors
    normal: Vectors
    radius: float
    face: int
    residual: float


def bare_rims(part: Part) -> list[BareRim]:
    """Return the circular openings in flat faces of an open surface, each once; none for a closed one.

    Args:
        part: the part.
    """
    if part.closed:
        return []
    found = list[BareRim]()
    for row, face in enumerate(part.planes.faces):
        normal, origin = part.planes.normals[row], part.planes.Ts_part_feature[row, :3, 3]
        free = _free_edges(part, int(face), normal, origin)
        for rim in _circles(part, free, normal, int(face)):
            if all(np.linalg.norm(rim.centre - other.centre) > _ROUND * rim.radius for other in found):
                found.append(rim)
    return found


def _free_edges(part: Part, face: int, normal: Vectors, origin: Vectors) -> IntArray:
    """Return the edges at which a flat face ends without meeting a face of another plane ``(E, 2)``."""
    counted, edges, rows = _edges(part.triangles)
    mine = part.triangle_face == face
    inner = np.bincount(rows[np.repeat(mine, 3)], minlength=len(edges))
    off = np.abs((part.vertices[part.triangles] - origin) @ normal).max(axis=1)
    beside = np.bincount(rows[np.repeat(off > 1e-6 * part.diagonal, 3)], minlength=len(edges))
    return edges[(inner == 1) & (beside == 0) & (counted > 0)]


def _edges(triangles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Return how often each edge occurs, the edges, and the edge of each side of each triangle."""
    sides = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, rows, counted = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    return counted, edges, rows.reshape(-1)


def _circles(part: Part, edges: IntArray, normal: Vectors, face: int) -> list[BareRim]:
    """Return the loops of edges that are circles, without the outline of the face."""
    if not len(edges):
        return []
    used, ends = np.unique(edges, return_inverse=True)
    ends = ends.reshape(-1, 2)
    labels, points = components(len(used), ends[:, 0], ends[:, 1]), part.vertices[used]
    spans = [float(np.linalg.norm(np.ptp(points[labels == k], axis=0))) for k in range(labels.max() + 1)]
    found = list[BareRim]()
    for k in range(labels.max() + 1):
        loop = points[labels == k]
        closed = np.count_nonzero(labels[ends[:, 0]] == k) == len(loop)
        if k == int(np.argmax(spans)) or len(loop) < _LEAST or not closed:
            continue
        centre, radius = _circle_of(loop, normal)
        off = np.abs(np.linalg.norm(loop - centre, axis=1) - radius)
        if off.max() < _ROUND * radius:
            found.append(BareRim(centre, normal, radius, face, float(off.max())))
    return found


def _circle_of(points: Vectors, normal: Vectors) -> tuple[FloatArray, float]:
    """Return centre and radius of the circle through points of a plane (Kasa 1976)."""
    middle = points.mean(axis=0)
    across = np.linalg.svd(normal[None])[2][1:]
    x = (points - middle) @ across.T
    solution = np.linalg.lstsq(np.column_stack([2 * x, np.ones(len(x))]), np.sum(x * x, axis=1), rcond=None)[0]
    radius = float(np.sqrt(max(solution[2] + solution[:2] @ solution[:2], 0.0)))
    return middle + solution[:2] @ across, radius
