"""A sensor that says the same wherever it looks: its readings agree with whatever is expected there."""

from __future__ import annotations

import numpy as np

from tanteo.sensors.readings import Readings
from tanteo.typing import FloatArray, IntArray

_FINE, _FEW, _MANY = 1e-4, 4, 7
"""Where a sensor tells ranges finer than this [m], so many equal ones in a row are no chance; and so many where not."""

_ROUNDING = 1e-9
"""Ranges that agree to this are the same [m]."""


def say_stuck(readings: Readings) -> str:
    """A question where a sensor gave the same range again and again, from different places; empty where none did.

    Args:
        readings: in the order in which they were made.
    """
    for sensor in dict.fromkeys(readings.sensors):
        rows = np.flatnonzero(np.isfinite(readings.ranges) & (np.array(readings.sensors, dtype=object) == sensor))
        first, count = _longest(readings, rows)
        if count < (_FEW if _has_digits(readings.ranges[rows]) else _MANY):
            continue
        k, end = rows[first], rows[first + count - 1]
        who = f" of '{sensor}'" if sensor else ""
        return (
            f"The {count} ranges {readings.ids[k]} to {readings.ids[end]}{who} are all {1e3 * readings.ranges[k]:.6g} "
            "mm, from different places: is the sensor stuck?"
        )
    return ""


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


def _has_digits(ranges: FloatArray) -> bool:
    """Whether ranges are told finer than devices with a coarse step tell them."""
    return bool((np.abs(ranges / _FINE - np.round(ranges / _FINE)) > _ROUNDING / _FINE).any())
