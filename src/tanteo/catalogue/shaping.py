"""A part as the compiled core reads it: made once, and kept as bytes that are used where they lie."""

from __future__ import annotations

import numpy as np

from tanteo import _core
from tanteo.factors import landmark_rows
from tanteo.parts import Part, exact_faces
from tanteo.typing import FloatArray, IntArray, Vectors

SHAPE = "shape6"
"""Of the bytes beside a part in a cache or catalogue: another number where what is put into a shape changes."""

SAMPLES = 1024
"""Places of the surface from which pose proposals are made."""

_CELLS = 40
"""Cells of the distance grid along the longest side."""

_FEW = 500
"""Vertices up to this number may all be ones on which the part stands."""


def compiled_shape(part: Part) -> _core.Shape:
    """The shape of a part, for the core; it takes milliseconds."""
    corners = part.vertices[part.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(across, axis=1)
    normals = across / np.maximum(lengths, 1e-300)[:, None]
    samples, rows = _spread(corners, lengths)
    curved = exact_faces(part, normals)
    profiles, profile_rows = np.zeros((0, 11)), np.full(len(corners), -1)
    if curved is not None:
        p = curved.profiles
        columns = p.points, p.axes, p.offsets, p.slopes, p.radii, p.signs, curved.alike
        profiles, profile_rows = np.column_stack(columns), curved.rows
    return _core.make_shape(
        _doubles(part.vertices), _ints(part.triangles), _ints(part.triangle_face), _ints(profile_rows),
        _doubles(profiles), _doubles(part.edges.ends).reshape(-1, 6), _doubles(part.corners.points),
        landmark_rows(part), _doubles(_hull(part)), _doubles(part.centroid), samples, _doubles(normals[rows]), _CELLS,
    )  # fmt: skip


def _spread(corners: FloatArray, weights: FloatArray) -> tuple[Vectors, IntArray]:
    """Places even over the surface, one in each of as many strips of equal area, in no order; the same every time."""
    rng = np.random.default_rng(1991)
    along = (rng.permutation(SAMPLES) + rng.uniform(size=SAMPLES)) / SAMPLES
    rows = np.minimum(np.searchsorted(np.cumsum(weights) / weights.sum(), along), len(corners) - 1)
    u, v = np.sort(rng.uniform(size=(2, SAMPLES, 1)), axis=0)
    a, b, c = corners[rows].transpose(1, 0, 2)
    return np.ascontiguousarray(u * a + (v - u) * b + (1 - v) * c), rows


def _hull(part: Part) -> Vectors:
    """Vertices on which the part may stand: those that are the farthest in some direction, or all of few."""
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
