"""Find the borders of faces: sharp edges of a mesh and the corners where they meet, with the adjacent faces.

A reading near an edge may belong to either face, and each face receives only the truncated-normal mass of the noise on
it. Far from every edge the noise does not reach the border, and a face can be treated as a plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors
from tanteo.parts.shapes.junctions import SHARP, Junctions, at_corner, at_edges
from tanteo.parts.shapes.surface import Surface

_CELLS = 24
"""Number of distance-grid cells along the longest side."""


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Sharp edges of a mesh with a search structure for the nearest one.

    Attributes:
        vertices: vertices of the mesh ``(V, 3)`` [m].
        edges: vertex pairs of the sharp edges ``(E, 2)``.
        junctions: junctions of the edges, followed by those of the corners ``(E + C, ...)``.
        corners: junction row of each vertex ``(V,)``; -1 for a vertex that is not a corner.
        narrowest: smallest width of the faces at each junction ``(E + C,)`` [m].
    """

    vertices: FloatArray
    edges: IntArray
    junctions: Junctions
    corners: IntArray
    narrowest: FloatArray
    _tree: Any
    _origin: FloatArray
    _step: float
    _grid: FloatArray

    def near(self, points: Vectors, reach: FloatArray) -> BoolArray:
        """Return whether an edge may be within reach; False is always correct.

        Args:
            points: points in the mesh frame ``(*batch, 3)`` [m].
            reach: distances ``(*batch,)`` [m].
        """
        if not len(self.edges):
            return np.zeros(np.shape(points)[:-1], dtype=bool)
        shape = np.array(self._grid.shape)
        local = (points - self._origin) / self._step
        cell = np.clip(np.rint(local), 0, shape - 1)
        index = ((cell[..., 0] * shape[1] + cell[..., 1]) * shape[2] + cell[..., 2]).astype(np.int64)
        away = self._step * np.sqrt(np.sum((local - cell) ** 2, axis=-1))
        beyond = self._step * np.sqrt(np.sum(np.maximum(np.maximum(-local, local - shape + 1), 0.0) ** 2, axis=-1))
        return np.asarray(np.maximum(self._grid.ravel()[index] - away, beyond) <= reach)

    def nearest(self, points: Vectors, reach: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return the junction nearest to each point.

        A corner if one is within reach of the nearest edge point, else the edge.

        Args:
            points: points in the mesh frame ``(n, 3)`` [m].
            reach: distances ``(n,)`` [m].

        Returns:
            Distance from the edge [m], and row of :attr:`junctions`.
        """
        squared, edge, foot = self._tree.squared_distance(self.vertices, self.edges, np.ascontiguousarray(points))
        edge = np.asarray(edge, dtype=np.int64).reshape(-1)
        ends = self.edges[edge]
        gaps = np.linalg.norm(self.vertices[ends] - np.asarray(foot)[:, None], axis=-1)
        corner = np.where(gaps < reach[:, None], self.corners[ends], -1)
        closer = np.take_along_axis(corner, np.argmin(np.where(corner >= 0, gaps, np.inf), axis=1)[:, None], axis=1)
        rows = np.where(closer[:, 0] >= 0, closer[:, 0], edge)
        return np.sqrt(np.maximum(np.asarray(squared).reshape(-1), 0.0)), rows


def borders(surface: Surface) -> Borders:
    """Return the sharp edges of a mesh with the faces at edges and corners.

    Args:
        surface: mesh; edges without exactly two triangles are ignored.
    """
    edges, sides = _sharp_edges(surface)
    smooth = _smooth_faces(surface, edges)
    junctions = [at_edges(surface, edges, sides, smooth)]
    corners = np.full(len(surface.vertices), -1)
    valence = np.bincount(edges.ravel(), minlength=len(surface.vertices))
    incident = _incident(surface, np.flatnonzero(valence >= 3))
    sharp = {(int(a), int(b)) for a, b in edges}
    for vertex, triangles in incident.items():
        found = at_corner(surface, vertex, triangles, sharp, smooth)
        if found is not None:
            corners[vertex] = sum(len(j.offsets) for j in junctions)
            junctions.append(found)
    joined = Junctions.joined(junctions)
    widths = np.where(np.any(joined.inward != 0, axis=-1), joined.widths, np.inf).min(axis=(1, 2))
    return Borders(surface.vertices, edges, joined, corners, widths, *_searchable(surface.vertices, edges))


def _searchable(vertices: FloatArray, edges: IntArray) -> tuple[Any, FloatArray, float, FloatArray]:
    """Return a search tree of the edges, and the distances from them on a grid: origin, step and values."""
    import igl  # slow to import

    tree = igl.AABB()
    low = vertices.min(axis=0)
    high = vertices.max(axis=0)
    step = float((high - low).max()) / _CELLS
    if not len(edges):
        return tree, low, step, np.full((1, 1, 1), np.inf)
    tree.init(vertices, edges)
    shape = np.ceil((high - low) / step).astype(int) + 3
    origin = low - step
    axes = [origin[k] + step * np.arange(shape[k]) for k in range(3)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    squared, _, _ = tree.squared_distance(vertices, edges, np.ascontiguousarray(centres))
    return tree, origin, step, np.sqrt(np.maximum(np.asarray(squared), 0.0)).reshape(shape)


def _sharp_edges(surface: Surface) -> tuple[IntArray, IntArray]:
    """Return vertices ``(E, 2)`` and the two triangles ``(E, 2)`` of the sharp edges."""
    T = surface.triangles
    ends = np.sort(T[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    owner = np.repeat(np.arange(len(T)), 3)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends = ends[order]
    owner = owner[order]
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    first = first[count == 2]
    sides = np.stack([owner[first], owner[first + 1]], axis=1)
    n = surface.normals[sides]
    sharp = (np.sum(n[:, 0] * n[:, 1], axis=1) < np.cos(SHARP)) & np.all(np.any(n != 0, axis=2), axis=1)
    return np.ascontiguousarray(ends[first][sharp], dtype=np.int64), sides[sharp]


def _smooth_faces(surface: Surface, sharp: IntArray) -> IntArray:
    """Return the smooth face number of each triangle ``(T,)``: faces are connected across edges that are not sharp."""
    from scipy.sparse import coo_array  # slow to import
    from scipy.sparse.csgraph import connected_components

    T = surface.triangles
    V = len(surface.vertices)
    ends = np.sort(T[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    keys = ends[:, 0] * V + ends[:, 1]
    owner = np.repeat(np.arange(len(T)), 3)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    owner = owner[order]
    joined = (keys[1:] == keys[:-1]) & ~np.isin(keys[1:], sharp[:, 0] * V + sharp[:, 1])
    a = owner[:-1][joined]
    b = owner[1:][joined]
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(T), len(T)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _incident(surface: Surface, vertices: IntArray) -> dict[int, IntArray]:
    """Return the triangles at each of the given vertices."""
    chosen = np.isin(surface.triangles, vertices)
    rows, columns = np.nonzero(chosen)
    at = surface.triangles[rows, columns]
    order = np.argsort(at, kind="stable")
    names, starts = np.unique(at[order], return_index=True)
    if not len(names):
        return {}
    return {int(v): some for v, some in zip(names, np.split(rows[order], starts[1:]), strict=True)}
