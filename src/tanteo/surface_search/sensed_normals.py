"""Sensed normals against those of faces: how likely they are, and how that changes as the part turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.lie import SO3
from tanteo.shapes import Junctions
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, IntArray, Transforms, Vectors

_BEHIND = -50.0
"""Log density of a sensed normal that points into the part."""


@dataclass(frozen=True, slots=True, eq=False)
class Tilt:
    """Sensed normals against those of the faces, of the readings that have one.

    Attributes:
        rows: which of the readings ``(m,)``.
        sensed: in the part's frame ``(m, 3)``.
        sd: of a tilt ``(m,)`` [rad].
        gap: sines of the tilts, in standard deviations ``(m, F, 3)``.
    """

    rows: IntArray
    sensed: Vectors
    sd: FloatArray
    gap: FloatArray


def tilt_of(touches: Touches, R: Transforms, s: IntArray, n: IntArray, faces: Junctions) -> Tilt | None:
    """The tilts of those readings ``n`` at poses ``s`` that have a normal; None if none has."""
    rows = np.flatnonzero(touches.oriented[n])
    if not len(rows):
        return None
    s, n = s[rows], n[rows]
    sensed, sd = (touches.normals[n, None] @ R[s])[:, 0], touches.normal_sds[n]
    return Tilt(rows, sensed, sd, SO3.cross(faces.normals[rows], sensed[:, None]) / sd[:, None, None])


def tilt_log_density(sensed: Vectors, normals: Vectors, gap: FloatArray, sd: FloatArray) -> FloatArray:
    """Log density of sensed normals on faces with those normals; ``gap`` is their cross product over ``sd``."""
    behind = np.where(np.sum(sensed * normals, axis=-1) > 0, 0.0, _BEHIND)
    return np.asarray(behind - 0.5 * np.sum(gap * gap, axis=-1) - np.log(2 * np.pi * sd**2))


def tilt_rows(sensed: Vectors, normals: Vectors, sd: FloatArray) -> FloatArray:
    """Derivative of ``normal x sensed / sd`` by the turn of the part ``(*batch, 3, 3)``."""
    outer, along = sensed[..., :, None] * normals[..., None, :], np.sum(sensed * normals, axis=-1)
    return np.asarray((outer - along[..., None, None] * np.eye(3)) / sd[..., None, None])
