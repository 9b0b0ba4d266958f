"""Collect ROS messages with readings and transforms, from a recording or live.

Supported types are ``sensor_msgs/Range``, ``LaserScan`` and ``PointCloud2``, ``geometry_msgs/PointStamped``,
``PoseStamped`` and ``tf2_msgs/TFMessage``, as objects with the fields of these types (from rosbags or rclpy). Each beam
of a scan has its own stamp.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tanteo.errors import ReadingsError, did_you_mean
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.io.poses.transforms import FrameTree, Track, pose_of

RANGE, POINT, POSE = "sensor_msgs/msg/Range", "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/PoseStamped"
SCAN, CLOUD = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"
"""Supported message types other than transforms."""
BEAMS, SOURCES = (RANGE, SCAN), (RANGE, SCAN, POINT, CLOUD)
"""Message types of ranges, and of all readings, the preferred ones first."""
_PER_MESSAGE = 256
"""Largest number of beams or points of one message that are kept, evenly chosen: neighbours share their errors."""
_FLOATS = {7: "f4", 8: "f8"}
"""NumPy types of the numbers of a point cloud by code of ``sensor_msgs/PointField``."""
TF = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"
"""Supported types of transform messages."""
_SET_BACK = 1.0
"""Decrease of a publisher's stamps above which its clock was set back; smaller ones are messages out of order [s]."""
_LAGS = 1000
"""Number of messages whose delays are kept when old messages are dropped."""
_LATEST = 60.0
"""Largest plausible delay between stamp and reception [s]; a larger one means that another clock made the stamp."""


@dataclass(frozen=True, slots=True)
class RosOptions:
    """Options for the interpretation of ROS messages.

    Attributes:
        topics: topics of the readings and of the hand's poses; chosen automatically if empty.
        world: name of the world frame; None for the root of the transform tree above the readings.
        latency: age of a reading at its stamp [s].
    """

    topics: tuple[str, ...] = ()
    world: str | None = None
    latency: float = 0.0


class Row(NamedTuple):
    """Values of one message, with its stamp [s] and frame.

    For a range: distance, smallest range, largest range, variance, direction x, y, z in its frame, full field of view.
    For a point: x, y, z. For a pose: the rows of its matrix. The number of the message distinguishes scans; it is 0 for
    others.
    """

    stamp: float
    frame: str
    values: tuple[float, ...]
    message: int = 0


