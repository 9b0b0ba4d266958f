"""Collect ROS messages with readings and transforms, from a recording or live.

Supported types are ``sensor_msgs/Range``, ``geometry_msgs/PointStamped``, ``PoseStamped`` and ``tf2_msgs/TFMessage``,
as objects with the fields of these types (from rosbags or rclpy).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tanteo.errors import ReadingsError, did_you_mean
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.io.poses.transforms import FrameTree, Track, pose_of

RANGE, POINT, POSE = "sensor_msgs/msg/Range", "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/PoseStamped"
"""Supported message types other than transforms."""
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

    For a range: distance, smallest range, largest range, variance. For a point: x, y, z. For a pose: the rows of its
    matrix.
    """

    stamp: float
    frame: str
    values: tuple[float, ...]


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
        latest: largest stamp so far by publisher [s].
    """

    samples: dict[tuple[str, str], list[tuple[float, Transforms]]] = field(default_factory=dict)
    static: set[str] = field(default_factory=set)
    rows: dict[str, list[Row]] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    lags: list[float] = field(default_factory=list)
    overlaps: list[tuple[float, float]] = field(default_factory=list)
    broken: int = 0
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
        values = tuple(map(float, _VALUES[kind](message)))
        if kind != RANGE and not np.isfinite(values).all():
            self.broken += 1
            return
        self._clock(topic, stamp)
        self.rows.setdefault(topic, []).append(Row(stamp, _name(message.header.frame_id), values))
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
            older = [one for one in known if one[0] < moment]
            samples[key] = older[-1:] + [one for one in known if one[0] >= moment]
        rows = {topic: [row for row in known if row.stamp >= moment] for topic, known in self.rows.items()}
        overlaps = [one for one in self.overlaps if one[1] >= moment]
        return RosMessages(
            samples, self.static, rows, self.kinds, self.lags[-_LAGS:], overlaps, self.broken, self.latest
        )  # fmt: skip


def wanted_topics(there: Mapping[str, str], options: RosOptions) -> dict[str, str]:
    """Return the relevant topics with their types; named topics replace the other topics of their kind.

    Args:
        there: available topics with their types.
        options: named topics.
    """
    named = [topic for topic in options.topics if topic in there]
    hands = [topic for topic in named if there[topic] == POSE]
    readings = [topic for topic in named if topic not in hands]

    def matters(topic: str, kind: str) -> bool:
        if kind == POSE:
            return not hands or topic in hands
        return kind in TF or (kind in (RANGE, POINT) and (not readings or topic in readings))

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
    topics = [t for t, kind in messages.kinds.items() if kind in (RANGE, POINT) and messages.rows.get(t)]
    if not topics:
        raise ReadingsError(
            f"{source}: expected messages of sensor_msgs/Range or geometry_msgs/PointStamped, got none. Name --topic."
        )
    if len({messages.kinds[t] for t in topics}) > 1:
        if options.topics:
            raise ReadingsError(f"{source}: expected topics of one type, got ranges and points. Name one --topic.")
        topics = [t for t in topics if messages.kinds[t] == RANGE]
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
    if kind != RANGE:
        return True
    distance, least, most, _ = row.values
    return distance > 0 and distance >= least and (np.isfinite(distance) or most > 0)  # NaN is none of it


def pose_in(row: Row) -> Transforms:
    """Return the pose ``(4, 4)`` of a row.

    Args:
        row: values of a pose message.
    """
    return np.array(row.values).reshape(4, 4)


def _range(message: Any) -> tuple[float, ...]:
    # only later releases of ROS 2 have a variance; 0 means unknown
    return message.range, message.min_range, message.max_range, getattr(message, "variance", 0.0)


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
