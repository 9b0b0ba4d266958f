"""Detect whether a mesh intersects itself: edges that pass through triangles without touching them."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts.readers.topology import mesh_edges
from tanteo.parts.shapes.surface import Surface

MOST = 300_000
"""Largest number of edges for which the test is made."""

CLEAR = 1e-5
"""Smallest distance of both edge ends from the triangle's plane, in diagonals; smaller ones count as contact."""

_HITS = 4
"""Number of triangles tested along an edge; triangles beside the edge are sometimes hit first."""


def crossings(vertices: FloatArray, triangles: IntArray) -> int:
    """Return the number of edges that pass through triangles, including those of overlapping bodies.

    Args:
        vertices: vertices ``(V, 3)``.
        triangles: vertex indices ``(T, 3)``.

    Returns:
        At least one if some edge clearly crosses a triangle; 0 for very large meshes.
    """
    if 3 * len(triangles) > 2 * MOST:  # an edge has two triangles at most
        return 0
    ends = mesh_edges(triangles).ends
    surface = Surface(vertices, triangles)
    slack = CLEAR * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    a = vertices[ends[:, 0]]
    b = vertices[ends[:, 1]]
    lengths = np.linalg.norm(b - a, axis=1)
    found = np.zeros(len(ends), dtype=np.bool_)
    rows = np.flatnonzero(lengths > 2.0 * slack)
    along = np.full(len(ends), slack)
    for _ in range(_HITS):
        if not len(rows):
            break
        way = (b[rows] - a[rows]) / lengths[rows, None]
        hits = surface.cast(a[rows] + along[rows, None] * way, way)
        at = along[rows] + hits.distances
        inside = at < lengths[rows] - slack
        rows = rows[inside]
        at = at[inside]
        struck = hits.triangles[inside]
        crossed = _crosses(surface, ends[rows], struck, slack)
        found[rows[crossed]] = True
        rows = rows[~crossed]
        at = at[~crossed]
        along[rows] = at + slack
    return int(found.sum())


def _crosses(surface: Surface, ends: IntArray, struck: IntArray, slack: float) -> BoolArray:
    """Return whether edges run from clearly before to clearly behind triangles that share no vertex with them."""
    corners = surface.triangles[struck]
    apart = (corners[:, :, None] != ends[:, None, :]).all(axis=(1, 2))
    offsets = np.einsum(
        "nki,ni->nk",
        surface.vertices[ends] - surface.vertices[corners[:, 0]][:, None],
        surface.normals[struck],
    )
    return np.asarray(apart & (offsets.min(axis=1) < -slack) & (offsets.max(axis=1) > slack))
