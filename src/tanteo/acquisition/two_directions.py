"""The paper's plane from the record of a scan: two directions of it, four readings (section 3)."""

from __future__ import annotations

import numpy as np

from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.fitting import plane_from_two_directions
from tanteo.sensors import Readings, Rig, RobotPreset, measure
from tanteo.typing import IntArray


def plane_as_published(readings: Readings, rig: Rig, label: str, robot: RobotPreset | str | None = None) -> Feature:
    """The plane whose normal is across two directions, each through two readings of a scan.

    The first direction joins readings of the two sensors near the middle of the scan, the second one the first
    sensor's readings at both ends of it. The origin is the first of the four points. :func:`features_of` uses all
    readings and is several times better (``math.md`` section 8).

    Args:
        readings: A record with the scan of a plane by two sensors.
        rig: Where the sensors sit.
        label: Of the scan.
        robot: Errors of the robot; none are assumed without it.

    Raises:
        InputError: The label has not two sensors, or not four readings.
    """
    rows = np.flatnonzero(np.array(readings.features) == label)
    four = _four(readings, rows, label)
    measured = measure(readings.take(four), rig=rig, robot=robot)
    (q1, q2, q3, q4), C = measured.points, np.zeros((12, 12))
    for k in range(4):
        C[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = measured.covs[k]
    return plane_from_two_directions(
        q1,
        q2,
        q3,
        q4,
        C,
        outward=-measured.directions.mean(axis=0),
        label=label,
        readings=measured.ids,
        shared=list(zip(measured.shared, measured.jacobians, strict=True)),
    )


def _four(readings: Readings, rows: IntArray, label: str) -> IntArray:
    """The four rows, in the order of the construction."""
    sensors = np.array(readings.sensors)[rows]
    names = list(dict.fromkeys(sensors.tolist()))
    if len(names) != 2 or len(rows) < 4:
        raise InputError(
            f"plane {label!r}: expected four readings or more of two sensors, got {len(rows)} of {len(names)}. Scan "
            "the face with both frontal sensors."
        )
    places = readings.Ts_world_hand[rows, :3, 3]
    away = places - places.mean(axis=0)
    along = away @ np.linalg.svd(away, full_matrices=False)[2][0]
    first, second = (np.flatnonzero(sensors == name) for name in names)
    ends = first[np.argmax(along[first])], first[np.argmin(along[first])]
    inner = [k for k in first if k not in ends] or list(first)
    middle = min(inner, key=lambda k: abs(along[k]))
    partner = second[np.argmin(np.abs(along[second] - along[middle]))]
    return np.asarray(rows[[middle, partner, *ends]])