@dataclass(slots=True, eq=False)
class RosMessages:
    """Relevant messages in the order of reception.

    Attributes:
        samples: transforms by child and parent frame, each with its stamp [s].
        static: child frames that do not move.
        rows: readings and hand poses by topic.
        kinds: message type by topic.
        lags: delays between stamp and reception [s].
        overlaps: intervals of stamps (start, end) that occur twice because a clock was set back [s].
        broken: number of messages with invalid numbers.
        scans: number of scans and clouds.
        latest: largest stamp so far by publisher [s].
    """

    samples: dict[tuple[str, str], list[tuple[float, Transforms]]] = field(default_factory=dict)
    static: set[str] = field(default_factory=set)
    rows: dict[str, list[Row]] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    lags: list[float] = field(default_factory=list)
    overlaps: list[tuple[float, float]] = field(default_factory=list)
    broken: int = 0
    scans: int = 0
    latest: dict[str, float] = field(default_factory=dict)

    def take(self, topic: str, received: float, message: Any) -> None:
        """Add a message of a topic in :attr:`kinds`.

        Args:
            topic: topic of the message.
            received: time of reception [s].
            message: object with the fields of the message type.

        Raises:
            ReadingsError: the message lacks a field of its type, or a field holds no number.
        """
        try:
            self._take(topic, received, message)
        except (AttributeError, TypeError, ValueError, OverflowError) as error:
            raise ReadingsError(
                f"{topic}: expected messages of {self.kinds[topic]} with the fields that ROS defines, got: {error}. "
                "Record the topic with its standard definition, or choose another with --topic."
            ) from None

    def _take(self, topic: str, received: float, message: Any) -> None:
        kind = self.kinds[topic]
        if kind in TF:
            for one in message.transforms:
                self._frame(one, static=topic.endswith("tf_static"))
            return
        stamp = _seconds(message.header.stamp)
        frame, rows = _name(message.header.frame_id), self.rows.setdefault(topic, [])
        if kind in (SCAN, CLOUD):
            self.scans += 1
            made = _scan_rows(message, stamp) if kind == SCAN else _cloud_rows(message, stamp)
            rows += [Row(when, frame, values, self.scans) for when, values in made]
        else:
            values = tuple(map(float, _VALUES[kind](message)))
            if kind != RANGE and not np.isfinite(values).all():
                self.broken += 1
                return
            rows.append(Row(stamp, frame, values))
        self._clock(topic, stamp)
        if kind != POSE and 0 <= received - stamp < _LATEST:
            self.lags.append(received - stamp)

    def _frame(self, one: Any, *, static: bool) -> None:
        child = _name(one.child_frame_id)
        parent = _name(one.header.frame_id)
        stamp = _seconds(one.header.stamp)
        T = _pose(one.transform.translation, one.transform.rotation)
        if T is None:
            self.broken += 1
            return
        if static:
            self.static.add(child)
        else:
            self._clock(f"{child} in {parent}", stamp)
        self.samples.setdefault((child, parent), []).append((stamp, T))

    def _clock(self, source: str, stamp: float) -> None:
        before = self.latest.get(source, -np.inf)
        if before - stamp > _SET_BACK:
            self.overlaps.append((stamp, before))
            self.latest[source] = stamp
        self.latest[source] = max(stamp, self.latest.get(source, -np.inf))

    def ambiguous(self, stamps: FloatArray) -> BoolArray:
        """Return the mask of stamps in intervals that a reset clock passed twice, where the time is ambiguous ``(n,)``.

        Args:
            stamps: time stamps ``(n,)`` [s].
        """
        hit = np.zeros(len(stamps), dtype=bool)
        for low, high in self.overlaps:
            hit |= (stamps >= low) & (stamps <= high)
        return hit

    def tree(self) -> FrameTree:
        """Return the transform tree."""
        tree = FrameTree()
        for (child, parent), samples in self.samples.items():
            tree.parents[child] = parent
            tree.tracks[child] = Track.of(samples, static=child in self.static)
        return tree

    def since(self, moment: float) -> RosMessages:
        """Return the messages from a time on, with the last earlier transform of each frame.

        Args:
            moment: start time [s].
        """
        samples = {}
        for key, known in self.samples.items():
            newer = [one for one in known if one[0] >= moment]
            last = next((one for one in reversed(known) if one[0] < moment), None)
            samples[key] = newer if last is None else [last, *newer]
        rows = {topic: [row for row in known if row.stamp >= moment] for topic, known in self.rows.items()}
        overlaps = [one for one in self.overlaps if one[1] >= moment]
        return RosMessages(
            samples, self.static, rows, self.kinds, self.lags[-_LAGS:], overlaps, self.broken, self.scans, self.latest
        )  # fmt: skip


def wanted_topics(there: Mapping[str, str], options: RosOptions, sources: Sequence[str] = SOURCES) -> dict[str, str]:
    """Return the relevant topics with their types; named topics replace the other topics of their kind.

    Args:
        there: available topics with their types.
        options: named topics.
        sources: message types that may supply readings.
    """
    named = [topic for topic in options.topics if topic in there]
    hands = [topic for topic in named if there[topic] == POSE]
    readings = [topic for topic in named if topic not in hands]

    def matters(topic: str, kind: str) -> bool:
        if kind == POSE:
            return not hands or topic in hands
        return kind in TF or (kind in sources and (not readings or topic in readings))

    return {topic: kind for topic, kind in there.items() if matters(topic, kind)}


def check_topics(there: Mapping[str, str], options: RosOptions, source: str) -> None:
    """Check that the named topics exist.

    Args:
        there: available topics with their types.
        options: named topics.
        source: file name for messages.

    Raises:
        ReadingsError: a named topic does not exist; the message names the nearest.
    """
    for topic in options.topics:
        if topic not in there:
            known = ", ".join(sorted(there)) or "none"
            raise ReadingsError(
                f"{source}, --topic: expected one of {known}, got '{topic}'.{did_you_mean(topic, there)}"
            )


def topics_of(messages: RosMessages, options: RosOptions, source: str) -> tuple[list[str], list[str]]:
    """Return the topics that supply the readings, all of one type, and notes on their choice.

    Args:
        messages: collected messages.
        options: named topics.
        source: file name for messages.

    Raises:
        ReadingsError: there is no topic with readings, or the named ones have two types.
    """
    topics = [t for t, kind in messages.kinds.items() if kind in SOURCES and messages.rows.get(t)]
    if not topics:
        there = ", ".join(f"{topic} ({kind.replace('/msg', '')})" for topic, kind in messages.kinds.items()) or "none"
        raise ReadingsError(
            f"{source}: expected messages of sensor_msgs/Range, LaserScan or PointCloud2, or of "
            f"geometry_msgs/PointStamped, got {there}. Record one of them, or name its --topic."
        )
    kinds = {messages.kinds[t] for t in topics}
    if len(kinds) > 1:
        if options.topics:
            words = ", ".join(sorted(kind.replace("/msg", "") for kind in kinds))
            raise ReadingsError(f"{source}: expected topics of one type, got {words}. Name one --topic.")
        first = next(kind for kind in SOURCES if kind in kinds)
        topics = [t for t in topics if messages.kinds[t] == first]
    return topics, [] if options.topics else [f"Readings are taken from {', '.join(topics)}; --topic chooses others."]


