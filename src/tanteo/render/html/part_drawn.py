"""A part as triangles and lines that a browser can draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts import Part, Surface
from tanteo.parts.readers import mesh_edges

_MOST_TRIANGLES, _MOST_LINES = 40_000, 12_000
"""Largest numbers for all parts of a page together, which limit the page to about 2 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Mesh and edges of a part for a browser, part frame.

    Attributes:
        vertices: vertices ``(V, 3)`` [m].
        triangles: indices of their vertices ``(T, 3)``.
        lines: edges between faces ``(L, 2, 3)`` [m].
        coarse: whether the mesh is coarser than that of the part.
    """

    vertices: FloatArray
    triangles: IntArray
    lines: FloatArray
    coarse: bool


def draw_part(part: Part, share: int = 1) -> Drawn:
    """Return mesh and edges of a part, simplified if they are too large for a page.

    Args:
        part: part to draw.
        share: number of parts on the page, which share the limits of size.
    """
    vertices, triangles = part.vertices, part.triangles
    max_measurements = _MOST_TRIANGLES // share
    cells = 256
    while len(triangles) > max_measurements:
        vertices, triangles = _clustered(part, cells)
        cells = cells * 3 // 4
    return Drawn(vertices, triangles, _lines(part)[: _MOST_LINES // share], len(part.triangles) > max_measurements)


def _clustered(part: Part, cells: int) -> tuple[FloatArray, IntArray]:
    """Return the mesh with the vertices of each grid cell merged and degenerate triangles removed."""
    low, size = part.box[0], float((part.box[1] - part.box[0]).max())
    key = np.floor((part.vertices - low) / size * cells).astype(np.int64) @ [1, 4096, 4096**2]
    _, cell = np.unique(key, return_inverse=True)
    count = np.bincount(cell)
    vertices = np.stack([np.bincount(cell, part.vertices[:, k]) / count for k in range(3)], axis=1)
    triangles = cell[part.triangles]
    a, b, c = triangles.T
    return vertices, triangles[(a != b) & (b != c) & (c != a)]


def _lines(part: Part) -> FloatArray:
    """Return the edges of the mesh between faces of the part, sharpest first ``(L, 2, 3)`` [m]."""
    edges, normals = mesh_edges(part.triangles), Surface(part.vertices, part.triangles).normals
    between = (part.triangle_face[edges.left] != part.triangle_face[edges.right]) | edges.rims
    cosines = np.sum(normals[edges.left] * normals[edges.right], axis=1)[between]
    return part.vertices[edges.ends[between]][np.argsort(cosines, kind="stable")]
