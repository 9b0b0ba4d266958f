"""Messages of a recording of ROS that say where something was sensed, and the frames of them, by rosbags."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import MissingExtraError, ReadingsError, did_you_mean
from tanteo.io.transforms import FrameTree, Track, pose_of
from tanteo.typing import Transforms

RANGE, POINT, POSE = "sensor_msgs/msg/Range", "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/PoseStamped"
"""Types of messages that are read, beside transforms."""
_TF = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"


@dataclass(frozen=True, slots=True)
class BagOptions:
    """What a recording does not say itself.

    Attributes:
        topics: of the readings; guessed if there are none.
        world: name of the world's frame; the root of the frames above the readings' if not given.
        latency: how much older the readings are than their stamps [s].
    """

    topics: tuple[str, ...] = ()
    world: str | None = None
    latency: float = 0.0


@dataclass(slots=True, eq=False)
class Recorded:
    """Messages of a recording that matter."""

    samples: dict[tuple[str, str], list[tuple[float, Transforms]]] = field(default_factory=dict)
    static: set[str] = field(default_factory=set)
    rows: dict[str, list[tuple[float, str, Any]]] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    lags: list[float] = field(default_factory=list)

    def tree(self) -> FrameTree:
        """Its frames."""
        tree = FrameTree()
        for (child, parent), samples in self.samples.items():
            tree.parents[child] = parent
            tree.tracks[child] = Track.of(samples, static=child in self.static)
        return tree


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError(
            "recordings of ROS: expected rosbags, got none. Install it: pip install 'tanteo[bags]'."
        ) from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            yield reader
    except ReadingsError:
        raise
    except Exception as error:  # noqa: BLE001  a damaged file fails in any way
        why = str(error).split("\n")[0][:120] or type(error).__name__
        raise ReadingsError(
            f"{path}: expected a recording of ROS that is whole, got: {why}. Record or index it again."
        ) from None


def messages_of(path: Path, options: BagOptions) -> Recorded:
    """What a recording says.

    Raises:
        MissingExtraError: rosbags is not installed.
        ReadingsError: it is damaged, or has no such topic.
    """
    recorded = Recorded()
    with _opened(path) as reader:
        there = {c.topic: c.msgtype for c in reader.connections}
        for topic in options.topics:
            if topic not in there:
                known = ", ".join(sorted(there)) or "none"
                raise ReadingsError(
                    f"{path}, --topic: expected one of {known}, got '{topic}'.{did_you_mean(topic, there)}"
                )
        wanted = {t: kind for t, kind in there.items() if kind in (*_TF, POSE) or _is_reading(t, kind, options)}
        recorded.kinds = wanted
        for connection, received, raw in reader.messages([c for c in reader.connections if c.topic in wanted]):
            _take(
                recorded,
                connection.topic,
                wanted[connection.topic],
                received,
                reader.deserialize(raw, connection.msgtype),
            )
    return recorded


def _is_reading(topic: str, kind: str, options: BagOptions) -> bool:
    return kind in (RANGE, POINT) and (not options.topics or topic in options.topics)


def _take(recorded: Recorded, topic: str, kind: str, received: int, message: Any) -> None:
    if kind in _TF:
        for one in message.transforms:
            child, t, q = _name(one.child_frame_id), one.transform.translation, one.transform.rotation
            T = pose_of(np.array([t.x, t.y, t.z]), np.array([q.x, q.y, q.z, q.w]))
            key = child, _name(one.header.frame_id)
            recorded.samples.setdefault(key, []).append((_seconds(one.header.stamp), T))
            recorded.static |= {child} if topic.endswith("tf_static") else set()
        return
    stamp = _seconds(message.header.stamp)
    recorded.rows.setdefault(topic, []).append((stamp, _name(message.header.frame_id), message))
    if kind != POSE and 0 <= 1e-9 * received - stamp < 60:
        recorded.lags.append(1e-9 * received - stamp)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _name(frame: str) -> str:
    return frame.lstrip("/")
