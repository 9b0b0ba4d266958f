"""Find patterns in valid readings: repeated readings, repeated places, and a sensor that reports a constant range."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo import _core
from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.sensors.measurements import PointMeasurements
from tanteo.sensors.readings import Readings
from tanteo.words.findings import Repeated, RepeatedPlaces, Stuck

_SAME = 1e-9
"""Difference below which two coordinates [m] or direction components count as equal."""

_NAMED = 3
"""Largest number of repeated sets that are listed by name."""

_FINE, _FEW, _MANY = 1e-4, 4, 7
"""Resolution that separates fine from coarse sensors [m]; run lengths of equal ranges that chance does not explain."""

_EQUAL_PLACES, _NEAR, _REPEATS = 5e-6, 1e-4, 3
"""Numerical: tolerance of equal coordinates across the approach [m], with which encoders repeat a commanded place,
extent along it [m] and number of repeats of one place."""

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


def without_repeats(readings: Readings) -> tuple[Readings, RepeatedPlaces | None]:
    """Return the readings with one reading for each repeated place, and the finding; None if no place is repeated.

    A place is repeated if three readings or more differ only along the approach, as programs and probe tests repeat it:
    by 0.1 mm or three steps of the file at most, and by 5 um or one step across it. Without an approach they differ
    along one axis of the world. Repeats show the noise at their place, but not that between places, so they count as
    one reading. The first is kept: a drift has moved it least.

    Args:
        readings: readings in the order of their acquisition.
    """
    sets = [rows for rows in _repeats(readings) if len(rows) >= _REPEATS]
    if not sets:
        return readings, None
    points = readings.points.filled(np.nan)
    middles = [points[rows] - points[rows].mean(axis=0) for rows in sets]
    order = [np.arange(len(rows)) - 0.5 * (len(rows) - 1) for rows in sets]
    spread = np.sqrt(sum(float(np.sum(m**2)) for m in middles) / sum(len(rows) - 1 for rows in sets))
    drift = sum(float(np.linalg.norm(k @ m)) for k, m in zip(order, middles, strict=True)) / sum(
        float(k @ k) for k in order
    )
    repeated = np.concatenate([rows[1:] for rows in sets])
    kept = np.setdiff1d(np.arange(len(readings)), repeated)
    ids = tuple(tuple(readings.ids[k] for k in rows) for rows in sets)
    return readings.take(kept), RepeatedPlaces(ids, float(spread), drift)


def _repeats(readings: Readings) -> list[IntArray]:
    """Return the rows of each place whose readings differ only along the approach, or along one axis without one."""
    points, aims = readings.points.filled(np.nan), readings.directions.filled(np.nan)
    across, along = max(_EQUAL_PLACES, 1.01 * readings.step), max(_NEAR, 3.01 * readings.step)
    rows = np.flatnonzero(readings.points.given & ~readings.is_free)
    names = [
        str(one) for one in zip(readings.features, readings.kinds, readings.radii, strict=True)
    ]  # readings of other features or balls are other places
    labels = np.unique(names, return_inverse=True)[1] if names else np.zeros(0, dtype=np.int64)
    candidates = list[IntArray]()
    for axes in _ways(aims[rows]):
        cosines = aims[rows] @ axes[2]
        sides = np.where(np.isnan(cosines), 0.0, np.sign(cosines))
        some = rows[np.isnan(cosines) | (np.abs(cosines) > 1 - _ROUNDING)]
        if len(some) >= _REPEATS:
            places = np.column_stack([points[some] @ axes.T / [across, across, along], labels[some]])
            places = np.column_stack([places, sides[np.searchsorted(rows, some)]])
            candidates += [some[members] for members in _near_each_other(places)]
    taken = np.zeros(len(readings), dtype=bool)
    sets = list[IntArray]()
    for members in sorted(candidates, key=len, reverse=True):  # along another axis a part of them may be near
        if not taken[members].any():
            taken[members] = True
            sets.append(members)
    return sorted(sets, key=lambda members: int(members[0]))


def _near_each_other(places: FloatArray) -> list[IntArray]:
    """Return the sets of three places or more within one unit of each other, whose extent is up to two units."""
    first, second = _core.near_pairs(np.ascontiguousarray(places[:, :3]), np.sqrt(3)).T
    near = np.abs(places[first] - places[second]).max(axis=1, initial=0.0) <= 1.0 - _ROUNDING
    if near.sum() < _REPEATS - 1:
        return []
    owner = _core.components(len(places), np.ascontiguousarray(first[near]), np.ascontiguousarray(second[near]))
    counts = np.bincount(owner, minlength=1)
    sets = [np.flatnonzero(owner == k) for k in np.flatnonzero(counts >= _REPEATS)]
    return [members for members in sets if np.all(np.ptp(places[members], axis=0) <= [2, 2, 1, 0, 0])]


def _ways(aims: Vectors) -> list[FloatArray]:
    """Return frames whose z axis is a direction along which a place is repeated: the world's axes, then approaches.

    Args:
        aims: directions of the readings ``(n, 3)``; NaN without one.
    """
    known = aims[np.isfinite(aims).all(axis=1)]
    axes = [np.roll(np.eye(3), -k - 1, axis=0) for k in range(3)]
    slanted = known[np.abs(known).max(axis=1, initial=0.0) <= 1 - _ROUNDING]
    some, counts = np.unique(np.round(slanted, 9), axis=0, return_counts=True)
    return axes + [SO3.frame_from_axis(aim / np.linalg.norm(aim), 2).T for aim in some[counts >= _REPEATS]]


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
