"""The bookkeeping of a mesh, as arrays: which triangles share which edges, and which face each belongs to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tanteo.parts.elements import SurfaceKind
from tanteo.typing import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class MeshEdges:
    """The edges of a consistently wound mesh, of which no more than two triangles share one.

    Attributes:
        ends: ``(N, 2)``, vertex indices; the first is the lower one.
        left: ``(N,)``, triangle that runs through the edge from first to second end: it lies to the left of that
            direction, seen from outside.
        right: ``(N,)``, triangle that runs through it the other way. At a rim, where the surface ends, the only
            triangle is both.
    """

    ends: IntArray
    left: IntArray
    right: IntArray

    @property
    def rims(self) -> BoolArray:
        """``(N,)``: where the surface ends."""
        return np.asarray(self.left == self.right)


def directed_edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return the 3T directed edges ``(3T, 2)`` and the triangle ``(3T,)`` of each."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return edges, np.tile(np.arange(len(triangles)), 3)


def edge_counts(triangles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Count how often each undirected edge is run through forwards and backwards.

    Returns:
        Ends ``(N, 2)`` (lower index first) and the two counts ``(N,)``. A closed, consistently wound manifold
        has 1 and 1 everywhere.
    """
    edges, _ = directed_edges(triangles)
    ends, index = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    forward = edges[:, 0] < edges[:, 1]
    index = index.reshape(-1)
    ahead = np.bincount(index[forward], minlength=len(ends))
    back = np.bincount(index[~forward], minlength=len(ends))
    return ends, ahead, back


def mesh_edges(triangles: IntArray) -> MeshEdges:
    """Pair the triangles of a consistently wound mesh across their edges."""
    edges, owner = directed_edges(triangles)
    count = int(triangles.max(initial=0)) + 1
    forward = edges[:, 0] < edges[:, 1]
    keys, index = np.unique(edges.min(axis=1) * count + edges.max(axis=1), return_inverse=True)
    left, right = np.full(len(keys), -1), np.full(len(keys), -1)
    left[index[forward]], right[index[~forward]] = owner[forward], owner[~forward]
    assert (left >= 0).sum() + (right >= 0).sum() == len(edges), "an edge is run through twice in one direction"
    ends = np.stack([keys // count, keys % count], axis=1)
    return MeshEdges(ends, np.where(left < 0, right, left), np.where(right < 0, left, right))


def components(count: int, first: IntArray, second: IntArray) -> IntArray:
    """Label the connected components of a graph of ``count`` nodes with links ``first[i]``-``second[i]``.

    Returns:
        ``(count,)`` labels from 0, numbered by their lowest node.
    """
    root = np.arange(count)
    while True:
        a, b = root[first], root[second]
        apart = a != b
        if not apart.any():
            return np.asarray(np.unique(root, return_inverse=True)[1], dtype=np.int64)
        np.minimum.at(root, np.maximum(a, b)[apart], np.minimum(a, b)[apart])
        while np.any(root != root[root]):
            root = root[root]


def near_groups(points: FloatArray, distance: float) -> IntArray:
    """Label points that are nearer to each other than a distance, chains of them too; numbered by their first."""
    from scipy.spatial import cKDTree  # slow to import, and not needed where a part is remembered

    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    return components(len(points), pairs[:, 0], pairs[:, 1])


def triangle_geometry(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return unit normals ``(T, 3)`` (zero for a triangle without area) and areas ``(T,)`` [m^2]."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    doubled = np.linalg.norm(cross, axis=1)
    normals = np.divide(cross, doubled[:, None], out=np.zeros_like(cross), where=doubled[:, None] > 0.0)
    return normals, doubled / 2.0


def volume_and_centroid(vertices: FloatArray, triangles: IntArray) -> tuple[float, FloatArray]:
    """Return the signed volume [m^3] and the centre of volume [m] that a closed mesh encloses."""
    origin = vertices.mean(axis=0)
    a, b, c = (vertices[triangles[:, k]] - origin for k in range(3))
    volumes = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
    total = float(volumes.sum())
    if total == 0.0:
        return 0.0, origin
    return total, origin + (volumes[:, None] * (a + b + c)).sum(axis=0) / (4.0 * total)


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """A mesh whose triangles are sorted into faces, before features are taken from it.

    Attributes:
        vertices: ``(V, 3)`` [m].
        triangles: ``(T, 3)``, outward.
        triangle_face: ``(T,)``, index into ``kinds``.
        kinds: kind of each face and the fields of :class:`Face` that describe it.
        round_edges: ``(R, 2)``, mesh edges (lower vertex first) known to be chords of a curved edge; None where a
            mesh file leaves that open.
    """

    vertices: FloatArray
    triangles: IntArray
    triangle_face: IntArray
    kinds: tuple[tuple[SurfaceKind, dict[str, Any]], ...]
    round_edges: IntArray | None


def scaled(draft: Draft, factor: float) -> Draft:
    """The same in another unit of length."""
    lengths = ("axis_point", "radius", "minor_radius")
    kinds = tuple(
        (kind, {name: value * factor if name in lengths else value for name, value in fields.items()})
        for kind, fields in draft.kinds
    )
    return replace(draft, vertices=draft.vertices * factor, kinds=kinds)
