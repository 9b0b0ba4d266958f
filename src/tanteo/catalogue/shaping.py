"""Compile a part for the C++ core; the result is stored as bytes that the core reads in place."""

from __future__ import annotations

import numpy as np

from tanteo import _core
from tanteo.factors.factor import landmark_rows
from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.parts import Part
from tanteo.parts.faces import exact_faces

SHAPE = "shape8"
"""Kind and version of the compiled bytes; increase the number whenever the content of a shape changes."""

SAMPLES = 1024
"""Number of surface points from which pose proposals are made."""

_CELLS = 40
"""Number of distance-grid cells along the longest side."""

_FEW = 500
"""Number of vertices up to which all are kept as possible support points."""


def compiled_shape(part: Part) -> _core.Shape:
    """Return the compiled shape of a part for the core; this takes milliseconds.

    Args:
        part: part to compile.
    """
    corners = part.vertices[part.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    normals = across / np.maximum(lengths, 1e-300)[:, None]
    samples, rows = _spread(corners, lengths)
    curved = exact_faces(part, normals)
    profiles = np.zeros((0, 11))
    profile_rows = np.full(len(corners), -1)
    if curved is not None:
        p = curved.profiles
        columns = p.points, p.axes, p.offsets, p.slopes, p.radii, p.signs, curved.min_cosines
        profiles = np.column_stack(columns)
        profile_rows = curved.rows
    return _core.make_shape(
        _doubles(part.vertices), _ints(part.triangles), _ints(part.triangle_face), _ints(profile_rows),
        _doubles(profiles), _doubles(part.edges.ends).reshape(-1, 6), _doubles(part.corners.points),
        landmark_rows(part), _doubles(_hull(part)), _doubles(part.centroid), samples, _doubles(normals[rows]), _CELLS,
        _doubles(np.array([face.area for face in part.faces])) if "original" in part.derived else None,
    )  # fmt: skip


def _spread(corners: FloatArray, weights: FloatArray) -> tuple[Vectors, IntArray]:
    """Return surface points, one in each equal-area strip, in random order with a fixed seed, and their triangles."""
    rng = np.random.default_rng(1991)
    along = (rng.permutation(SAMPLES) + rng.uniform(size=SAMPLES)) / SAMPLES
    rows = np.minimum(np.searchsorted(np.cumsum(weights) / weights.sum(), along), len(corners) - 1)
    u, v = np.sort(rng.uniform(size=(2, SAMPLES, 1)), axis=0)
    a, b, c = corners[rows].transpose(1, 0, 2)
    return np.ascontiguousarray(u * a + (v - u) * b + (1 - v) * c), rows


def _hull(part: Part) -> Vectors:
    """Return the vertices on which the part may stand: those of the convex hull, or all if they are few."""
    if len(part.vertices) <= _FEW:
        return part.vertices
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    try:
        return part.vertices[ConvexHull(part.vertices).vertices]
    except QhullError:
        return part.vertices


def _doubles(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(values, dtype=np.float64)


def _ints(values: IntArray) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=np.int32)
