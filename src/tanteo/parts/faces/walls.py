"""Find walls of holes and bosses: cylinders with their continuations, and cones, with a sufficient angular extent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, Vectors
from tanteo.parts.part import Part
from tanteo.parts.readers.topology import components

_BINS, _LEAST_BINS = 72, 34
"""Number of sectors around an axis, and how many must contain surface: about half a turn, with tolerance for meshes."""

_PARALLEL, SAME = 1e-4, 1e-4
"""Angle below which axes are parallel [rad]; tolerance for equal positions and radii, as a fraction of the diagonal."""


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """Wall of a hole or boss.

    Attributes:
        faces: indices into :attr:`Part.faces`.
        point: point of the axis, part frame ``(3,)`` [m].
        axis: unit axis ``(3,)``.
        low: smallest coordinate of the wall along the axis from ``point`` [m].
        high: largest coordinate of the wall along the axis from ``point`` [m].
        place: point of the wall's surface ``(3,)`` [m].
    """

    faces: tuple[int, ...]
    point: Vectors
    axis: Vectors
    low: float
    high: float
    place: Vectors


def walls_of(part: Part) -> list[Wall]:
    """Return the walls of a part with sufficient angular extent, in the order of their first faces.

    Args:
        part: the part.
    """
    walls = [_wall(part, faces) for faces in _together(part)]
    return [wall for wall in walls if wall is not None]


def _together(part: Part) -> list[tuple[int, ...]]:
    """Return the faces of each wall: single cones, and cylinders with their continuations."""
    round_ones = [
        k
        for k, face in enumerate(part.faces)
        if face.surface in ("cylinder", "cone") and face.axis_direction is not None and face.convex is not None
    ]
    if not round_ones:
        return []
    first, second = np.nonzero(np.triu(_continued(part, round_ones), 1))
    labels = components(len(round_ones), first, second)
    groups: dict[int, list[int]] = {}
    for k, label in zip(round_ones, labels.tolist(), strict=True):
        groups.setdefault(label, []).append(k)
    return sorted(tuple(group) for group in groups.values())


def _continued(part: Part, rows: list[int]) -> BoolArray:
    """Return which faces lie on one cylinder and overlap along it ``(n, n)``."""
    faces = [part.faces[k] for k in rows]
    near = SAME * part.diagonal
    points = np.array([face.axis_point for face in faces]) - part.centroid
    axes = np.array([face.axis_direction for face in faces])
    axes *= np.sign(np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1))
    feet = points - np.sum(points * axes, axis=1, keepdims=True) * axes
    corners = [corners_of(part, (k,)) for k in rows]
    extents = np.array([_extent(own, part.centroid, axis) for own, axis in zip(corners, axes, strict=True)])
    radii = np.array([face.radius if face.surface == "cylinder" else np.nan for face in faces], dtype=np.float64)
    convex = np.array([face.convex for face in faces])
    same = (np.abs(radii[:, None] - radii) < near) & (convex[:, None] == convex)
    same &= np.linalg.norm(axes[:, None] - axes, axis=-1) < _PARALLEL
    same &= np.linalg.norm(feet[:, None] - feet, axis=-1) < near
    low, high = extents.T
    return np.asarray(same & (np.minimum(high[:, None], high) - np.maximum(low[:, None], low) > -near))


def corners_of(part: Part, faces: tuple[int, ...]) -> Vectors:
    """Return the mesh vertices of some faces ``(n, 3)`` [m].

    Args:
        part: the part.
        faces: indices into :attr:`Part.faces`.
    """
    return np.asarray(part.vertices[np.unique(part.triangles[np.isin(part.triangle_face, faces)])])


def _extent(points: Vectors, point: Vectors, axis: Vectors) -> tuple[float, float]:
    along = (points - point) @ axis
    return float(along.min()), float(along.max())


def _wall(part: Part, faces: tuple[int, ...]) -> Wall | None:
    """Return the wall of some faces; None if its angular extent is too small."""
    face = part.faces[faces[0]]
    point = np.asarray(face.axis_point)
    axis = np.asarray(face.axis_direction)
    triangles = part.vertices[part.triangles[np.isin(part.triangle_face, faces)]]
    if np.count_nonzero(_sectors(triangles, point, axis)) < _LEAST_BINS:
        return None
    low, high = _extent(triangles.reshape(-1, 3), point, axis)
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    place = triangles[np.argmax(np.linalg.norm(across, axis=1))].mean(axis=0)
    return Wall(faces, point, axis, low, high, place) if high - low > 0 else None


def _sectors(triangles: FloatArray, point: Vectors, axis: Vectors) -> BoolArray:
    """Return the mask of sectors around an axis that contain surface ``(_BINS,)``."""
    x = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x /= np.linalg.norm(x)
    off = triangles - point
    angles = np.arctan2(off @ np.cross(axis, x), off @ x)
    beside = (angles - angles[:, :1] + np.pi) % (2 * np.pi) - np.pi
    low = angles[:, 0] + beside.min(axis=1)
    high = angles[:, 0] + beside.max(axis=1)
    middles = 2 * np.pi * (np.arange(_BINS) + 0.5) / _BINS
    after = (middles - low[:, None]) % (2 * np.pi)
    return np.asarray((after <= (high - low)[:, None]).any(axis=0))
