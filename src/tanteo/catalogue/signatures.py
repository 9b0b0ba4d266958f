"""Compute the signature of a part for the coarse evaluation of a catalogue: sizes, faces, coarse field, stable poses.

A signature depends only on the part, in its own frame in metres, and takes about three kilobytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue.cache import load_derived, store_derived
from tanteo.catalogue.copies import copy_for_field
from tanteo.catalogue.index import kinds
from tanteo.catalogue.shaping import compiled_shape
from tanteo.catalogue.stability import hull_points, stable_pose_rows
from tanteo.factors.factor import landmark_rows
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.parts import Part, Surface
from tanteo.parts.faces import Face
from tanteo.parts.shapes import ClosestPoints, as_signed

FACES = 64
"""Largest number of planar faces in a signature; the remaining surface counts as unseen fraction."""

AXES = 128
"""Largest number of holes and bosses, of spheres, and of cones in a signature."""

NODES, BEYOND = 14, 2
"""Number of coarse-field cells along the longest side, and in the margin. The number along each side is even, so that
a thin sheet has nodes at its middle plane."""

LEVELS = 24
"""Number of distance levels per cell of the coarse field; distances are clipped at 127 levels."""

_FIELD, _GRID = "field1", 28
"""Kind and version of the stored coarse field; length of its grid description [bytes]."""

PARALLEL = 1e-3
"""Angle below which faces count as parallel and are compared by distance instead of angle [rad]."""

_APART = 1e-3
"""Resolution of stored angles [rad]."""

_DIRECTIONS = 256


@cache
def directions() -> Vectors:
    """Return directions evenly spaced on half of the sphere (spiral) ``(256, 3)``."""
    k = np.arange(_DIRECTIONS) + 0.5
    z = k / _DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * k
    return np.stack([np.cos(turn) * np.sqrt(1 - z * z), np.sin(turn) * np.sqrt(1 - z * z), z], axis=1)


def widths(points: Vectors) -> FloatArray:
    """Return diameter and mean width of points ``(2,)`` [m], upper bounds for all points in their convex hull.

    Args:
        points: points ``(n, 3)`` [m].
    """
    span = np.ptp(points @ directions().T, axis=0)
    return np.array([diameter(points), span.mean()])


def diameter(points: Vectors) -> float:
    """Return the largest distance between two points [m]; an upper bound for more than 2000 points.

    Args:
        points: points ``(n, 3)`` [m].
    """
    if len(points) > 2000:
        along = np.ptp(points @ directions().T, axis=0).max()
        return float(along / np.cos(2.5 / np.sqrt(_DIRECTIONS)))
    squares = np.sum(points**2, axis=1)
    gaps = squares[:, None] + squares - 2 * points @ points.T
    return float(np.sqrt(max(gaps.max(), 0.0)))


def faces_of(part: Part) -> dict[str, np.ndarray]:
    """Return the columns for the comparison with sensed planes, as a table of one part.

    Args:
        part: the part.
    """
    planes = _planes(part).astype(np.float32)
    rounds = rounds_of(part)
    numbers = np.zeros((1, 17))
    numbers[0, 16] = _unseen_share(part)
    starts = {"planes_start": np.array([0, len(planes)]), "rounds_start": np.array([0, len(rounds)])}
    return {"planes": planes, "rounds": rounds, "numbers": numbers, **starts}


def signature(part: Part, shape: Callable[[], _core.Shape]) -> dict[str, Any]:
    """Return the signature of a part by column name.

    Args:
        part: the part.
        shape: function that returns the compiled shape of the part; of a large part a copy is compiled instead.

    Returns:
        ``numbers`` (17): area, volume, radius, diameter, mean width, centroid, box, order of symmetry, whether the
        symmetry is continuous, unseen fraction. Arrays of variable length: ``planes`` (normal, centroid, reach),
        ``rounds`` (cylinders), ``axes`` (possible centres), ``same`` and ``opposite`` (distances of parallel faces),
        ``angles`` (between other faces), ``field``, ``hull`` (vertices of the convex hull), ``rests`` (stable poses:
        downward direction, probability). And ``grid`` (origin, step, counts).
    """
    planes = _planes(part)
    grid, field = coarse_field(part, shape)
    symmetry = part.symmetry
    numbers = np.r_[
        part.area, part.volume, part.radius, widths(part.vertices), part.centroid, part.box.ravel(), symmetry.order,
        symmetry.continuous, _unseen_share(part),
    ]  # fmt: skip
    same, opposite, angles = pairs_of(planes)
    return {
        "numbers": numbers, "planes": planes.astype(np.float32), "rounds": rounds_of(part), "axes": _largest_axes(part),
        "same": same, "opposite": opposite, "angles": angles, "grid": grid, "field": field,
        "hull": hull_points(part), "rests": stable_pose_rows(part),
    }  # fmt: skip


def _unseen_share(part: Part) -> float:
    """Return the fraction of a part's area outside the compared faces.

    Free forms, cones, spheres, the smallest planes.
    """
    seen = np.sort(part.planes.areas)[::-1][:FACES].sum()
    seen += sum(face.area for _, face in _cylinders(part))
    return float(np.clip(1 - seen / part.area, 0.0, 1.0))


def _cylinders(part: Part) -> list[tuple[int, Face]]:
    """Return the largest cylinders with their face numbers."""
    known = [
        (k, face)
        for k, face in enumerate(part.faces)
        if face.surface == "cylinder" and face.axis_point is not None and face.radius and face.convex is not None
    ]
    return sorted(known, key=lambda one: -one[1].area)[:FACES]


def rounds_of(part: Part) -> np.ndarray:
    """Return the largest cylinders ``(K, 9)``: middle and direction of the axis, radius, half length [m], 1 for a boss.

    Args:
        part: the part.
    """
    rows = []
    for k, face in _cylinders(part):
        assert face.axis_point is not None
        assert face.axis_direction is not None
        along = (part.vertices[part.triangles[part.triangle_face == k]] - face.axis_point) @ face.axis_direction
        middle = face.axis_point + 0.5 * (along.min() + along.max()) * face.axis_direction
        half = 0.5 * np.ptp(along)
        sign = 1.0 if face.convex else -1.0
        rows.append(np.r_[middle, face.axis_direction, face.radius, half, sign])
    return np.array(rows, dtype=np.float32).reshape(-1, 9)


def _largest_axes(part: Part) -> np.ndarray:
    """Return possible centres ``(K, 15)`` in the core's layout; of each kind the largest, which are sensed most often.

    The weights refer to all centres, so 1 minus their sum is the weight of the omitted ones.
    """
    rows = landmark_rows(part)
    kept = list[int]()
    for kind in np.unique(rows[:, 11]):
        own = np.flatnonzero(rows[:, 11] == kind)
        largest = dict.fromkeys(rows[own[np.argsort(-rows[own, 7], kind="stable")], 10])
        kept += own[np.isin(rows[own, 10], list(largest)[:AXES])].tolist()
    return rows[sorted(kept)].astype(np.float32)


def _planes(part: Part) -> FloatArray:
    """Return normal, centroid and reach from the centroid of the largest planar faces ``(M, 7)`` [m]."""
    planes = part.planes
    if not len(planes):
        return np.zeros((0, 7))
    rows = np.argsort(-planes.areas, kind="stable")[:FACES]
    of = np.repeat(np.arange(len(planes)), np.diff(planes.boundary_start))
    away = np.linalg.norm(planes.boundary - planes.centroids[of], axis=1)
    reach = np.maximum.reduceat(away, planes.boundary_start[:-1])
    return np.column_stack([planes.normals, planes.centroids, reach])[rows]


def pairs_of(planes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return distances of parallel faces with equal normals, with opposite normals, and the angles of all other pairs.

    The distance of faces with equal normals is unsigned. That of faces with opposite normals is negative if material is
    between them.

    Args:
        planes: normals, centroids and reach ``(M, 7)`` [m].
    """
    i, j = np.triu_indices(len(planes), 1)
    n = planes[:, :3]
    c = planes[:, 3:6]
    angles = np.arctan2(np.linalg.norm(np.cross(n[i], n[j]), axis=1), np.sum(n[i] * n[j], axis=1))
    along = n[i] + np.sign(np.cos(angles))[:, None] * n[j]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
    heights = np.sum(along * (c[j] - c[i]), axis=1)
    same = angles < PARALLEL
    opposite = angles > np.pi - PARALLEL
    between = np.unique(np.round(angles[~same & ~opposite] / _APART)) * _APART
    # height of the second face above the first along its normal: positive where the faces bound a gap
    rows = np.abs(heights[same]), heights[opposite], between
    return tuple(np.asarray(row, dtype=np.float32) for row in rows)  # type: ignore[return-value]


