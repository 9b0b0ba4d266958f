"""From which side the readings of a label were sensed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.sensors import PointMeasurements
from tanteo.typing import FloatArray


def known_side(measured: PointMeasurements, rows: Sequence[int]) -> dict[str, FloatArray]:
    """What tells the outward side of these rows: sensed normals, or the directions of approach; empty if none does."""
    index = np.array(rows)
    for name, vectors in (("normals", measured.normals[index]), ("directions", measured.directions[index])):
        if np.isfinite(vectors).all(axis=1).any():
            return {name: vectors}
    return {}


def most_opposed(measured: PointMeasurements, rows: Sequence[int]) -> tuple[int, float]:
    """The row that was sensed most against the side of all, and the cosine between the two; 1 if no side is known."""
    for vectors in known_side(measured, rows).values():
        total = np.nansum(vectors, axis=0)
        cosines = np.nan_to_num(vectors @ total / max(float(np.linalg.norm(total)), 1e-300), nan=1.0)
        return rows[int(np.argmin(cosines))], float(cosines.min())
    return rows[0], 1.0
