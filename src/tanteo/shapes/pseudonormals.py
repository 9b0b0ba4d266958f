"""Compute angle-weighted normals at edges and vertices, whose sign separates inside from outside.

Source: Baerentzen and Aanaes 2005, "Signed distance computation using the angle weighted pseudonormal".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.typing import FloatArray, IntArray, Vectors

_ON_BORDER = 1e-6
"""Barycentric coordinate below which a point counts as lying on an edge or vertex of its triangle."""


@dataclass(frozen=True, slots=True, eq=False)
class Pseudonormals:
    """Barycentric coordinates of each triangle, and normals for its interior, three edges and three vertices.

    Attributes:
        slopes: gradients of the weights of the second and third vertex ``(T, 2, 3)`` [1/m].
        offsets: values of these weights at the origin ``(T, 2)``.
        table: unnormalized normals ``(T, 8, 3)``; bit ``k`` of the column is set if the weight of vertex ``k`` is zero.
    """

    slopes: FloatArray
    offsets: FloatArray
    table: FloatArray

    def at(self, points: Vectors, triangles: IntArray) -> Vectors:
        """Return pseudonormals ``(*batch, 3)`` at surface points.

        Args:
            points: points on the surface ``(*batch, 3)`` [m].
            triangles: triangles of the points ``(*batch,)``.
        """
        weights = (self.slopes[triangles] @ points[..., None])[..., 0] + self.offsets[triangles]
        first = 1.0 - weights[..., 0] - weights[..., 1] < _ON_BORDER
        border = first + 2 * (weights[..., 0] < _ON_BORDER) + 4 * (weights[..., 1] < _ON_BORDER)
        return np.asarray(self.table.reshape(-1, 3)[8 * triangles + border])


def pseudonormals(vertices: FloatArray, triangles: IntArray, normals: FloatArray) -> Pseudonormals | None:
    """Return the pseudonormals of a mesh; None if an edge does not have exactly two triangles.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
        normals: unit normals of the triangles ``(T, 3)``.
    """
    edges = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    _, edge, count = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True, return_counts=True)
    corners = vertices[triangles]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = np.cross(u, v)
    squared = np.sum(n * n, axis=1)
    if np.any(count != 2) or np.any(squared == 0.0):
        return None
    slopes = np.stack([np.cross(v, n), np.cross(n, u)], axis=1) / squared[:, None, None]
    along_edges = _sums(edge, np.repeat(normals, 3, axis=0))[edge].reshape(-1, 3, 3)
    weighted = (_angles(corners)[..., None] * normals[:, None]).reshape(-1, 3)
    at_corners = _sums(triangles.ravel(), weighted, len(vertices))[triangles]
    e, c = along_edges.transpose(1, 0, 2), at_corners.transpose(1, 0, 2)
    table = np.stack([normals, e[0], e[1], c[2], e[2], c[1], c[0], normals], axis=1)
    return Pseudonormals(slopes, -np.einsum("tki,ti->tk", slopes, corners[:, 0]), table)


def _angles(corners: FloatArray) -> FloatArray:
    """Return the angles of triangles ``(T, 3)`` [rad]."""
    a = np.roll(corners, -1, axis=1) - corners
    b = np.roll(corners, 1, axis=1) - corners
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def _sums(index: IntArray, rows: FloatArray, count: int = 0) -> FloatArray:
    """Return sums of rows ``(m, 3)`` by index."""
    return np.stack([np.bincount(index, weights=rows[:, k], minlength=count) for k in range(3)], axis=1)
