"""What is asked of every part of a catalogue before any is opened: sizes, faces, a coarse field, how it may lie.

All of it is a function of the part alone, in its own frame, in metres, and small: three kilobytes a part.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.catalogue.cache import load_derived, store_derived
from tanteo.catalogue.index import kinds
from tanteo.catalogue.resting import hull_points, rest_rows
from tanteo.factors import landmark_rows
from tanteo.parts import Face, Part
from tanteo.shapes import ClosestPoints, Surface, as_signed
from tanteo.typing import FloatArray, Vectors

FACES = 64
"""Largest planar faces that are compared; what else a part's surface is made of is its unseen share."""

AXES = 128
"""Holes and bosses of a part, the largest, and spheres, and cones, of which it is compared where centres may be."""

NODES, BEYOND = 14, 2
"""Cells of the coarse field along the longest side, and beyond the part on each side. Along each side their number is
even: a sheet has nodes in its middle, without which it would be half a cell away from every point."""

LEVELS = 24
"""Steps of the coarse field in the length of a cell; what is farther than 127 of them is as far as that."""

_FIELD, _GRID = "field1", 28
"""What the field is called in the cache, and its version; bytes of where its nodes are."""

PARALLEL = 1e-3
"""Faces that are turned by less than this are compared by their distance, others by their angle [rad]."""

_APART = 1e-3
"""Angles of a part that differ by less are kept once [rad]."""

_DIRECTIONS = 256


@cache
def directions() -> Vectors:
    """Directions over half of the sphere, evenly (a spiral) ``(256, 3)``."""
    k = np.arange(_DIRECTIONS) + 0.5
    z, turn = k / _DIRECTIONS, np.pi * (1 + np.sqrt(5)) * k
    return np.stack([np.cos(turn) * np.sqrt(1 - z * z), np.sin(turn) * np.sqrt(1 - z * z), z], axis=1)


def widths(points: Vectors) -> FloatArray:
    """Diameter and mean width of points ``(2,)`` [m]: no less than those of any points within their convex hull."""
    span = np.ptp(points @ directions().T, axis=0)
    return np.array([diameter(points), span.mean()])


def diameter(points: Vectors) -> float:
    """Largest distance between two points [m]; of very many points an upper bound."""
    if len(points) > 2000:
        along = np.ptp(points @ directions().T, axis=0).max()
        return float(along / np.cos(2.5 / np.sqrt(_DIRECTIONS)))
    squares = np.sum(points**2, axis=1)
    gaps = squares[:, None] + squares - 2 * points @ points.T
    return float(np.sqrt(max(gaps.max(), 0.0)))


def faces_of(part: Part) -> dict[str, np.ndarray]:
    """The columns with which sensed planes are compared, as a table of one part has them."""
    planes, rounds, numbers = _planes(part).astype(np.float32), rounds_of(part), np.zeros((1, 17))
    numbers[0, 16] = _unseen_share(part)
    starts = {"planes_start": np.array([0, len(planes)]), "rounds_start": np.array([0, len(rounds)])}
    return {"planes": planes, "rounds": rounds, "numbers": numbers, **starts}


def signature(part: Part, shape: _core.Shape) -> dict[str, Any]:
    """The rows of a part by the name of their column.

    Args:
        part: the part.
        shape: compiled of it.

    Returns:
        ``numbers`` of every part alike: area, volume, radius, diameter, mean width, centroid, box, order of symmetry,
        whether it is continuous, unseen share. Arrays of any length: ``planes`` (normal, centroid, reach), ``rounds``
        (cylinders), ``axes`` (where centres may be), ``same`` and ``opposite`` (distances of parallel faces),
        ``angles`` (of others), ``field``, ``hull`` (corners of the convex hull), ``rests`` (stable poses: direction
        down, probability); and ``grid`` (origin, step, counts).
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
        "hull": hull_points(part), "rests": rest_rows(part),
    }  # fmt: skip


def _unseen_share(part: Part) -> float:
    """Share of a part's area that is of no face that is compared: free forms, cones, balls, the smallest planes."""
    seen = np.sort(part.planes.areas)[::-1][:FACES].sum()
    seen += sum(face.area for _, face in _cylinders(part))
    return float(np.clip(1 - seen / part.area, 0.0, 1.0))


def _cylinders(part: Part) -> list[tuple[int, Face]]:
    """The largest cylinders, with their numbers."""
    known = [
        (k, face)
        for k, face in enumerate(part.faces)
        if face.surface == "cylinder" and face.axis_point is not None and face.radius and face.convex is not None
    ]
    return sorted(known, key=lambda one: -one[1].area)[:FACES]


