"""Find suspicious patterns in valid readings: repeated readings, and a sensor that reports a constant range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.geometry.typing import IntArray
from tanteo.sensors.measurements import PointMeasurements
from tanteo.sensors.readings import Readings
from tanteo.words.findings import Repeated, Stuck

_SAME = 1e-9
"""Difference below which two coordinates [m] or direction components count as equal."""

_NAMED = 3
"""Largest number of repeated sets that are listed by name."""

_FINE, _FEW, _MANY = 1e-4, 4, 7
"""Resolution that separates fine from coarse sensors [m]; run lengths of equal ranges that chance does not explain."""

_ROUNDING = 1e-9
"""Difference below which two ranges count as equal [m]."""


def find_repeated(measured: PointMeasurements) -> Repeated | None:
    """Return the readings with equal point, direction, normal and standard deviation; None if there are none.

    They are not merged: a device with a coarse resolution may repeat a reading.

    Args:
        measured: measurements of the readings.
    """
    sets = _equal(measured)
    return Repeated(tuple(map(tuple, sets))) if sets else None


def _equal(measured: PointMeasurements) -> list[Sequence[str]]:
    """Return the sets of equal readings by name, in the order of their first members."""
    if not len(measured):
        return []
    sds = np.sqrt(np.diagonal(measured.covs, axis1=-2, axis2=-1))
    directions = np.nan_to_num(measured.directions)
    normals = np.nan_to_num(measured.normals)
    numbers = np.concatenate([measured.points, directions, normals, sds, measured.radii[:, None]], axis=1)
    inverse = np.unique(np.round(numbers / _SAME) + 0.0, axis=0, return_inverse=True)[
        1
    ].ravel()  # + 0.0 removes minus zero
    sets: dict[int, list[str]] = {}
    for name, row in zip(measured.ids, inverse.tolist(), strict=True):
        sets.setdefault(row, []).append(name)
    return [ids for ids in sets.values() if len(ids) > 1]


def find_stuck(readings: Readings) -> Stuck | None:
    """Return a sensor that reported the same range repeatedly from different positions; None if there is none.

    Args:
        readings: readings in the order of their acquisition.
    """
    for sensor in dict.fromkeys(readings.sensors):
        rows = np.flatnonzero(readings.ranges.given & (np.array(readings.sensors, dtype=object) == sensor))
        first, count = _longest(readings, rows)
        steps = np.asarray(readings.ranges[rows]) / _FINE
        fine = (np.abs(steps - np.round(steps)) > _ROUNDING / _FINE).any()
        if count < (_FEW if fine else _MANY):
            continue
        k = rows[first]
        end = rows[first + count - 1]
        return Stuck(sensor, readings.ids[k], readings.ids[end], count, float(readings.ranges[k]))
    return None


def _longest(readings: Readings, rows: IntArray) -> tuple[int, int]:
    """Return start and length of the longest run of equal ranges from different positions."""
    best, first = (0, min(len(rows), 1)), 0
    ranges = readings.ranges[rows]
    places = readings.points.coalesce(readings.Ts_world_hand.map(lambda Ts: Ts[:, :3, 3]))[rows]
    for k in range(1, len(rows)):
        same = abs(ranges[k] - ranges[k - 1]) < _ROUNDING
        elsewhere = np.linalg.norm(places[k] - places[k - 1]) > _ROUNDING
        if not (same and elsewhere):
            first = k
        elif k - first + 1 > best[1]:
            best = first, k - first + 1
    return best
