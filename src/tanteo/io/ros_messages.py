"""Messages of ROS that say where something was sensed, and the frames of them: of a recording, or as they come.

Read are ``sensor_msgs/Range``, ``geometry_msgs/PointStamped``, ``PoseStamped`` and ``tf2_msgs/TFMessage``, as objects
with the fields of these types, whoever made them (rosbags, rclpy).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from tanteo.errors import ReadingsError, did_you_mean
from tanteo.io.transforms import FrameTree, Track, pose_of
from tanteo.typing import BoolArray, FloatArray, Transforms

RANGE, POINT, POSE = "sensor_msgs/msg/Range", "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/PoseStamped"
"""Types of messages that are read, beside transforms."""
TF = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"
"""Types of transforms."""
_SET_BACK = 1.0
"""Stamps of one publisher that go back further than this are of a clock that was set back [s]; less is disorder."""
_LAGS = 1000
"""Of so many messages it is kept how late they came, where old ones are dropped."""
_LATEST = 60.0
"""A message that comes later than this after its stamp has been stamped by another clock [s]."""


@dataclass(frozen=True, slots=True)
class RosOptions:
    """What messages do not say themselves.

    Attributes:
        topics: of the readings, and of the hand's poses; guessed if none is named.
        world: name of the world's frame; the root of the frames above the readings' if not given.
        latency: how much older the readings are than their stamps [s].
    """

    topics: tuple[str, ...] = ()
    world: str | None = None
    latency: float = 0.0


class Row(NamedTuple):
    """One message: its stamp [s], its frame, and its numbers.

    These are range, least, most and variance of a range; a point; the rows of the matrix of a pose.
    """

    stamp: float
    frame: str
    values: tuple[float, ...]


@dataclass(slots=True, eq=False)
class RosMessages:
    """Messages that matter, in the order in which they came.

    Attributes:
        samples: transforms by child and parent, each with its stamp [s].
        static: children that do not move.
        rows: of each topic.
        kinds: type of each topic.
        lags: between stamps and when the messages came [s].
        overlaps: stamps that came twice, as a clock was set back: from, to [s].
        broken: messages with numbers that cannot be.
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
        """A message of a topic in :attr:`kinds`, and when it came [s]."""
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
        child, parent, stamp = _name(one.child_frame_id), _name(one.header.frame_id), _seconds(one.header.stamp)
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

    def twice(self, stamps: FloatArray) -> BoolArray:
        """Which stamps a clock that was set back passed twice: what they mean is not known ``(n,)``."""
        hit = np.zeros(len(stamps), dtype=bool)
        for low, high in self.overlaps:
            hit |= (stamps >= low) & (stamps <= high)
        return hit

    def tree(self) -> FrameTree:
        """Its frames."""
        tree = FrameTree()
        for (child, parent), samples in self.samples.items():
            tree.parents[child] = parent
            tree.tracks[child] = Track.of(samples, static=child in self.static)
        return tree

    def since(self, moment: float) -> RosMessages:
        """The same without what is older [s], but for the last transform of each frame before it."""
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
    """Which topics matter, with their types, of those that are there: named ones alone, where one of its sort is."""
    named = [topic for topic in options.topics if topic in there]
    hands = [topic for topic in named if there[topic] == POSE]
    readings = [topic for topic in named if topic not in hands]

    def matters(topic: str, kind: str) -> bool:
        if kind == POSE:
            return not hands or topic in hands
        return kind in TF or (kind in (RANGE, POINT) and (not readings or topic in readings))

    return {topic: kind for topic, kind in there.items() if matters(topic, kind)}


def check_topics(there: Mapping[str, str], options: RosOptions, source: str) -> None:
    """Raises ReadingsError where a topic that is named is not there."""
    for topic in options.topics:
        if topic not in there:
            known = ", ".join(sorted(there)) or "none"
            raise ReadingsError(
                f"{source}, --topic: expected one of {known}, got '{topic}'.{did_you_mean(topic, there)}"
            )


def topics_of(messages: RosMessages, options: RosOptions, source: str) -> tuple[list[str], list[str]]:
    """The topics that readings are taken of, all of one type, and what a person should know of that.

    Raises:
        ReadingsError: there is none, or those that are named are of two types.
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
    return topics, [] if options.topics else [f"Readings are taken of {', '.join(topics)}; others with --topic."]


def unique(rows: Sequence[Row]) -> Iterator[Row]:
    """Rows in the order of their stamps, each once."""
    seen = set[Row]()
    for row in sorted(rows, key=lambda row: row.stamp):
        if row not in seen:
            seen.add(row)
            yield row


def says_something(kind: str, row: Row) -> bool:
    """Whether a row is a reading; of a range that met nothing, somebody has to have said how far that would be."""
    if kind != RANGE:
        return True
    distance, least, most, _ = row.values
    return distance > 0 and distance >= least and (np.isfinite(distance) or most > 0)  # NaN is none of it


def pose_in(row: Row) -> Transforms:
    """The pose of a row ``(4, 4)``."""
    return np.array(row.values).reshape(4, 4)


def _range(message: Any) -> tuple[float, ...]:
    # variance is of later releases of ROS 2; 0 is "not known"
    return message.range, message.min_range, message.max_range, getattr(message, "variance", 0.0)


def _point(message: Any) -> tuple[float, float, float]:
    return message.point.x, message.point.y, message.point.z


def _posed(message: Any) -> tuple[float, ...]:
    T = _pose(message.pose.position, message.pose.orientation)
    return (np.nan,) if T is None else tuple(T.ravel().tolist())


_VALUES: dict[str, Any] = {RANGE: _range, POINT: _point, POSE: _posed}


def _pose(p: Any, q: Any) -> Transforms | None:
    """A pose; None of numbers that are none: a quaternion of length zero turns nowhere."""
    values = np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w], dtype=np.float64)
    if not np.isfinite(values).all() or np.linalg.norm(values[3:]) < 1e-6:
        return None
    return pose_of(values[:3], values[3:])


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _name(frame: str) -> str:
    return frame.lstrip("/")
