"""A session as an MCAP file of ROS 2 messages, which Foxglove and ``ros2 bag play`` open, with its whole record inside.

The file is made anew of all that the session knows, and replaced whole or not at all: at every moment it is one that
any reader opens. When a step was made stands in the file alone, so it is taken from the one that is replaced.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tanteo.errors import InputError, MissingExtraError
from tanteo.io.broken_bags import STARTS
from tanteo.io.ros_answers import (
    DIAGNOSTICS,
    MARKERS,
    OK,
    POSE_COVARIANCE,
    WARN,
    Placed,
    diagnostics_message,
    marker_message,
    point_message,
    pose_message,
    range_message,
    transform,
)
from tanteo.io.ros_messages import POINT, RANGE, TF
from tanteo.lie import SE3, SO3
from tanteo.replaced import replaced
from tanteo.sensors import Readings
from tanteo.session import Session, Step

NEEDS_MCAP = "MCAP: expected the packages mcap and rosbags, got none. Install them: pip install 'tanteo[bags]'."
"""What is said where one is missing."""
SUFFIX = ".mcap"
"""Of a record that is written so."""
RECORD = "/tanteo/record"
"""Topic of the record, ``tanteo.session/1``, as text."""
_TEXT, _NUMBER = "std_msgs/msg/String", "std_msgs/msg/Float64"
_SPREAD = "/tanteo/corner_sd"
"""Topic that has one message a step."""
_BLANK = {"string": "", "bool": False}
"""Defaults of what is no number."""
_STEP, _APART = 1_000_000, 1000
"""Least time between two steps, and time between the readings of a step [ns]: of each the probe's frame is another."""
_WORLD, _PROBE = "world", "tanteo_probe"


class Sent(NamedTuple):
    """A message: its topic, its type, its fields."""

    topic: str
    kind: str
    fields: dict[str, Any]


