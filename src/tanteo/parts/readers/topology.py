"""Compute the connectivity of a mesh: triangles at edges, connected components, and face assignments."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts.faces.elements import SurfaceKind


@dataclass(frozen=True, slots=True, eq=False)
class MeshEdges:
    """Edges of a consistently wound mesh with at most two triangles per edge.

    Attributes:
        ends: vertex indices, the lower one first ``(N, 2)``.
        left: triangle that contains the edge from first to second end ``(N,)``, to the left of that direction seen from
            outside.
        right: triangle that contains the reversed edge ``(N,)``; at a rim, where the surface ends, the only triangle is
            both.
    """

    ends: IntArray
    left: IntArray
    right: IntArray

    @property
    def rims(self) -> BoolArray:
        """Mask of the edges where the surface ends ``(N,)``."""
        return np.asarray(self.left == self.right)


def unique_rows(rows: FloatArray | IntArray) -> tuple[IntArray, IntArray]:
    """Return the first of each set of equal rows, in lexicographic order of the rows, and the set of each row.

    Equal to ``np.unique(rows, axis=0)`` with both indices. Here each column is ranked, and the ranks of a row are one
    integer, which the core sorts by its digits.

    Args:
        rows: rows of numbers ``(n, k)``; -0 equals 0.

    Returns:
        Index of the first row of each set ``(m,)``, and the set of each row ``(n,)``.
    """
    sets = np.zeros(len(rows), dtype=np.int64)
    for column in rows.T:
        if np.issubdtype(rows.dtype, np.integer) and len(rows):
            ranks, count = column - column.min(), int(column.max()) - int(column.min()) + 1
        else:
            bits = (column + 0.0).astype(np.float64).view(np.int64)
            ranks = _core.key_sets(np.where(bits < 0, bits ^ np.iinfo(np.int64).max, bits))[1]
            count = int(ranks.max(initial=0)) + 1
        if (int(sets.max(initial=0)) + 1) * count > np.iinfo(np.int64).max:
            sets = _core.key_sets(sets)[1]
        sets = sets * count + ranks
    return _core.key_sets(np.ascontiguousarray(sets, dtype=np.int64))


def first_rows(labels: IntArray) -> IntArray:
    """Return the first row with each label ``(m,)``.

    Args:
        labels: labels from 0, numbered by their first row ``(n,)``.
    """
    return np.flatnonzero(np.diff(np.maximum.accumulate(labels), prepend=-1))


def compacted(indices: IntArray) -> tuple[IntArray, IntArray]:
    """Return the indices that occur, in ascending order, and the position of each given index among them.

    Equal to ``np.unique`` with the inverse, for indices of an array, without sorting.

    Args:
        indices: indices from 0, of any shape.

    Returns:
        Indices that occur ``(m,)``, and positions in the shape of ``indices``.
    """
    used = np.zeros(int(indices.max(initial=-1)) + 1, dtype=np.bool_)
    used[indices] = True
    return np.flatnonzero(used), (np.cumsum(used) - 1)[indices]


def directed_edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the directed edges ``(3T, 2)`` and the triangle of each ``(3T,)``.

    Args:
        triangles: vertex indices ``(T, 3)``.
    """
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return edges, np.tile(np.arange(len(triangles)), 3)


