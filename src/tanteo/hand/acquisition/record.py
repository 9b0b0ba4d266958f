"""Record acquisitions as labelled raw ranges with hand poses, and compute features from a record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.features import Feature
from tanteo.features.kinds import CIRCLE
from tanteo.fitting import FitReport, circle_on_plane, fit_labelled, plane_from_two_directions
from tanteo.geometry import SO3
from tanteo.geometry.typing import IntArray, Transforms
from tanteo.hand.motion.crossing import EdgeEvent
from tanteo.hand.robot import HIT, Hand, HandReading
from tanteo.sensors import Readings, Rig, measure, reading_kind
from tanteo.sensors.presets import RobotPreset

if TYPE_CHECKING:
    from tanteo.hand.acquisition.wall import WallReading

_ATTEMPTS = 500
"""Largest number of changes, below 1e-12, until a pose is exactly reproduced from its quaternion; half need none."""


def features_of(
    readings: Readings, rig: Rig, robot: RobotPreset | str | None = None, *, tolerance: float = 0.0
) -> tuple[dict[str, Feature], tuple[str, ...]]:
    """Return the feature of every label of a record, bit-identical for a record in memory and in its file.

    Args:
        readings: ranges with hand poses and labels.
        rig: range sensors on the hand.
        robot: preset of the robot's errors; None to assume none.
        tolerance: standard deviation of the made surface from its ideal form [m].

    Returns:
        Features by label, and notes on readings that were excluded.
    """
    features, notes = dict[str, Feature](), list[str]()
    for label in dict.fromkeys(readings.features):
        # compute each label alone: together with others its sums may be rounded in another order
        own = readings.take(np.flatnonzero(np.array(readings.features) == label))
        face = features.get(face_label(label))
        if face is not None and reading_kind(own.kinds[0]).feature is CIRCLE:
            features[label] = circle_in_face(own, face, label, rig, robot)[0]
            continue
        fitted = fit_labelled(measure(own, rig=rig, robot=robot), tolerance)
        notes += [*fitted.notes, *(f"reading {name} was excluded" for name in fitted.rejected)]
        features |= {f.label: f for f in fitted.features if isinstance(f, Feature)}
    return features, tuple(notes)


def face_label(label: str) -> str:
    """Return the label of the face in which a rim lies.

    Args:
        label: label of the rim.
    """
    return f"{label} face"


def circle_in_face(
    readings: Readings, face: Feature, label: str, rig: Rig, robot: RobotPreset | str | None = None
) -> tuple[Feature, FitReport]:
    """Return the circle of a rim from its crossings and its face, which determines axis and height more accurately.

    Args:
        readings: crossings of the rim.
        face: sensed face of the rim.
        label: label of the rim.
        rig: range sensors on the hand.
        robot: preset of the robot's errors; None to assume none.

    Raises:
        DegenerateError: the crossings do not determine the circle.
    """
    m = measure(readings, rig=rig, robot=robot)
    shared = tuple(zip(m.shared, m.jacobians, strict=True))
    return circle_on_plane(m.points, m.covs, face, label=label, readings=m.ids, shared=shared)


def plane_readings(hand: Hand, log: Sequence[HandReading], label: str) -> Readings | None:
    """Return the readings of the frontal sensors during a scan; None if there are none.

    Args:
        hand: sensors and body of the hand.
        log: readings of the hand during the scan.
        label: label of the plane.
    """
    rows = [(k, i) for k, s in enumerate(log) for i in hand.frontal if s.states[i] == HIT]
    if not rows:
        return None
    n = len(rows)
    return Readings.from_columns(
        ids=[f"{label} {k + 1}" for k in range(n)],
        ranges=np.array([log[k].ranges[i] for k, i in rows]),
        sensors=[hand.rig.sensors[i].name for _, i in rows],
        Ts_world_hand=exact_poses(np.array([log[k].T_world_hand for k, _ in rows])),
        features=[label] * n,
        kinds=["plane"] * n,
        source="acquisition",
    )


def labelled_readings(hand: Hand, places: Sequence[EdgeEvent | WallReading], label: str, kind: str) -> Readings:
    """Return the readings of crossings of an edge or rim, or of the wall of a bore or boss.

    Args:
        hand: sensors and body of the hand.
        places: crossings or wall readings.
        label: label of the feature.
        kind: kind of the readings.
    """
    n = len(places)
    return Readings.from_columns(
        ids=[f"{label} {k + 1}" for k in range(n)],
        ranges=np.array([p.distance for p in places]),
        sds=np.array([p.along_sd for p in places]),
        across_sds=np.array([p.across_sd for p in places]),
        sensors=[hand.rig.sensors[p.sensor].name for p in places],
        Ts_world_hand=exact_poses(np.array([p.T_world_hand for p in places])),
        features=[label] * n,
        kinds=[kind] * n,
        source="acquisition",
    )


def exact_poses(Ts: Transforms) -> Transforms:
    """Return poses that a readings file, which stores quaternions, reproduces bit for bit.

    Args:
        Ts: poses ``(n, 4, 4)`` [m].
    """
    Ts = np.array(Ts, dtype=np.float64)
    R = Ts[:, :3, :3]
    for k in range(_ATTEMPTS):
        q = SO3.as_quaternion(R)
        stays = (SO3.from_quaternion(q) == R).all(axis=(1, 2))
        if stays.all():
            break
        q[:, k % 4] += (k % 8 >= 4) * 2e-16 * (1 + k // 8)
        R = np.where(stays[:, None, None], R, SO3.from_quaternion(q))
    Ts[:, :3, :3] = R
    return Ts


def fitted_feature(
    readings: Readings, label: str, rig: Rig, robot: RobotPreset | str | None
) -> tuple[Feature | None, str]:
    """Return the feature of one label, or None, and notes or the reason of the failure.

    Args:
        readings: ranges with hand poses and labels.
        label: label of the feature.
        rig: range sensors on the hand.
        robot: preset of the robot's errors; None to assume none.
    """
    try:
        features, notes = features_of(readings, rig, robot)
    except DegenerateError as error:
        return None, str(error)
    return features.get(label), "; ".join(notes)


def plane_as_published(readings: Readings, rig: Rig, label: str, robot: RobotPreset | str | None = None) -> Feature:
    """Return the plane whose normal is perpendicular to two directions, each through two readings of a scan.

    The first direction joins readings of the two sensors near the middle of the scan, the second one the first
    sensor's readings at both ends of it. The origin is the first of the four points. :func:`features_of` uses all
    readings and is several times better (``math.md`` section 8).

    Args:
        readings: record with the scan of a plane by two sensors.
        rig: range sensors on the hand.
        label: label of the scan.
        robot: preset of the robot's errors; None to assume none.

    Raises:
        InputError: the label does not have exactly two sensors, or has fewer than four readings.
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
    """Return the rows of the four readings, in the order of the construction ``(4,)``."""
    sensors = np.array(readings.sensors)[rows]
    names = list(dict.fromkeys(sensors.tolist()))
    if len(names) != 2 or len(rows) < 4:
        raise InputError(
            f"plane {label!r}: expected four readings or more of two sensors, got {len(rows)} of {len(names)}. Scan "
            "the face with both frontal sensors."
        )
    places = readings.Ts_world_hand[rows][:, :3, 3]
    away = places - places.mean(axis=0)
    along = away @ np.linalg.svd(away, full_matrices=False)[2][0]
    first, second = (np.flatnonzero(sensors == name) for name in names)
    ends = first[np.argmax(along[first])], first[np.argmin(along[first])]
    inner = [k for k in first if k not in ends] or list(first)
    middle = min(inner, key=lambda k: abs(along[k]))
    partner = second[np.argmin(np.abs(along[second] - along[middle]))]
    return np.asarray(rows[[middle, partner, *ends]])
