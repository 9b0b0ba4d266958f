"""Find facets of a mesh, which are connected triangles in one plane, and the angles between adjacent facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts.readers.topology import (
    MeshEdges,
    angles_between,
    compacted,
    components,
    longest_sides,
    middles_and_volumes,
    triangle_geometry,
    unique_rows,
)

FLOAT32 = 1.2e-7
"""Relative rounding error of a coordinate in single precision."""

_FLAT_ANGLE = 2e-3
"""Angle between triangles below which they lie in one plane [rad]."""


_BLOCK = 100_000
"""Numerical: number of links that are compared at a time, which bounds the memory."""


@dataclass(frozen=True, slots=True, eq=False)
class MeshFacets:
    """Planar facets of a mesh, with one link for each pair that shares mesh edges.

    Attributes:
        of_triangle: facet of each triangle ``(T,)``.
        normals: outward unit normals ``(F, 3)``.
        areas: areas ``(F,)`` [m^2].
        centres: centroids ``(F, 3)`` [m].
        counts: number of triangles of each facet ``(F,)``.
        links: pairs of adjacent facets, the lower number first ``(L, 2)``.
        angles: angles between their normals ``(L,)`` [rad].
        lengths: lengths of their common border ``(L,)`` [m].
        convex: mask of links at which the part is convex ``(L,)``.
    """

    of_triangle: IntArray
    normals: FloatArray
    areas: FloatArray
    centres: FloatArray
    counts: IntArray
    links: IntArray
    angles: FloatArray
    lengths: FloatArray
    convex: BoolArray


def find_facets(vertices: FloatArray, triangles: IntArray, edges: MeshEdges) -> MeshFacets:
    """Return the facets of a mesh.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
        edges: edges of the mesh.
    """
    normals, areas = triangle_geometry(vertices, triangles)
    labels = _flat_components(vertices, triangles, edges, normals, areas)
    count = int(labels.max()) + 1
    total: FloatArray = np.bincount(labels, areas, count).astype(np.float64)
    summed = np.stack([np.bincount(labels, areas * normals[:, k], count) for k in range(3)], axis=1)
    middle, _ = middles_and_volumes(vertices, triangles, np.zeros(3))
    centres = np.stack([np.bincount(labels, areas * middle[:, k], count) for k in range(3)], axis=1)
    facet_normals = summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300)
    facet_centres = centres / np.maximum(total, 1e-300)[:, None]
    # one link for each pair of adjacent facets
    left = labels[edges.left]
    right = labels[edges.right]
    between = left != right
    pairs = np.sort(np.stack([left, right], axis=1)[between], axis=1)
    sides = np.linalg.norm(np.diff(vertices[edges.ends[between]], axis=1)[:, 0], axis=1)
    rows, index = unique_rows(pairs)
    links = pairs[rows]
    lengths: FloatArray = np.bincount(index, sides, len(links)).astype(np.float64)
    angles = angles_between(facet_normals, links[:, 0], links[:, 1])
    # Convex where each facet lies behind the other's plane.
    convex = np.zeros(len(links), dtype=np.bool_)
    for start in range(0, len(links), _BLOCK):
        a, b = links[start : start + _BLOCK].T
        ahead = facet_centres[b] - facet_centres[a]
        convex[start : start + _BLOCK] = np.einsum("ni,ni->n", facet_normals[a] - facet_normals[b], ahead) < 0.0
    counts = np.bincount(labels, minlength=count)
    return MeshFacets(labels, facet_normals, total, facet_centres, counts, links, angles, lengths, convex)


def _flat_components(
    vertices: FloatArray, triangles: IntArray, edges: MeshEdges, normals: FloatArray, areas: FloatArray
) -> IntArray:
    """Label connected triangles in one plane; slivers join the adjacent triangle in whose plane they lie."""
    heights = 2.0 * areas / np.maximum(longest_sides(vertices, triangles), 1e-300)
    noise = FLOAT32 * np.abs(vertices).max()
    blur = noise / np.maximum(heights, 1e-300)
    sliver = blur > 0.02
    allowed = _FLAT_ANGLE + 2.0 * np.maximum(blur[edges.left], blur[edges.right])
    flat = (angles_between(normals, edges.left, edges.right) < allowed) & ~sliver[edges.left] & ~sliver[edges.right]
    labels = components(len(triangles), edges.left[flat], edges.right[flat])
    # A chain of small angles can follow a rounding: a component that is not flat is split into single triangles.
    mean = np.stack([np.bincount(labels, areas * normals[:, k]) for k in range(3)], axis=1)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    off = np.linalg.norm(normals - mean[labels], axis=1) > 2.0 * _FLAT_ANGLE + 4.0 * blur
    bent = np.isin(labels, labels[off & ~sliver])
    labels = np.where(bent, len(triangles) + np.arange(len(triangles)), labels)
    waiting = sliver & ~bent
    while waiting.any():
        labels, left_over = _attach(vertices, triangles, edges, normals, labels, waiting)
        if left_over.sum() == waiting.sum():
            break
        waiting = left_over
    return _joined_through(compacted(labels)[1], edges, (areas * ~sliver)[:, None] * normals, sliver & ~bent)


def _joined_through(labels: IntArray, edges: MeshEdges, weighted: FloatArray, slivers: BoolArray) -> IntArray:
    """Unite facets of one plane that only slivers join.

    Args:
        labels: facet of each triangle ``(T,)``.
        edges: edges of the mesh.
        weighted: normals of the triangles times their areas; zero for slivers ``(T, 3)``.
        slivers: slivers that may join facets ``(T,)``.
    """
    count = int(labels.max()) + 1
    normals = np.stack([np.bincount(labels, weighted[:, k], count) for k in range(3)], axis=1)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    beside = slivers[edges.left] | slivers[edges.right]
    left, right = labels[edges.left[beside]], labels[edges.right[beside]]
    flat = angles_between(normals, left, right) < _FLAT_ANGLE
    return compacted(components(count, left[flat], right[flat])[labels])[1]


def _attach(
    vertices: FloatArray,
    triangles: IntArray,
    edges: MeshEdges,
    normals: FloatArray,
    labels: IntArray,
    waiting: BoolArray,
) -> tuple[IntArray, BoolArray]:
    """Give each waiting sliver the label of the adjacent triangle from whose plane it deviates least."""
    slivers = np.concatenate([edges.left, edges.right])
    hosts = np.concatenate([edges.right, edges.left])
    usable = waiting[slivers] & ~waiting[hosts]
    slivers = slivers[usable]
    hosts = hosts[usable]
    offsets = vertices[triangles[slivers]] - vertices[triangles[hosts, 0]][:, None]
    leave = np.abs(np.einsum("nki,ni->nk", offsets, normals[hosts])).max(axis=1)
    order = np.lexsort((leave, slivers))
    first, at = np.unique(slivers[order], return_index=True)
    labels = labels.copy()
    waiting = waiting.copy()
    labels[first] = labels[hosts[order][at]]
    waiting[first] = False
    return labels, waiting