def coarse_field(part: Part, shape: Callable[[], _core.Shape]) -> tuple[np.ndarray, np.ndarray]:
    """Return the grid and the quantized signed distances of a part, from the part or the cache if stored there.

    Args:
        part: the part.
        shape: function that returns the compiled shape of the part; of a large part a copy is compiled instead.

    Returns:
        Origin, step [m] and counts of the grid ``(7,)``, and distance levels of its nodes ``(n,)``.
    """
    if "field" not in part.derived:
        known = _stored_field(part)
        if known is None:
            copy = copy_for_field(part)
            known = _field(copy, shape() if copy is part else compiled_shape(copy))
            store_derived(part, _FIELD, known[0].tobytes() + known[1].tobytes())
        part.derived["field"] = known
    field: tuple[np.ndarray, np.ndarray] = part.derived["field"]
    return field


def _stored_field(part: Part) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the coarse field in the cache; None if there is no valid entry."""
    stored = load_derived(part, _FIELD)
    if stored is None or len(stored) < _GRID:
        return None
    grid = stored[:_GRID].view(np.float32)
    levels = stored[_GRID:].view(np.int8)
    counts = grid[4:]
    whole = bool(np.isfinite(grid).all() and counts.min() >= 2 and np.prod(counts) == len(levels))
    return (grid, levels) if whole else None


def field_table(numbers: FloatArray, fields: Sequence[tuple[np.ndarray, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return the columns for the coarse evaluation of several parts.

    Args:
        numbers: column ``numbers`` of the signatures ``(n, 17)``.
        fields: coarse fields of the parts, see :func:`coarse_field`.
    """
    grids, levels = zip(*fields, strict=True)
    return {
        "numbers": numbers, "kind": kinds(numbers), "grid": np.stack(grids), "field": np.concatenate(levels),
        "field_start": np.cumsum([0, *map(len, levels)]).astype(np.int64),
    }  # fmt: skip


def _field(part: Part, shape: _core.Shape) -> tuple[np.ndarray, np.ndarray]:
    size = np.ptp(part.box, axis=0)
    step = float(size.max()) / NODES
    halves = np.maximum(np.ceil(size / (2 * step) - 1e-9).astype(int), 1)
    counts = 2 * halves + 1 + 2 * BEYOND
    origin = part.box.mean(axis=0) - 0.5 * step * (counts - 1)
    axes = [origin[k] + step * np.arange(counts[k]) for k in range(3)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distances, places, triangles = _core.closest_points(shape, np.ascontiguousarray(nodes))
    if part.closed:
        distances, _ = as_signed(
            Surface(part.vertices, part.triangles), nodes, ClosestPoints(distances, places, triangles.astype(np.int64))
        )
    levels = np.rint(distances / step * LEVELS).clip(-127, 127).astype(np.int8)
    return np.r_[origin, step, counts].astype(np.float32), levels
