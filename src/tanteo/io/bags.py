"""Recordings of ROS: bags of ROS 1, ROS 2 (SQLite, MCAP), by rosbags; ranges and touches in the world at their stamps.

Read for it: ``sensor_msgs/Range`` (the beam runs along +x of its frame; minus infinity is something too near, infinity
is nothing, REP 117), ``geometry_msgs/PointStamped``, ``PoseStamped``, ``tf2_msgs/TFMessage``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.io.bag_messages import POINT, POSE, RANGE, BagOptions, Recorded, messages_of
from tanteo.io.log_readings import readings_of
from tanteo.io.stated import Stated
from tanteo.io.transforms import FrameTree, Track, pose_of
from tanteo.logs import Log, LogFormat
from tanteo.sensors import Readings
from tanteo.typing import BoolArray, FloatArray, Transforms

BAG = "bag"
"""Name of the format."""
_STARTS = (b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0")
_FORM = LogFormat(BAG, "a recording of ROS", lambda contents: False, lambda contents: Log())


def is_bag(path: Path) -> bool:
    """Whether it is a recording of ROS: a file, or a folder with ``metadata.yaml``."""
    try:
        if path.is_dir():
            return (path / "metadata.yaml").is_file()
        if not path.is_file():  # opening a pipe would wait for who writes to it
            return False
        with path.open("rb") as file:
            return file.read(16).startswith(_STARTS)
    except OSError:
        return False


def read_bag(path: Path, stated: Stated, options: BagOptions) -> Readings:
    """Readings of a recording, in the world at their stamps.

    Raises:
        MissingExtraError: rosbags is not installed.
        ReadingsError: it is damaged, has no topic of readings, or frames that do not hang together.
    """
    recorded = messages_of(path, options)
    topics = [t for t, kind in recorded.kinds.items() if kind in (RANGE, POINT) and recorded.rows.get(t)]
    kinds = {recorded.kinds[t] for t in topics}
    notes = list[str]()
    if not topics:
        raise ReadingsError(
            f"{path}: expected messages of sensor_msgs/Range or geometry_msgs/PointStamped, got none. Name --topic."
        )
    if len(kinds) > 1:
        if options.topics:
            raise ReadingsError(f"{path}: expected topics of one type, got ranges and points. Name one --topic.")
        topics = [t for t in topics if recorded.kinds[t] == RANGE]
    if not options.topics:
        notes.append(f"Readings are taken of {', '.join(topics)}; others with --topic.")
    tree = recorded.tree()
    if recorded.lags:
        typical, most = np.median(recorded.lags), max(recorded.lags)
        notes.append(
            f"Messages were recorded {1e3 * typical:.1f} ms after their stamp (median; at most {1e3 * most:.1f})."
        )
    if options.latency:
        notes.append(f"Readings are taken as {1e3 * options.latency:g} ms older than their stamps.")
    read = _ranges if recorded.kinds[topics[0]] == RANGE else _points
    return read(path, recorded, topics, tree, stated, options, notes)


def _world(path: Path, tree: FrameTree, frames: Sequence[str], options: BagOptions, notes: list[str]) -> str:
    """The frame that the answer is in."""
    roots = {tree.chain(frame)[-1] for frame in frames}
    if options.world is not None:
        for frame in frames:
            if options.world not in tree.chain(frame):
                over = " in ".join(tree.chain(frame))
                raise ReadingsError(
                    f"{path}, --world: expected a frame over '{frame}' ({over}), got '{options.world}'."
                )
        return options.world
    if len(roots) > 1:
        raise ReadingsError(
            f"{path}: expected one frame over all readings, got {', '.join(sorted(roots))}. Say --world."
        )
    root = roots.pop()
    notes.append(f"The world is the frame '{root}'; another with --world.")
    return root


def _placed(
    path: Path, rows: list[tuple[float, str, Any]], tree: FrameTree, options: BagOptions, notes: list[str]
) -> tuple[Transforms, list[int]]:
    """Poses of the readings' frames in the world at their moments, and the rows at which these are known."""
    frames = sorted({frame for _, frame, _ in rows})
    world = _world(path, tree, frames, options, notes)
    times = np.array([stamp for stamp, _, _ in rows]) - options.latency
    T, known = np.zeros((len(rows), 4, 4)), np.zeros(len(rows), dtype=bool)
    for frame in frames:
        mine = np.array([f == frame for _, f, _ in rows])
        T[mine], known[mine] = tree.pose(world, frame, times[mine])
    kept = np.flatnonzero(known).tolist()
    if len(kept) < len(rows):
        lost = len(rows) - len(kept)
        notes.append(f"{lost} of {len(rows)} readings were left out: no transform is known at their stamps.")
    if not kept:
        raise ReadingsError(
            f"{path}: expected transforms (/tf) at the readings' stamps, none from '{world}' to {', '.join(frames)}. "
            "Record /tf and /tf_static from before the first reading on."
        )
    return T[kept], kept


