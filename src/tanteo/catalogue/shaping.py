"""A part as the compiled core reads it: made once, and kept as bytes that are used where they lie."""

from __future__ import annotations

import numpy as np

from tanteo import _core
from tanteo.parts import CentredFace, Part, centred_faces, exact_faces, round_features
from tanteo.typing import FloatArray, IntArray, Vectors

SHAPE = "shape5"
"""Of the bytes beside a part in a cache or catalogue: another number where what is put into a shape changes."""

SAMPLES = 1024
"""Places of the surface from which pose proposals are made."""

_CELLS = 40
"""Cells of the distance grid along the longest side."""

_CIRCLE, _POINTS = 3, {"sphere": 5, "cone": 6}
"""What a centre is of, by the numbers that kinds of points have in the core."""

_FEW = 500
"""Vertices up to this number may all be ones on which the part stands."""

_LONGER, _BEYOND, _ON = 1.01, 0.1, 0.5
"""So much longer than a hole a part has to be for centres to lie beyond the hole; the share of those that do; how much
farther, in lengths of both, they may be."""


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
        axes_of(part), _doubles(_hull(part)), _doubles(part.centroid), samples, _doubles(normals[rows]), _CELLS,
    )  # fmt: skip


def _spread(corners: FloatArray, weights: FloatArray) -> tuple[Vectors, IntArray]:
    """Places even over the surface, one in each of as many strips of equal area, in no order; the same every time."""
    rng = np.random.default_rng(1991)
    along = (rng.permutation(SAMPLES) + rng.uniform(size=SAMPLES)) / SAMPLES
    rows = np.minimum(np.searchsorted(np.cumsum(weights) / weights.sum(), along), len(corners) - 1)
    u, v = np.sort(rng.uniform(size=(2, SAMPLES, 1)), axis=0)
    a, b, c = corners[rows].transpose(1, 0, 2)
    return np.ascontiguousarray(u * a + (v - u) * b + (1 - v) * c), rows


def axes_of(part: Part) -> FloatArray:
    """Where centres may be ``(K, 12)``: ends, sizes, weight, side, number, kind of point.

    Of circles it is on the axes of holes and bosses, all alike; of each the wall, and with a smaller weight all heights
    of the part, for some devices move a centre along its axis to a plane of their own. Both go on for a while, as
    centres that were moved to the rim are no less likely than others. Of spheres and cones it is a point.
    """
    rounds, rows = round_features(part), []
    for number, one in enumerate(rounds):
        along = (part.vertices - one.ends[0]) @ one.axis
        reach = one.ends[0] + np.array([[along.min()], [along.max()]]) * one.axis
        longer = float(np.ptp(along)) > _LONGER * one.length
        rest = [float(one.radii.min()), float(one.radii.max())]
        for ends, share in ((one.ends, 1 - _BEYOND * longer), (reach, _BEYOND * longer)):
            if share > 0:
                beside = _ON * (ends[1] - ends[0])
                ends = ends + np.stack([-beside, beside])
                rows.append([*ends.ravel(), *rest, share / len(rounds), 1.0 if one.hole else -1.0, number, _CIRCLE])
    rows += _points(centred_faces(part), len(rounds))
    return _doubles(np.array(rows).reshape(-1, 12))


def _points(faces: tuple[CentredFace, ...], first: int) -> list[list[float]]:
    """Rows of centres of spheres and of apexes; of each kind all alike."""
    rows = []
    for number, one in enumerate(faces, start=first):
        share = 1 / sum(other.surface == one.surface for other in faces)
        side = 1.0 if one.hole else -1.0
        rows.append(
            [*one.centre, *(one.centre + one.axis), one.size, one.size, share, side, number, _POINTS[one.surface]]
        )
    return rows


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