def write_mcap(session: Session, document: dict[str, Any], path: str | Path) -> None:
    """Write a session and the document of its record.

    Raises:
        MissingExtraError: rosbags or mcap is not installed.
        OSError: the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise MissingExtraError(NEEDS_MCAP) from None
    stamps = _stamps(Path(path), document, len(session.steps))
    with replaced(path) as name, name.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="tanteo")
        channels = _Channels(writer)
        for stamp, step, readings in zip(stamps, session.steps, _told(session), strict=True):
            for k, sent in () if readings is None else _sensed(readings, stamp):
                channels.add(sent, stamp + k * _APART)
            for sent in _of_step(session, step, readings, stamp):
                channels.add(sent, stamp)
        end = stamps[-1] if stamps else _now()
        for sent in _of_end(session, document, end):
            channels.add(sent, end)
        writer.finish()


def is_mcap(path: Path) -> bool:
    """Whether a file begins as one; what cannot be opened is none."""
    with suppress(OSError):
        if path.is_file():
            with path.open("rb") as file:
                return STARTS.get(file.read(8)) == "mcap"
    return False


def has_record(path: Path) -> bool:
    """Whether it is an MCAP file with the record of a session; only its index is read."""
    return is_mcap(path) and any(True for _ in _stored(path, RECORD))


def record_text(path: Path) -> str:
    """The record of a session in an MCAP file, ``tanteo.session/1``.

    Raises:
        MissingExtraError: rosbags or mcap is not installed.
        InputError: it has none.
    """
    texts = [data for _, data in _stored(path, RECORD)]
    if not texts:
        raise InputError(
            f"{path}: expected an MCAP file with the record of a session ({RECORD}), got none. Give one that "
            "--record wrote; tanteo identify reads the readings of others."
        )
    return str(_typestore().deserialize_cdr(texts[-1], _TEXT).data)


def _stored(path: Path, topic: str) -> Iterator[tuple[int, bytes]]:
    """Messages of a topic, by the index of the file; none of a file that has no index: it is none of ours."""
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise MissingExtraError(NEEDS_MCAP) from None
    with path.open("rb") as file:
        try:
            for _, _, message in make_reader(file).iter_messages(topics=[topic]):
                yield message.log_time, message.data
        except Exception:  # noqa: BLE001  a damaged file fails in any way
            return


def _now() -> int:
    """In whole microseconds: more is lost where a moment is read as a number of seconds [ns]."""
    return time.time_ns() // 1000 * 1000


def _told(session: Session) -> Iterator[Readings | None]:
    for one in session.observations:
        yield one.readings


def _stamps(path: Path, document: dict[str, Any], count: int) -> list[int]:
    """Of each step, as it is in the file already, or now [ns]; no two are alike."""
    stamps = _stamps_before(path, document)[:count]
    while len(stamps) < count:
        stamps.append(max(_now(), stamps[-1] + _STEP if stamps else 0))
    return stamps


def _stamps_before(path: Path, document: dict[str, Any]) -> list[int]:
    """When the steps were made that are in the file already; none of another session."""
    if not is_mcap(path):
        return []
    try:
        before = json.loads(record_text(path))["observations"]
    except (InputError, ValueError, KeyError, TypeError):
        return []
    same = json.loads(json.dumps(document["observations"]))[: len(before)] == before
    found = [stamp for stamp, _ in _stored(path, _SPREAD)]
    return found if same else []


def _of_step(session: Session, step: Step, readings: Readings | None, stamp: int) -> Iterator[Sent]:
    """What came of a step."""
    target = session.start.targets[step.part] if step.part >= 0 else None
    if target is not None:
        yield Sent("/tanteo/pose", POSE_COVARIANCE, pose_message(step.T_world_part, step.covariance, stamp, _WORLD))
        best = Placed(target.part, step.T_world_part, float(step.probabilities[step.part]))
        markers = marker_message([best], None if readings is None else readings.points, stamp, _WORLD)
        yield Sent("/tanteo/hypotheses", MARKERS, markers)
    yield Sent(_SPREAD, _NUMBER, {"data": float(step.corner_sd)})
    names = [target.part.name for target in session.start.targets]
    values = {f"probability {name}": f"{p:.4f}" for name, p in zip(names, step.probabilities, strict=True)}
    values["probability unknown object"] = f"{step.unknown:.4f}"
    values["largest corner sd [mm]"] = f"{1e3 * step.corner_sd:.4f}"
    said = step.note or ", ".join(step.ids)
    yield Sent("/diagnostics", DIAGNOSTICS, diagnostics_message(WARN if step.note else OK, said, values, stamp))


def _of_end(session: Session, document: dict[str, Any], stamp: int) -> Iterator[Sent]:
    """All that is possible at the end, and the record."""
    parts = {target.part.name: target.part for target in session.start.targets}
    answer = session.answer()
    placed = [Placed(parts[h.part], h.T_world_part, h.probability) for h in answer.hypotheses]
    points = None if session.readings is None else session.readings.points
    yield Sent("/tanteo/hypotheses", MARKERS, marker_message(placed, points, stamp, _WORLD))
    yield Sent(RECORD, _TEXT, {"data": json.dumps(document, allow_nan=False, separators=(",", ":"))})


def _sensed(readings: Readings, begin: int) -> Iterator[tuple[int, Sent]]:
    """Touches as points, the centres of the ball; ranges along the x axis of a frame of the probe; with their rows."""
    for k in range(len(readings)):
        stamp = begin + k * _APART
        point, direction, distance = readings.points[k], readings.directions[k], readings.ranges[k]
        free = bool(readings.is_free[k])
        if np.isnan(point).any():
            continue  # of a sensor on a hand: its place is in the record
        if np.isnan(direction).any() or readings.radii[k] > 0 or (np.isnan(distance) and not free):
            yield k, Sent("/tanteo/touch", POINT, point_message(point, stamp, _WORLD))
            continue
        origin = point if free else point - distance * direction
        T = SE3.from_parts(SO3.frame_from_axis(direction, 0), origin)
        yield k, Sent("/tf", TF[0], transform(T, _WORLD, _PROBE, stamp))
        most = float(np.nan_to_num(readings.max_ranges[k]))
        fields = range_message(np.inf if free else float(distance), most, float(readings.sds[k]), stamp, _PROBE)
        yield k, Sent("/tanteo/range", RANGE, fields)


def _typestore() -> Any:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError(NEEDS_MCAP) from None
    return get_typestore(Stores.ROS2_JAZZY)


class _Channels:
    """Topics of a file, each registered when it is first written to."""

    def __init__(self, writer: Any) -> None:
        self.writer, self.store, self.ids = writer, _typestore(), dict[str, int]()

    def add(self, sent: Sent, stamp: int) -> None:
        """Write a message."""
        if sent.topic not in self.ids:
            text, _ = self.store.generate_msgdef(sent.kind, ros_version=2)
            schema = self.writer.register_schema(name=sent.kind, encoding="ros2msg", data=text.encode())
            self.ids[sent.topic] = self.writer.register_channel(
                topic=sent.topic, message_encoding="cdr", schema_id=schema
            )
        data = bytes(self.store.serialize_cdr(_filled(self.store, sent.kind, sent.fields), sent.kind))
        self.writer.add_message(self.ids[sent.topic], log_time=stamp, data=data, publish_time=stamp)


def _filled(store: Any, kind: str, fields: dict[str, Any]) -> Any:
    """A message of rosbags' types; what is missing has its default."""
    described = store.fielddefs[kind][1]
    return store.types[kind](**{name: _value(store, what, fields.get(name)) for name, what in described})


def _value(store: Any, described: Sequence[Any], given: Any) -> Any:
    """One field: a number or text, a message, or several of these."""
    from rosbags.interfaces import Nodetype

    node, what = described[0], described[1]
    if node == Nodetype.NAME:
        return _filled(store, what, given or {})
    if node == Nodetype.BASE:
        return _BLANK.get(what[0], 0) if given is None else given
    element, length = what
    items = given if given is not None else [None] * (length if node == Nodetype.ARRAY else 0)
    if element[0] == Nodetype.BASE and element[1][0] != "string":
        return np.array([0 if item is None else item for item in items], dtype=element[1][0])
    return [_value(store, element, item) for item in items]