def edge_counts(triangles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Count how often each undirected edge occurs forwards and backwards.

    Args:
        triangles: vertex indices ``(T, 3)``.

    Returns:
        Ends ``(N, 2)`` (lower index first) and the two counts ``(N,)``. A closed, consistently wound manifold has 1 and
        1 everywhere.
    """
    ends, ahead, back, _, _ = _edge_table(triangles)
    return ends, ahead, back


def mesh_edges(triangles: IntArray) -> MeshEdges:
    """Return the edges of a consistently wound mesh with their adjacent triangles.

    Args:
        triangles: vertex indices ``(T, 3)``.
    """
    ends, ahead, back, left, right = _edge_table(triangles)
    assert (ahead < 2).all(), "an edge is run through twice in one direction"
    assert (back < 2).all(), "an edge is run through twice in one direction"
    return MeshEdges(ends, np.where(left < 0, right, left), np.where(right < 0, left, right))


def _edge_table(triangles: IntArray) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray]:
    rows = np.ascontiguousarray(triangles, dtype=np.int64)
    return _core.edge_table(rows, int(rows.max(initial=-1)) + 1)


def components(count: int, first: IntArray, second: IntArray) -> IntArray:
    """Label the connected components of a graph with links ``first[i]``-``second[i]``.

    Args:
        count: number of nodes.
        first: first node of each link.
        second: second node of each link.

    Returns:
        Labels from 0, numbered by their lowest node ``(count,)``.
    """
    first, second = (np.ascontiguousarray(nodes, dtype=np.int64) for nodes in (first, second))
    return _core.components(count, first, second)


def near_groups(points: FloatArray, distance: float) -> IntArray:
    """Label points closer than a distance, including chains of them; labels are numbered by their first point.

    Args:
        points: points ``(n, 3)``.
        distance: largest distance within a group.
    """
    pairs = _core.near_pairs(np.ascontiguousarray(points, dtype=np.float64), distance)
    return components(len(points), pairs[:, 0], pairs[:, 1])


def triangle_geometry(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return unit normals ``(T, 3)`` (zero for a triangle without area) and areas ``(T,)`` [m^2].

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
    """
    corners = np.ascontiguousarray(triangles, dtype=np.int64)
    return _core.triangle_geometry(np.ascontiguousarray(vertices, dtype=np.float64), corners)


def longest_sides(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the length of the longest side of each triangle ``(T,)`` [m].

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
    """
    corners = np.ascontiguousarray(triangles, dtype=np.int64)
    return _core.longest_sides(np.ascontiguousarray(vertices, dtype=np.float64), corners)


def angles_between(normals: FloatArray, left: IntArray, right: IntArray) -> FloatArray:
    """Return the angle between the normals of each pair ``(N,)`` [rad].

    Args:
        normals: unit normals ``(T, 3)``.
        left: row of the first normal of each pair ``(N,)``.
        right: row of the second ``(N,)``.
    """
    first, second = (np.ascontiguousarray(rows, dtype=np.int64) for rows in (left, right))
    return _core.angles_between(np.ascontiguousarray(normals, dtype=np.float64), first, second)


def volume_and_centroid(vertices: FloatArray, triangles: IntArray) -> tuple[float, FloatArray]:
    """Return the signed volume [m^3] and the centre of volume [m] of a closed mesh.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
    """
    origin = vertices.mean(axis=0)
    middles, volumes = middles_and_volumes(vertices, triangles, origin)
    total = float(volumes.sum())
    if total == 0.0:
        return 0.0, origin
    middles -= origin
    return total, origin + 0.75 * (volumes @ middles) / total


def middles_and_volumes(vertices: FloatArray, triangles: IntArray, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middle of each triangle ``(T, 3)`` [m], and the signed volume of its tetrahedron ``(T,)`` [m^3].

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
        origin: fourth corner of all tetrahedra ``(3,)`` [m]. The volumes of a closed mesh sum to its own [m^3].
    """
    corners = np.ascontiguousarray(triangles, dtype=np.int64)
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    return _core.middles_and_volumes(points, corners, np.ascontiguousarray(origin, dtype=np.float64))


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """Mesh whose triangles are assigned to faces, before features are extracted.

    Attributes:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``, outward.
        triangle_face: index into ``kinds`` of each triangle ``(T,)``.
        kinds: surface kind of each face with the fields of :class:`Face` that describe it.
        round_edges: mesh edges (lower vertex first) that are chords of a curved edge ``(R, 2)``; None if unknown, as
            for a mesh file.
        edges: edges of the mesh; None if they were not computed.
    """

    vertices: FloatArray
    triangles: IntArray
    triangle_face: IntArray
    kinds: tuple[tuple[SurfaceKind, dict[str, Any]], ...]
    round_edges: IntArray | None
    edges: MeshEdges | None = None


def scaled(draft: Draft, factor: float) -> Draft:
    """Return a mesh in another unit of length.

    Args:
        draft: mesh with its faces.
        factor: factor on all lengths.
    """
    lengths = ("axis_point", "radius", "minor_radius")
    kinds = tuple(
        (kind, {name: value * factor if name in lengths else value for name, value in fields.items()})
        for kind, fields in draft.kinds
    )
    return replace(draft, vertices=draft.vertices * factor, kinds=kinds)
