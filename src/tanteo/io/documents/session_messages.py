"""Convert a session to ROS 2 messages: readings, the result of each step, and the complete record at the end."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.io.documents import ros_answers as ros
from tanteo.io.documents.ros_messages import POINT, RANGE, TF
from tanteo.planning import Session, Step
from tanteo.sensors import Column, Readings

RECORD, SPREAD = "/tanteo/record", "/tanteo/corner_sd"
"""Topics of the record ``tanteo.session/1`` as text, and of the largest corner standard deviation at each step."""
TEXT, _NUMBER = "std_msgs/msg/String", "std_msgs/msg/Float64"
_WORLD, _PROBE = "world", "tanteo_probe"
_APART = 1000
"""Time between the readings of a step [ns], which separates the probe's transforms."""


class Sent(NamedTuple):
    """Message to write: time stamp [ns], topic, type, and fields by name."""

    stamp: int
    topic: str
    kind: str
    fields: dict[str, Any]


def of_step(session: Session, step: Step, readings: Readings | None, stamp: int) -> Iterator[Sent]:
    """Yield the messages of one step: readings and resulting posterior.

    Args:
        session: session that the step is part of.
        step: result of the step.
        readings: new readings of the step; None if there were none.
        stamp: time stamp of the step [ns].
    """
    placed = None if readings is None else _in_world(session, readings)
    points = None if placed is None else placed.points[:]
    if placed is not None:
        yield from _sensed(placed, stamp)
    if step.part >= 0:
        part = session.start.targets[step.part].part
        pose = ros.pose_message(step.T_world_part, step.covariance, stamp, _WORLD)
        yield Sent(stamp, "/tanteo/pose", ros.POSE_COVARIANCE, pose)
        best = ros.Placed(part, step.T_world_part, float(step.probabilities[step.part]))
        yield Sent(stamp, "/tanteo/hypotheses", ros.MARKERS, ros.marker_message([best], points, stamp, _WORLD))
    yield Sent(stamp, SPREAD, _NUMBER, {"data": float(step.corner_sd)})
    names = [target.part.name for target in session.start.targets]
    values = {f"probability {name}": f"{p:.4f}" for name, p in zip(names, step.probabilities, strict=True)}
    values["probability unknown object"] = f"{step.unknown:.4f}"
    values["largest corner sd [mm]"] = f"{1e3 * step.corner_sd:.4f}"
    summary = step.note or ", ".join(step.ids)
    state = ros.diagnostics_message(ros.WARN if step.note else ros.OK, summary, values, stamp)
    yield Sent(stamp, "/diagnostics", ros.DIAGNOSTICS, state)


def of_end(session: Session, document: dict[str, Any], stamp: int) -> Iterator[Sent]:
    """Yield the messages after the last step: all hypotheses, and the record as text.

    Args:
        session: session to write.
        document: record of the session, ``tanteo.session/1``.
        stamp: time stamp [ns].
    """
    parts = {target.part.name: target.part for target in session.start.targets}
    placed = [ros.Placed(parts[h.part], h.T_world_part, h.probability) for h in session.answer().hypotheses]
    points = None if session.readings is None else _in_world(session, session.readings).points[:]
    yield Sent(stamp, "/tanteo/hypotheses", ros.MARKERS, ros.marker_message(placed, points, stamp, _WORLD))
    yield Sent(stamp, RECORD, TEXT, {"data": json.dumps(document, allow_nan=False, separators=(",", ":"))})


def _in_world(session: Session, readings: Readings) -> Readings:
    """Return readings with points, directions and largest ranges in the world, also for sensors on a hand."""
    if readings.points.given.all():
        return readings
    points = readings.points.filled(np.nan)
    directions = readings.directions.filled(np.nan)
    most = readings.max_ranges.filled(np.nan)
    measured = session.sensing.measured(readings)
    points[measured.rows] = measured.points
    directions[measured.rows] = measured.directions
    rows = [readings.ids.index(name) for name in measured.free.ids]
    points[rows] = measured.free.origins
    directions[rows] = measured.free.directions
    most[rows] = measured.free.lengths
    return replace(
        readings,
        points=Column.from_rows(points),
        directions=Column.from_rows(directions),
        max_ranges=Column.from_rows(most),
    )


def _sensed(readings: Readings, begin: int) -> Iterator[Sent]:
    """Yield contact readings as points (tip centres), and ranges along the x axis of a probe frame."""
    is_beam = readings.directions.given & (readings.radii == 0) & (readings.ranges.given | readings.is_free)
    limits = readings.max_ranges.filled(0.0)
    sds = readings.sds.filled(np.nan)
    for k, point in enumerate(readings.points[:]):
        stamp = begin + k * _APART
        if not is_beam[k]:
            yield Sent(stamp, "/tanteo/touch", POINT, ros.point_message(point, stamp, _WORLD))
            continue
        direction = readings.directions[k]
        free = bool(readings.is_free[k])
        distance = np.inf if free else float(readings.ranges[k])
        T = SE3.from_parts(SO3.frame_from_axis(direction, 0), point if free else point - distance * direction)
        yield Sent(stamp, "/tf", TF[0], ros.transform(T, _WORLD, _PROBE, stamp))
        fields = ros.range_message(distance, float(limits[k]), float(sds[k]), stamp, _PROBE)
        yield Sent(stamp, "/tanteo/range", RANGE, fields)