def _ranges(
    path: Path, recorded: Recorded, topics: Sequence[str], tree: FrameTree, stated: Stated, options: BagOptions,
    notes: list[str],
) -> Readings:  # fmt: skip
    rows = sorted((row for topic in topics for row in recorded.rows[topic]), key=lambda row: row[0])
    usable = [row for row in rows if not (np.isnan(row[2].range) or row[2].range == -np.inf)]
    if len(usable) < len(rows):
        notes.append(f"{len(rows) - len(usable)} of {len(rows)} ranges are too near or none, and were left out.")
    if not usable:
        raise ReadingsError(f"{path}: expected ranges, got none that is a number. Look at the sensor.")
    loose = sorted({frame for _, frame, _ in usable} - tree.parents.keys())
    if loose and options.world is None:
        return _on_hand(path, recorded, usable, loose, options, notes)
    T, kept = _placed(path, usable, tree, options, notes)
    rows = [usable[k] for k in kept]
    ranges, most, free = _values(rows)
    axes, origins = T[:, :3, 0], T[:, :3, 3]
    points = np.where(free[:, None], origins, origins + np.where(free, 0.0, ranges)[:, None] * axes)
    return Readings.from_columns(
        points, ids=_ids(len(rows)), directions=axes, ranges=np.where(free, np.nan, ranges), is_free=free,
        max_ranges=np.where(free, most, np.nan), source=str(path), notes=notes,
    )  # fmt: skip


def _values(rows: Sequence[tuple[float, str, Any]]) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Ranges, how far each sensor reaches, and which met nothing."""
    ranges, most = (np.array([getattr(m, n) for _, _, m in rows], dtype=np.float64) for n in ("range", "max_range"))
    return ranges, most, (ranges > most) | np.isinf(ranges)


def _on_hand(
    path: Path, recorded: Recorded, rows: list[tuple[float, str, Any]], loose: list[str], options: BagOptions,
    notes: list[str],
) -> Readings:  # fmt: skip
    """Ranges of sensors that no transform places, on a hand whose poses are a topic; a rig says where they sit."""
    poses = [t for t, kind in recorded.kinds.items() if kind == POSE and recorded.rows.get(t)]
    if len(poses) != 1:
        got = f"got {', '.join(poses)}" if poses else "got neither"
        raise ReadingsError(
            f"{path}: expected transforms (/tf) of {', '.join(loose)}, or one topic of PoseStamped with hand poses, "
            f"{got}. Record one of them."
        )
    track = Track.of([(t, _hand_pose(message)) for t, _, message in recorded.rows[poses[0]]])
    Ts, known = track.at(np.array([stamp for stamp, _, _ in rows]) - options.latency)
    if not known.any():
        raise ReadingsError(
            f"{path}: expected hand poses of {poses[0]} at the readings' stamps, got none. Record both."
        )
    if not known.all():
        notes.append(
            f"{int((~known).sum())} of {len(rows)} readings were left out: no hand pose is known at their stamps."
        )
    notes.append(f"Hand poses are taken of {poses[0]}; the sensors {', '.join(loose)} have to be in --rig.")
    rows = [row for row, is_known in zip(rows, known, strict=True) if is_known]
    ranges, most, free = _values(rows)
    return Readings.from_columns(
        n=len(rows), ids=_ids(len(rows)), ranges=np.where(free, np.nan, ranges), is_free=free,
        max_ranges=np.where(free, most, np.nan), Ts_world_hand=Ts[known], sensors=[frame for _, frame, _ in rows],
        source=str(path), notes=notes,
    )  # fmt: skip


def _hand_pose(message: Any) -> Transforms:
    p, q = message.pose.position, message.pose.orientation
    return pose_of(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def _points(
    path: Path, recorded: Recorded, topics: Sequence[str], tree: FrameTree, stated: Stated, options: BagOptions,
    notes: list[str],
) -> Readings:  # fmt: skip
    rows = sorted((row for topic in topics for row in recorded.rows[topic]), key=lambda row: row[0])
    T, kept = _placed(path, rows, tree, options, notes)
    local: FloatArray = np.array([[m.point.x, m.point.y, m.point.z] for _, _, m in (rows[k] for k in kept)])
    points = np.einsum("nij,nj->ni", T[:, :3, :3], local) + T[:, :3, 3]
    log = Log(points=points, unit="m", ids=_ids(len(kept)), notes=tuple(notes))
    return readings_of(log, stated, _FORM, str(path))


def _ids(n: int) -> tuple[str, ...]:
    return tuple(str(k) for k in range(1, n + 1))