def unique(rows: Sequence[Row]) -> Iterator[Row]:
    """Yield the rows sorted by stamp, without duplicates.

    Args:
        rows: rows in any order.
    """
    seen = set[Row]()
    for row in sorted(rows, key=lambda row: row.stamp):
        if row not in seen:
            seen.add(row)
            yield row


def is_usable(kind: str, row: Row) -> bool:
    """Return whether a row is a usable reading.

    A range must be within the sensor's limits; an infinite range also needs a stated maximum.

    Args:
        kind: message type.
        row: values of the message.
    """
    if kind not in BEAMS:
        return True
    distance, least, most, *_ = row.values
    return distance > 0 and distance >= least and (np.isfinite(distance) or most > 0)  # NaN is none of it


def pose_in(row: Row) -> Transforms:
    """Return the pose ``(4, 4)`` of a row.

    Args:
        row: values of a pose message.
    """
    return np.array(row.values).reshape(4, 4)


def _range(message: Any) -> tuple[float, ...]:
    # only later releases of ROS 2 have a variance; 0 means unknown
    variance, field_of_view = getattr(message, "variance", 0.0), getattr(message, "field_of_view", 0.0)
    return message.range, message.min_range, message.max_range, variance, 1.0, 0.0, 0.0, field_of_view


def _scan_rows(message: Any, stamp: float) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Yield stamp and values of each beam of a scan: about z of its frame, counted from x."""
    ranges = np.asarray(message.ranges, dtype=np.float64)
    for k in _chosen(len(ranges)):
        angle = float(message.angle_min) + k * float(message.angle_increment)
        limits = float(message.range_min), float(message.range_max)
        values = (float(ranges[k]), *limits, 0.0, math.cos(angle), math.sin(angle), 0.0, 0.0)
        yield stamp + k * float(message.time_increment), values


def _cloud_rows(message: Any, stamp: float) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Yield stamp and coordinates of each finite point of a cloud."""
    order = ">" if message.is_bigendian else "<"
    fields = {one.name: one for one in message.fields if one.name in ("x", "y", "z")}
    if fields.keys() != {"x", "y", "z"} or any(one.datatype not in _FLOATS for one in fields.values()):
        raise ValueError("a cloud without x, y and z as floating-point numbers")
    kind = np.dtype({
        "names": list(fields), "formats": [order + _FLOATS[one.datatype] for one in fields.values()],
        "offsets": [one.offset for one in fields.values()], "itemsize": message.point_step,
    })  # fmt: skip
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    rows = data[: message.height * message.row_step].reshape(message.height, message.row_step)
    packed = np.ascontiguousarray(rows[:, : message.width * message.point_step]).view(kind).ravel()
    points = np.stack([packed[name].astype(np.float64) for name in "xyz"], axis=-1)
    points = points[np.isfinite(points).all(axis=1) & (np.abs(points).max(axis=1, initial=0.0) > 0)]
    for k in _chosen(len(points)):
        yield stamp, tuple(points[k].tolist())


def _chosen(n: int) -> list[int]:
    """Return the indices of evenly chosen beams of a message with ``n``."""
    return list(range(n)) if n <= _PER_MESSAGE else np.linspace(0, n - 1, _PER_MESSAGE).round().astype(int).tolist()


def _point(message: Any) -> tuple[float, float, float]:
    return message.point.x, message.point.y, message.point.z


def _posed(message: Any) -> tuple[float, ...]:
    T = _pose(message.pose.position, message.pose.orientation)
    return (np.nan,) if T is None else tuple(T.ravel().tolist())


_VALUES: dict[str, Any] = {RANGE: _range, POINT: _point, POSE: _posed}


def _pose(p: Any, q: Any) -> Transforms | None:
    """Return a pose matrix; None if a number is not finite or the quaternion has length zero."""
    values = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w], dtype=np.float64)
    if not np.isfinite(values).all() or np.linalg.norm(values[3:]) < 1e-6:
        return None
    return pose_of(values[:3], values[3:])


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _name(frame: str) -> str:
    return frame.lstrip("/")
