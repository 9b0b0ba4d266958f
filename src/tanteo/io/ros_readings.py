"""Readings of messages of ROS: ranges and touches in the world at their stamps, and what was left out.

The beam of ``sensor_msgs/Range`` runs along +x of its frame; minus infinity is something too near, infinity is nothing
(REP 117). A reading at whose stamp a transform of its chain is not known is left out: nothing is extrapolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.io.log_readings import readings_of
from tanteo.io.ros_messages import POSE, RANGE, RosMessages, RosOptions, Row, pose_in, says_something, topics_of, unique
from tanteo.io.stated import Stated
from tanteo.io.transforms import FrameTree, Track
from tanteo.logs import RECORDING, Log, LogFormat
from tanteo.sensors import Readings
from tanteo.typing import BoolArray, FloatArray, Transforms

BAG = RECORDING
"""Name of the format."""
_FORM = LogFormat(BAG, "a recording of ROS", lambda contents: False, lambda contents: Log())


def readings_of_messages(messages: RosMessages, source: str, stated: Stated, options: RosOptions) -> Readings:
    """Readings of messages, in the world at their stamps; notes of them say what was left out or taken as something.

    Args:
        messages: that came.
        source: of them, for messages to a person.
        stated: what is known beside them.
        options: topics, world, latency.

    Raises:
        ReadingsError: there is no topic of readings, or frames do not hang together.
    """
    return readings_at(messages, source, stated, options, (0.0,))[0]


def readings_at(
    messages: RosMessages, source: str, stated: Stated, options: RosOptions, shifts: Sequence[float]
) -> tuple[Readings, ...]:
    """The same readings, as they would be if they were older by several times [s]; as above."""
    topics, notes = topics_of(messages, options, source)
    beams = messages.kinds[topics[0]] == RANGE
    rows = _drawn(_usable(messages, topics, source, notes), stated, notes)
    tree, later = messages.tree(), [replace(options, latency=options.latency + shift) for shift in shifts]
    places = [placing(messages, tree, rows, beams, source, one) for one in later]
    notes += [*_said(messages, options), *places[0].notes]
    kept = _kept(np.logical_and.reduce([place.known for place in places]), places[0], source, notes)
    rows, ids = [rows[k] for k in kept], tuple(str(k + 1) for k in kept)
    if not beams:
        return tuple(_points(rows, ids, place.Ts[kept], source, stated, notes) for place in places)
    made = _beams if places[0].hand is None else _on_hand
    return tuple(made(rows, ids, place.Ts[kept], source, notes) for place in places)


def _drawn(rows: list[Row], stated: Stated, notes: list[str]) -> list[Row]:
    """Of very many rows, some at about equal distances: more of a dense recording say little more."""
    most = stated.max_points
    if most is None or len(rows) <= most:
        return rows
    notes.append(f"{most} of {len(rows)} readings are used, evenly chosen; more with --max-points.")
    return [rows[k] for k in np.linspace(0, len(rows) - 1, most).round().astype(int)]


def _said(messages: RosMessages, options: RosOptions) -> list[str]:
    out = list[str]()
    if messages.lags:
        typical, most = 1e3 * np.median(messages.lags), 1e3 * max(messages.lags)
        out.append(f"Messages were recorded {typical:.1f} ms after their stamp (median; at most {most:.1f}).")
    if messages.broken:
        out.append(f"{messages.broken} messages have numbers that are no pose or point, and were left out.")
    parents = dict[str, str]()
    for child, parent in messages.samples:
        if parents.setdefault(child, parent) != parent:
            out.append(f"The frame '{child}' is in '{parents[child]}' and in '{parent}': the last one counts.")
            parents[child] = parent
    if options.latency:
        out.append(f"Readings are taken as {1e3 * options.latency:g} ms older than their stamps.")
    return out


def _usable(messages: RosMessages, topics: Sequence[str], source: str, notes: list[str]) -> list[Row]:
    """Rows that say something, each once."""
    all_rows = [row for topic in topics for row in messages.rows[topic]]
    rows = list(unique(all_rows))
    if len(rows) < len(all_rows):
        notes.append(f"{len(all_rows) - len(rows)} of {len(all_rows)} readings came twice, and count once.")
    twice = messages.twice(np.array([row.stamp for row in rows]))
    if twice.any():
        back = max(high - low for low, high in messages.overlaps)
        notes.append(
            f"{int(twice.sum())} of {len(rows)} readings were left out: a clock was set back by {back:.1f} s, so that "
            "their stamps came twice."
        )
        rows = [row for row, is_twice in zip(rows, twice, strict=True) if not is_twice]
    said = [row for row in rows if says_something(messages.kinds[topics[0]], row)]
    if len(said) < len(rows):
        notes.append(f"{len(rows) - len(said)} of {len(rows)} ranges are too near or none, and were left out.")
        rows = said
    if not rows:
        why = " ".join(note for note in notes if "left out" in note)
        raise ReadingsError(f"{source}: expected readings that can be used, got none. {why} Look at the sensor.")
    return rows


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """Where rows are sensed from.

    Attributes:
        Ts: poses ``(n, 4, 4)`` of the readings' frames in the world, or of the hand.
        known: at which rows these are known ``(n,)``.
        hand: topic of the hand's poses; None where transforms place the frames.
        way: from which frame to which, in words.
        world: name of the frame that the poses are in.
        notes: what is taken as something.
    """

    Ts: Transforms
    known: BoolArray
    hand: str | None
    way: str
    world: str
    notes: tuple[str, ...] = ()


def placing(
    messages: RosMessages, tree: FrameTree, rows: Sequence[Row], beams: bool, source: str, options: RosOptions
) -> Placing:
    """Poses of the rows' frames at their stamps: by transforms, or ranges by the one topic of a hand's poses.

    Raises:
        ReadingsError: frames do not hang together, or nothing places them.
    """
    times = np.array([row.stamp for row in rows]) - options.latency
    frames = sorted({row.frame for row in rows})
    loose = ", ".join(frame for frame in frames if frame not in tree.parents)
    if beams and loose and options.world is None:
        topic = _hand_topic(messages, loose, source)
        poses = messages.rows[topic]
        Ts, known = Track.of([(row.stamp, pose_in(row)) for row in poses]).at(times)
        note = f"Hand poses are taken of {topic}; the sensors {loose} have to be in --rig."
        return Placing(Ts, known, topic, topic, poses[-1].frame, (note,))
    world, notes = _world(tree, frames, source, options)
    Ts, known = np.zeros((len(rows), 4, 4)), np.zeros(len(rows), dtype=bool)
    for frame in frames:
        mine = np.array([row.frame == frame for row in rows])
        Ts[mine], known[mine] = tree.pose(world, frame, times[mine])
    return Placing(Ts, known, None, f"/tf from '{world}' to {', '.join(frames)}", world, notes)


def _hand_topic(messages: RosMessages, loose: str, source: str) -> str:
    poses = [t for t, kind in messages.kinds.items() if kind == POSE and messages.rows.get(t)]
    if len(poses) == 1:
        return poses[0]
    got = f"got {', '.join(poses)}" if poses else "got neither"
    raise ReadingsError(
        f"{source}: expected transforms (/tf) of {loose}, or one topic of PoseStamped with hand poses, {got}. "
        "Record one of them."
    )


def _world(tree: FrameTree, frames: Sequence[str], source: str, options: RosOptions) -> tuple[str, tuple[str, ...]]:
    """The frame that the answer is in, and whether it is guessed."""
    if options.world is not None:
        for frame in frames:
            if options.world not in tree.chain(frame):
                over = " in ".join(tree.chain(frame))
                raise ReadingsError(
                    f"{source}, --world: expected a frame over '{frame}' ({over}), got '{options.world}'."
                )
        return options.world, ()
    roots = {tree.chain(frame)[-1] for frame in frames}
    if len(roots) > 1:
        raise ReadingsError(
            f"{source}: expected one frame over all readings, got {', '.join(sorted(roots))}. Say --world."
        )
    root = roots.pop()
    return root, (f"The world is the frame '{root}'; another with --world.",)


def _kept(known: BoolArray, place: Placing, source: str, notes: list[str]) -> list[int]:
    """Indices of the rows whose place is known."""
    if not known.any():
        raise ReadingsError(
            f"{source}: expected poses at the readings' stamps, got none of {place.way}. Record them from before the "
            "first reading to after the last (/tf_static, too), by one clock."
        )
    lost = int((~known).sum())
    if lost:
        what = "transform" if place.hand is None else "hand pose"
        notes.append(f"{lost} of {len(known)} readings were left out: no {what} is known at their stamps.")
    kept: list[int] = np.flatnonzero(known).tolist()
    return kept


def _values(rows: Sequence[Row]) -> tuple[FloatArray, FloatArray, BoolArray, FloatArray | None]:
    """Ranges, how far each sensor reaches, which met nothing, and standard deviations where the sensor says them."""
    ranges, _, most, variances = np.array([row.values for row in rows], dtype=np.float64).T
    stated, limited = variances > 0, most > 0  # 0 is a field that nobody filled
    sds = np.where(stated, np.sqrt(np.where(stated, variances, 1.0)), np.nan) if stated.any() else None
    return ranges, most, (limited & (ranges > most)) | np.isinf(ranges), sds


def _beams(rows: Sequence[Row], ids: Sequence[str], Ts: Transforms, source: str, notes: Sequence[str]) -> Readings:
    ranges, most, free, sds = _values(rows)
    axes, origins = Ts[:, :3, 0], Ts[:, :3, 3]
    points = origins + np.where(free, 0.0, ranges)[:, None] * axes
    return Readings.from_columns(
        points, ids=ids, directions=axes, ranges=np.where(free, np.nan, ranges), is_free=free, sds=sds,
        max_ranges=np.where(free, most, np.nan), source=source, notes=notes,
    )  # fmt: skip


def _on_hand(rows: Sequence[Row], ids: Sequence[str], Ts: Transforms, source: str, notes: Sequence[str]) -> Readings:
    """Ranges of sensors on a hand: a rig says where they sit."""
    ranges, most, free, sds = _values(rows)
    return Readings.from_columns(
        n=len(rows), ids=ids, ranges=np.where(free, np.nan, ranges), is_free=free, sds=sds,
        max_ranges=np.where(free, most, np.nan), Ts_world_hand=Ts, sensors=[row.frame for row in rows],
        source=source, notes=notes,
    )  # fmt: skip


def _points(
    rows: Sequence[Row], ids: tuple[str, ...], Ts: Transforms, source: str, stated: Stated, notes: Sequence[str]
) -> Readings:
    local = np.array([row.values for row in rows])
    points = np.einsum("nij,nj->ni", Ts[:, :3, :3], local) + Ts[:, :3, 3]
    log = Log(points=points, unit="m", ids=ids, notes=tuple(notes))
    return readings_of(log, stated, _FORM, source)
