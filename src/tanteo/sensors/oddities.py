"""What is odd about readings, though each may be right: repeated ones, and a sensor that is stuck."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.sensors.measurements import PointMeasurements
from tanteo.sensors.readings import Readings
from tanteo.typing import IntArray
from tanteo.words.findings import Repeated, Stuck

_SAME = 1e-9
"""Numbers (m, or parts of a unit direction) that agree to this are the same."""

_NAMED = 3
"""So many sets of equal readings are named, the rest are counted."""

_FINE, _FEW, _MANY = 1e-4, 4, 7
"""Where a sensor tells ranges finer than this [m], so many equal ones in a row are no chance; and so many where not."""

_ROUNDING = 1e-9
"""Ranges that agree to this are the same [m]."""


def find_repeated(measured: PointMeasurements) -> Repeated | None:
    """Return the readings with equal point, direction, normal and spread; None if there are none.

    They are not merged: a device with a coarse resolution may repeat a reading.
    """
    sets = _equal(measured)
    return Repeated(tuple(map(tuple, sets))) if sets else None


def _equal(measured: PointMeasurements) -> list[Sequence[str]]:
    """Names of readings that are equal, a set at a time, in the order of their first ones."""
    if not len(measured):
        return []
    sds = np.sqrt(np.diagonal(measured.covs, axis1=-2, axis2=-1))
    directions, normals = np.nan_to_num(measured.directions), np.nan_to_num(measured.normals)
    numbers = np.concatenate([measured.points, directions, normals, sds, measured.radii[:, None]], axis=1)
    inverse = np.unique(np.round(numbers / _SAME) + 0.0, axis=0, return_inverse=True)[1].ravel()  # 0.0: no minus zero
    sets: dict[int, list[str]] = {}
    for name, row in zip(measured.ids, inverse.tolist(), strict=True):
        sets.setdefault(row, []).append(name)
    return [ids for ids in sets.values() if len(ids) > 1]


def find_stuck(readings: Readings) -> Stuck | None:
    """Return a sensor that gave the same range again and again, from different places; None if there is none.

    Args:
        readings: in the order in which they were made.
    """
    for sensor in dict.fromkeys(readings.sensors):
        rows = np.flatnonzero(np.isfinite(readings.ranges) & (np.array(readings.sensors, dtype=object) == sensor))
        first, count = _longest(readings, rows)
        steps = readings.ranges[rows] / _FINE
        fine = (np.abs(steps - np.round(steps)) > _ROUNDING / _FINE).any()
        if count < (_FEW if fine else _MANY):
            continue
        k, end = rows[first], rows[first + count - 1]
        return Stuck(sensor, readings.ids[k], readings.ids[end], count, float(readings.ranges[k]))
    return None


def _longest(readings: Readings, rows: IntArray) -> tuple[int, int]:
    """Where the longest run of equal ranges from different places begins, and how long it is."""
    best, first = (0, min(len(rows), 1)), 0
    places = np.where(readings.has_point[:, None], readings.points, readings.Ts_world_hand[:, :3, 3])
    for k in range(1, len(rows)):
        same = abs(readings.ranges[rows[k]] - readings.ranges[rows[k - 1]]) < _ROUNDING
        elsewhere = np.linalg.norm(places[rows[k]] - places[rows[k - 1]]) > _ROUNDING
        if not (same and elsewhere):
            first = k
        elif k - first + 1 > best[1]:
            best = first, k - first + 1
    return best
