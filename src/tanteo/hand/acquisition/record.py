"""The record of an acquisition: labelled raw ranges with the hand's pose, and the features that they make."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.features import CIRCLE, Feature
from tanteo.fitting import FitReport, circle_on_plane, fit_labelled, plane_from_two_directions
from tanteo.geometry import SO3
from tanteo.geometry.typing import IntArray, Transforms
from tanteo.hand.motion.crossing import EdgeEvent
from tanteo.hand.robot import MET, Hand, HandReading
from tanteo.sensors import Readings, Rig, RobotPreset, measure, reading_kind

if TYPE_CHECKING:
    from tanteo.hand.acquisition.wall import WallReading

_ATTEMPTS = 500
"""Poses are nudged by less than 1e-12 until they survive the way through a quaternion; half of them do at once."""


def features_of(
    readings: Readings, rig: Rig, robot: RobotPreset | str | None = None, *, tolerance: float = 0.0
) -> tuple[dict[str, Feature], tuple[str, ...]]:
    """The feature of every label of a record, the same to the last bit whether it was kept or read from its file.

    Args:
        readings: Ranges with hand poses and labels.
        rig: Where the sensors sit.
        robot: Errors of the robot; none are assumed without it.
        tolerance: sd of the made surface against its ideal form [m].

    Returns:
        Features by label, and notes on what could not be used.
    """
    features, notes = dict[str, Feature](), list[str]()
    for label in dict.fromkeys(readings.features):
        # each label by itself: beside others its sums may be rounded in another order
        own = readings.take(np.flatnonzero(np.array(readings.features) == label))
        face = features.get(face_label(label))
        if face is not None and reading_kind(own.kinds[0]).feature is CIRCLE:
            features[label] = circle_in_face(own, face, label, rig, robot)[0]
            continue
        fitted = fit_labelled(measure(own, rig=rig, robot=robot), tolerance)
        notes += [*fitted.notes, *(f"reading {name} was left out" for name in fitted.rejected)]
        features |= {f.label: f for f in fitted.features if isinstance(f, Feature)}
    return features, tuple(notes)


def face_label(label: str) -> str:
    """Of the face in which a rim is."""
    return f"{label} face"


def circle_in_face(
    readings: Readings, face: Feature, label: str, rig: Rig, robot: RobotPreset | str | None = None
) -> tuple[Feature, FitReport]:
    """The rim of which readings are crossings: a circle in its face, which knows its axis and height far better.

    Raises:
        DegenerateError: the crossings do not determine it.
    """
    m = measure(readings, rig=rig, robot=robot)
    shared = tuple(zip(m.shared, m.jacobians, strict=True))
    return circle_on_plane(m.points, m.covs, face, label=label, readings=m.ids, shared=shared)


def plane_readings(hand: Hand, log: Sequence[HandReading], label: str) -> Readings | None:
    """Readings of the frontal sensors at the instants of a scan; none if there are none."""
    rows = [(k, i) for k, s in enumerate(log) for i in hand.frontal if s.states[i] == MET]
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
    """Readings of the crossings of an edge or a rim, or of the wall of a bore or a boss."""
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
    """Poses that are the same to the last bit after a readings file has kept them as quaternions."""
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
    """One label's feature, or None and why."""
    try:
        features, notes = features_of(readings, rig, robot)
    except DegenerateError as error:
        return None, str(error)
    return features.get(label), "; ".join(notes)


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
    places = readings.Ts_world_hand[rows][:, :3, 3]
    away = places - places.mean(axis=0)
    along = away @ np.linalg.svd(away, full_matrices=False)[2][0]
    first, second = (np.flatnonzero(sensors == name) for name in names)
    ends = first[np.argmax(along[first])], first[np.argmin(along[first])]
    inner = [k for k in first if k not in ends] or list(first)
    middle = min(inner, key=lambda k: abs(along[k]))
    partner = second[np.argmin(np.abs(along[second] - along[middle]))]
    return np.asarray(rows[[middle, partner, *ends]])
