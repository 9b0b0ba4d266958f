"""Whether a mesh crosses itself: edges that pass through triangles which they do not touch."""

from __future__ import annotations

import numpy as np

from tanteo.parts.topology import mesh_edges
from tanteo.shapes import Surface
from tanteo.typing import BoolArray, FloatArray, IntArray

MOST = 300_000
"""Edges of larger meshes are not asked."""

CLEAR = 1e-5
"""How far both ends of an edge have to be from the plane of the triangle, in diagonals: what touches does not cross."""

_HITS = 4
"""Triangles along an edge that are looked at: those beside it are met first, now and then."""


def crossings(vertices: FloatArray, triangles: IntArray) -> int:
    """Count the edges that pass through triangles; those of bodies that overlap, too.

    Args:
        vertices: ``(V, 3)``.
        triangles: ``(T, 3)``.

    Returns:
        At least one if some edge crosses a triangle by a noticeable way; 0 for very large meshes.
    """
    ends = mesh_edges(triangles).ends
    if len(ends) > MOST:
        return 0
    surface = Surface(vertices, triangles)
    slack = CLEAR * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    a, b = vertices[ends[:, 0]], vertices[ends[:, 1]]
    lengths = np.linalg.norm(b - a, axis=1)
    found = np.zeros(len(ends), dtype=np.bool_)
    rows, along = np.flatnonzero(lengths > 2.0 * slack), np.full(len(ends), slack)
    for _ in range(_HITS):
        if not len(rows):
            break
        way = (b[rows] - a[rows]) / lengths[rows, None]
        hits = surface.cast(a[rows] + along[rows, None] * way, way)
        at = along[rows] + hits.distances
        inside = at < lengths[rows] - slack
        rows, at, met = rows[inside], at[inside], hits.triangles[inside]
        crossed = _crosses(surface, ends[rows], met, slack)
        found[rows[crossed]] = True
        rows, at = rows[~crossed], at[~crossed]
        along[rows] = at + slack
    return int(found.sum())


def _crosses(surface: Surface, ends: IntArray, met: IntArray, slack: float) -> BoolArray:
    """Whether edges lead from well before to well behind triangles that share no corner with them."""
    corners = surface.triangles[met]
    apart = (corners[:, :, None] != ends[:, None, :]).all(axis=(1, 2))
    offsets = np.einsum(
        "nki,ni->nk", surface.vertices[ends] - surface.vertices[corners[:, 0]][:, None], surface.normals[met]
    )
    return np.asarray(apart & (offsets.min(axis=1) < -slack) & (offsets.max(axis=1) > slack))
