"""Recordings of ROS, made by rosbags: messages of a hand that moves, its sensor and its touches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tanteo.geometry import SE3, SO3

STORES = {"ros1": get_typestore(Stores.ROS1_NOETIC), "ros2": get_typestore(Stores.ROS2_HUMBLE)}
STORES["ros1"].register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
KINDS = ["ros1", "sqlite", "mcap"]
T_HAND_SENSOR = SE3.from_parts(SO3.axis_rotation(1, np.pi / 2), np.array([0.01, 0.02, 0.03]))
TIMES = np.arange(0, 2.01, 0.1)


def hand(t: float) -> np.ndarray:
    """Return the pose of a hand at a constant speed, so that interpolation is exact."""
    first = SE3.from_parts(SO3.axis_rotation(2, 0.3), np.array([0.1, 0.0, 0.4]))
    return first @ SE3.exp(t * np.array([0.05, 0.02, -0.01, 0.1, 0.2, 0.3]))


class Recording:
    """Messages, written as one of the kinds."""

    def __init__(self, kind: str) -> None:
        self.kind, self.rows = kind, []
        self.types = STORES["ros1" if kind == "ros1" else "ros2"].types

    def header(self, t: float, frame: str):
        stamp = self.types["builtin_interfaces/msg/Time"](int(t), round(1e9 * (t % 1)))
        args = (0, stamp, frame) if self.kind == "ros1" else (stamp, frame)
        return self.types["std_msgs/msg/Header"](*args)

    def add(self, topic: str, kind: str, t: float, *fields) -> None:
        self.rows.append((topic, kind, t, self.types[kind](*fields)))

    def transform(self, topic: str, t: float, parent: str, child: str, T: np.ndarray) -> None:
        types, xi = self.types, SO3.log(T[:3, :3])
        half = 0.5 * np.linalg.norm(xi)
        q = np.array([*(np.sin(half) * xi / max(2 * half, 1e-12)), np.cos(half)])
        moved = types["geometry_msgs/msg/Transform"](
            types["geometry_msgs/msg/Vector3"](*T[:3, 3]), types["geometry_msgs/msg/Quaternion"](*q)
        )
        one = types["geometry_msgs/msg/TransformStamped"](self.header(t, parent), child, moved)
        self.add(topic, "tf2_msgs/msg/TFMessage", t, [one])

    def range(
        self,
        t: float,
        value: float,
        frame: str = "sensor",
        topic: str = "/range",
        *,
        least: float = 0.02,
        most: float = 0.5,
    ) -> None:
        self.add(topic, "sensor_msgs/msg/Range", t, self.header(t, frame), 1, 0.01, least, most, value)

    def scan(self, t: float, ranges, *, first: float, step: float, gap: float = 0.0, topic: str = "/scan") -> None:
        values = np.asarray(ranges, dtype=np.float32)
        limits = (first, first + step * (len(values) - 1), step, gap, 0.0, 0.02, 0.5)
        none = np.zeros(0, dtype=np.float32)
        self.add(topic, "sensor_msgs/msg/LaserScan", t, self.header(t, "sensor"), *limits, values, none)

    def cloud(self, t: float, points, *, topic: str = "/cloud") -> None:
        xyz = np.asarray(points, dtype="<f4")
        packed = np.concatenate([xyz, np.ones((len(xyz), 1), dtype="<f4")], axis=1)
        fields = [self.types["sensor_msgs/msg/PointField"](n, 4 * k, 7, 1) for k, n in enumerate(("x", "y", "z", "i"))]
        data = np.frombuffer(packed.tobytes(), dtype=np.uint8)
        size = (16, 16 * len(xyz))
        self.add(topic, "sensor_msgs/msg/PointCloud2", t, self.header(t, "sensor"), 1, len(xyz), fields, False, *size,
                 data, True)  # fmt: skip

    def point(self, t: float, place, frame: str = "base", topic: str = "/touch") -> None:
        at = self.types["geometry_msgs/msg/Point"](*map(float, place))
        self.add(topic, "geometry_msgs/msg/PointStamped", t, self.header(t, frame), at)

    def pose(self, t: float, T: np.ndarray) -> None:
        types, xi = self.types, SO3.log(T[:3, :3])
        half = 0.5 * np.linalg.norm(xi)
        q = np.array([*(np.sin(half) * xi / max(2 * half, 1e-12)), np.cos(half)])
        pose = types["geometry_msgs/msg/Pose"](
            types["geometry_msgs/msg/Point"](*T[:3, 3]), types["geometry_msgs/msg/Quaternion"](*q)
        )
        self.add("/hand", "geometry_msgs/msg/PoseStamped", t, self.header(t, "base"), pose)

    def moving(self) -> Recording:
        """Return a recording with the frames of a moving hand."""
        for t in TIMES:
            self.transform("/tf", t, "base", "hand", hand(t))
        self.transform("/tf_static", 0.0, "hand", "sensor", T_HAND_SENSOR)
        return self

    def write(self, folder: Path) -> Path:
        store = STORES["ros1" if self.kind == "ros1" else "ros2"]
        path = folder / ("run.bag" if self.kind == "ros1" else "run")
        storage = {"mcap": StoragePlugin.MCAP, "sqlite": StoragePlugin.SQLITE3}
        writer = Writer1(path) if self.kind == "ros1" else Writer(path, version=9, storage_plugin=storage[self.kind])
        write = store.serialize_ros1 if self.kind == "ros1" else store.serialize_cdr
        with writer:
            kinds = {topic: kind for topic, kind, _, _ in self.rows}
            topics = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
            for topic, kind, t, message in self.rows:
                writer.write(topics[topic], int(1e9 * (t + 0.004)), write(message, kind))
        return path