def rounds_of(part: Part) -> np.ndarray:
    """Of the largest cylinders ``(K, 9)``: middle and direction of the axis, radius, half length [m], 1 for a boss."""
    rows = []
    for k, face in _cylinders(part):
        assert face.axis_point is not None
        assert face.axis_direction is not None
        along = (part.vertices[part.triangles[part.triangle_face == k]] - face.axis_point) @ face.axis_direction
        middle = face.axis_point + 0.5 * (along.min() + along.max()) * face.axis_direction
        half, sign = 0.5 * np.ptp(along), 1.0 if face.convex else -1.0
        rows.append(np.r_[middle, face.axis_direction, face.radius, half, sign])
    return np.array(rows, dtype=np.float32).reshape(-1, 9)


def _largest_axes(part: Part) -> np.ndarray:
    """Where centres may be ``(K, 15)``, as the core has it; of each kind the largest, for most are sensed of these.

    Their weights are those among all: what they lack of 1 is the share of those that are left out.
    """
    rows = landmark_rows(part)
    kept = list[int]()
    for kind in np.unique(rows[:, 11]):
        own = np.flatnonzero(rows[:, 11] == kind)
        largest = dict.fromkeys(rows[own[np.argsort(-rows[own, 7], kind="stable")], 10])
        kept += own[np.isin(rows[own, 10], list(largest)[:AXES])].tolist()
    return rows[sorted(kept)].astype(np.float32)


def _planes(part: Part) -> FloatArray:
    """Of the largest planar faces ``(M, 7)``: normal, centroid, how far it reaches from there [m]."""
    planes = part.planes
    if not len(planes):
        return np.zeros((0, 7))
    rows = np.argsort(-planes.areas, kind="stable")[:FACES]
    of = np.repeat(np.arange(len(planes)), np.diff(planes.boundary_start))
    away = np.linalg.norm(planes.boundary - planes.centroids[of], axis=1)
    reach = np.maximum.reduceat(away, planes.boundary_start[:-1])
    return np.column_stack([planes.normals, planes.centroids, reach])[rows]


def pairs_of(planes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Distances of parallel faces that look the same way, and opposite ways, and the angles of all others.

    The distance of two that look the same way has no sign; that of opposite ones is negative with material between.
    """
    i, j = np.triu_indices(len(planes), 1)
    n, c = planes[:, :3], planes[:, 3:6]
    angles = np.arctan2(np.linalg.norm(np.cross(n[i], n[j]), axis=1), np.sum(n[i] * n[j], axis=1))
    along = n[i] + np.sign(np.cos(angles))[:, None] * n[j]
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
    heights = np.sum(along * (c[j] - c[i]), axis=1)
    same, opposite = angles < PARALLEL, angles > np.pi - PARALLEL
    between = np.unique(np.round(angles[~same & ~opposite] / _APART)) * _APART
    # the height of the second over the first, out of it: positive where both look at each other over a gap
    rows = np.abs(heights[same]), heights[opposite], between
    return tuple(np.asarray(row, dtype=np.float32) for row in rows)  # type: ignore[return-value]


def coarse_field(part: Part, shape: _core.Shape) -> tuple[np.ndarray, np.ndarray]:
    """Where the nodes of a grid about the part are, and signed distances to the surface there.

    They are kept with the part, and beside it in the cache.
    """
    if "field" not in part.derived:
        known = _stored_field(part)
        if known is None:
            known = _field(part, shape)
            store_derived(part, _FIELD, known[0].tobytes() + known[1].tobytes())
        part.derived["field"] = known
    field: tuple[np.ndarray, np.ndarray] = part.derived["field"]
    return field


def _stored_field(part: Part) -> tuple[np.ndarray, np.ndarray] | None:
    """What is in the cache, if it is whole."""
    stored = load_derived(part, _FIELD)
    if stored is None or len(stored) < _GRID:
        return None
    grid, levels = stored[:_GRID].view(np.float32), stored[_GRID:].view(np.int8)
    counts = grid[4:]
    whole = bool(np.isfinite(grid).all() and counts.min() >= 2 and np.prod(counts) == len(levels))
    return (grid, levels) if whole else None


def field_table(numbers: FloatArray, fields: Sequence[tuple[np.ndarray, np.ndarray]]) -> dict[str, np.ndarray]:
    """The columns that a coarse look takes: of parts with these numbers, as in a signature, and fields."""
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
