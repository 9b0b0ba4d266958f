"""Find facets of a mesh, which are connected triangles in one plane, and the angles between adjacent facets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors
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


_FEWEST_DIGITS = 5
"""Definition: fewest significant digits that count as rounded: four decimals of a part of 1 mm, three of 10 mm. With
fewer, coordinates are as likely exact, as those of a design in fractions of an inch."""

_SLIVER, _DIRECTED = 0.02, 0.25
"""Numerical: rounding step of single precision over the height of a triangle above which it is a sliver, and rounding
step over the height below which the normal of a sliver is compared with that of others."""

_IN_PLANE = 4.0
"""Definition: distance of a corner from a plane over the rounding step, up to which rounding explains it: half a
diagonal of a step for the corner, and about as much each for the place, the direction and the extent of the plane."""

_SOME = 1000
"""Numerical: number of coordinates that are examined first."""

_WHOLE = 1e-6
"""Numerical: deviation of a multiple from a whole number in double precision, at up to ten million steps."""

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


def rounding_of(coordinates: FloatArray) -> float:
    """Return the step of the decimals or significant digits to which a file rounds its coordinates, in their unit.

    It is 0 where that of single precision is larger, and where the largest coordinate has fewer than five digits.

    Args:
        coordinates: coordinates of all vertices ``(V, 3)``.
    """
    sizes = np.abs(coordinates).reshape(-1)
    largest = float(sizes.max(initial=0.0))
    if largest == 0.0:
        return 0.0
    some = sizes[:: max(len(sizes) // _SOME, 1)]
    decade = int(np.floor(np.log10(largest)))
    for digits in range(_FEWEST_DIGITS, 8):
        step = 10.0 ** (decade + 1 - digits)
        if step > FLOAT32 * largest and _rounded(some, step, decade) and _rounded(sizes, step, decade):
            return step
    return 0.0


def _rounded(sizes: FloatArray, step: float, decade: int) -> bool:
    """Return whether sizes are multiples of a step, or have as many digits as one of the largest decade then has."""
    decades = np.floor(np.log10(np.maximum(sizes, 1e-300)))
    finer = step * 10.0 ** np.minimum(decades - decade, 0.0)
    return any(bool((np.abs(sizes / own - np.round(sizes / own)) < _WHOLE).all()) for own in (step, finer))


def find_facets(vertices: FloatArray, triangles: IntArray, edges: MeshEdges, rounding: float = 0.0) -> MeshFacets:
    """Return the facets of a mesh.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
        edges: edges of the mesh.
        rounding: step to which the file rounds coordinates [m]; 0 for that of single precision.
    """
    normals, areas = triangle_geometry(vertices, triangles)
    labels = _flat_components(vertices, triangles, edges, normals, areas, rounding)
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
    vertices: FloatArray, triangles: IntArray, edges: MeshEdges, normals: FloatArray, areas: FloatArray, rounding: float
) -> IntArray:
    """Label connected triangles in one plane; slivers join the adjacent triangle in whose plane they lie."""
    heights = 2.0 * areas / np.maximum(longest_sides(vertices, triangles), 1e-300)
    noise = FLOAT32 * np.abs(vertices).max()
    blur = noise / np.maximum(heights, 1e-300)
    # the normals of two triangles with such heights may differ by more than the angle of one plane
    sliver = (blur > _SLIVER) | (2.0 * rounding > _FLAT_ANGLE * heights)
    allowed = _FLAT_ANGLE + 2.0 * np.maximum(blur[edges.left], blur[edges.right])
    level = angles_between(normals, edges.left, edges.right) < allowed
    flat = level & ~sliver[edges.left] & ~sliver[edges.right]
    labels = components(len(triangles), edges.left[flat], edges.right[flat])
    labels, bent = _without_bent(labels, normals, areas, blur, ~sliver)
    solid = (areas * ~sliver)[:, None] * normals
    step = max(rounding, float(noise))
    undirected = heights * _DIRECTED < step
    waiting = sliver & ~bent
    facing = _facet_normals(labels, solid)
    for limit, some in ((_IN_PLANE * step, sliver), (np.inf, undirected)):
        labels, left_over = _attached(vertices, triangles, edges, facing, labels, waiting & some, limit)
        waiting = (waiting & ~some) | left_over
    waiting &= ~undirected  # faces as narrow as slivers, as the rim of a sheet
    thin = level & waiting[edges.left] & waiting[edges.right]
    labels = compacted(labels)[1]
    labels = components(int(labels.max()) + 1, labels[edges.left[thin]], labels[edges.right[thin]])[labels]
    labels, _ = _without_bent(labels, normals, areas, blur, waiting)
    return _joined_through(compacted(labels)[1], edges, solid, sliver & ~bent)


def _without_bent(
    labels: IntArray, normals: Vectors, areas: FloatArray, blur: FloatArray, some: BoolArray
) -> tuple[IntArray, BoolArray]:
    """Split components that are not flat into single triangles: a chain of small angles can follow a rounding.

    Args:
        labels: component of each triangle ``(T,)``.
        normals: normals of the triangles ``(T, 3)``.
        areas: areas of the triangles ``(T,)``.
        blur: error of each normal by rounding ``(T,)`` [rad].
        some: mask of the triangles that decide ``(T,)``.

    Returns:
        New labels, and mask of the triangles that are split.
    """
    off = np.linalg.norm(normals - _facet_normals(labels, areas[:, None] * normals), axis=1)
    bent: BoolArray = np.isin(labels, labels[(off > 2.0 * _FLAT_ANGLE + 4.0 * blur) & some])
    return np.where(bent, int(labels.max()) + 1 + np.arange(len(labels)), labels), bent


def _facet_normals(labels: IntArray, weighted: FloatArray) -> FloatArray:
    """Return the normal of the facet of each triangle from normals weighted by area ``(T, 3)``; zero for no area."""
    rows, index = compacted(labels)
    normals = np.stack([np.bincount(index, weighted[:, k], len(rows)) for k in range(3)], axis=1)
    return (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))[index]


def _joined_through(labels: IntArray, edges: MeshEdges, weighted: FloatArray, slivers: BoolArray) -> IntArray:
    """Unite facets of one plane that only slivers join.

    Args:
        labels: facet of each triangle ``(T,)``.
        edges: edges of the mesh.
        weighted: normals of the triangles times their areas; zero for slivers ``(T, 3)``.
        slivers: slivers that may join facets ``(T,)``.
    """
    normals = _facet_normals(labels, weighted)
    beside = slivers[edges.left] | slivers[edges.right]
    left, right = edges.left[beside], edges.right[beside]
    solid: BoolArray = np.any(normals != 0.0, axis=1)
    flat = (angles_between(normals, left, right) < _FLAT_ANGLE) & solid[left] & solid[right]
    return compacted(components(int(labels.max()) + 1, labels[left[flat]], labels[right[flat]])[labels])[1]


def _attached(
    vertices: FloatArray,
    triangles: IntArray,
    edges: MeshEdges,
    facing: FloatArray,
    labels: IntArray,
    waiting: BoolArray,
    limit: float,
) -> tuple[IntArray, BoolArray]:
    """Give waiting slivers the label of the adjacent facet from whose plane they deviate least, up to a limit.

    Slivers that have a label pass it on.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
        edges: edges of the mesh.
        facing: normal of the facet of each triangle ``(T, 3)``; slivers get that of their facet.
        labels: facet of each triangle ``(T,)``.
        waiting: slivers without a facet ``(T,)``.
        limit: largest deviation of a corner from the plane [m].

    Returns:
        Labels, and slivers that still have no facet.
    """
    slivers, hosts = np.concatenate([edges.left, edges.right]), np.concatenate([edges.right, edges.left])
    labels, waiting = labels.copy(), waiting.copy()
    while True:
        open_pairs = waiting[slivers]
        slivers, hosts = slivers[open_pairs], hosts[open_pairs]
        ready = ~waiting[hosts]
        own, by = slivers[ready], hosts[ready]
        slivers, hosts = slivers[~ready], hosts[~ready]
        offsets = vertices[triangles[own]] - vertices[triangles[by, 0]][:, None]
        leave = np.abs(np.einsum("nki,ni->nk", offsets, facing[by])).max(axis=1, initial=0.0)
        order = np.lexsort((leave, own))
        order = order[leave[order] <= limit]
        if not len(order):
            return labels, waiting
        first, at = np.unique(own[order], return_index=True)
        chosen = by[order[at]]
        labels[first], facing[first], waiting[first] = labels[chosen], facing[chosen], False
