"""Turns of a part about the axes of its round faces, which leave readings of these faces where they are."""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3, SO3
from tanteo.parts import Part
from tanteo.shapes import Revolved
from tanteo.typing import FloatArray, IntArray, Transforms, Vectors

STEPS = 180
"""Turns about one axis."""

_AXES = 2
"""Axes of the largest faces."""

_LEAST = 0.03
"""Faces about an axis with less of the part's surface than this do not matter."""

_SAME = 1e-4
"""Axes that differ by less, as an angle and in diagonals of the part, are one."""


def spins_about(part: Part, curved: Revolved | None) -> Transforms:
    """Turns about the axes that most of the round surface has in common ``(A, STEPS, 4, 4)``, in the part frame.

    Args:
        part: the part; the axis that it is a solid of revolution about is left out.
        curved: its round faces.
    """
    if curved is None:
        return np.zeros((0, STEPS, 4, 4))
    profiles, areas = curved.profiles, _areas(part, curved)
    straight = (profiles.radii == 0) | (profiles.offsets > 0)  # a ball has no axis
    rows = np.flatnonzero(straight & (areas > 0))
    slack = _SAME * part.diagonal
    group = _coaxial(profiles.points[rows], profiles.axes[rows], slack)
    if part.symmetry.axis is not None:
        point, axis = part.symmetry.axis
        known = _coaxial(np.vstack([point, profiles.points[rows]]), np.vstack([axis, profiles.axes[rows]]), slack)
        areas[rows[known[1:] == 0]] = 0.0
    total = np.bincount(group, areas[rows], minlength=1)
    best = [g for g in np.argsort(-total)[:_AXES] if total[g] > _LEAST * part.area]
    first = [rows[np.flatnonzero(group == g)[0]] for g in best]
    angles = 2 * np.pi * np.arange(STEPS) / STEPS
    R = SO3.exp(angles[:, None] * profiles.axes[first][:, None])
    c = np.broadcast_to(profiles.points[first][:, None], (*R.shape[:2], 3))
    return SE3.from_parts(R, c - np.einsum("akij,akj->aki", R, c))


def _areas(part: Part, curved: Revolved) -> FloatArray:
    corners = part.vertices[part.triangles]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    mine = curved.rows >= 0
    return np.bincount(curved.rows[mine], areas[mine], minlength=len(curved.alike)).astype(np.float64)


def _coaxial(points: Vectors, axes: Vectors, slack: float) -> IntArray:
    """Number of the axis of each row ``(F,)``: that of the first row that has it."""
    out = np.arange(len(points))
    for k in range(len(points) - 1, -1, -1):
        along = np.abs(axes @ axes[k]) > 1 - _SAME
        beside = np.linalg.norm(np.cross(points - points[k], axes[k]), axis=1) < slack
        out[along & beside] = k
    return out
