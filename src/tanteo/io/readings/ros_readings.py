"""Convert ROS messages to readings in the world frame at their stamps.

The beam of ``sensor_msgs/Range`` runs along +x of its frame, those of a scan in its x-y plane. Minus infinity means too
near, plus infinity means that nothing was hit (REP 117). Transforms are not extrapolated: a reading without all
transforms at its stamp is discarded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import ReadingsError, did_you_mean
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.io.documents.ros_messages import (
    BEAMS,
    CLOUD,
    POSE,
    SCAN,
    RosMessages,
    RosOptions,
    Row,
    is_usable,
    pose_in,
    topics_of,
    unique,
)
from tanteo.io.logs.formats import RECORDING
from tanteo.io.logs.log import Log, LogFormat
from tanteo.io.poses.transforms import FrameTree, Track
from tanteo.io.readings.log_readings import readings_of
from tanteo.io.readings.profiles import spread
from tanteo.io.readings.stated import Stated
from tanteo.sensors import Readings

BAG = RECORDING
"""Name of the format of ROS recordings."""
_MOST_SCANNED = 200_000
"""Largest number of beams of scans that are placed."""
_FORM = LogFormat(BAG, "a recording of ROS", lambda contents: False, lambda contents: Log())


def readings_of_messages(messages: RosMessages, source: str, stated: Stated, options: RosOptions) -> Readings:
    """Return the readings of messages in the world frame at their stamps, with notes on assumptions and omissions.

    Args:
        messages: collected messages.
        source: file name for messages.
        stated: options for what the messages do not contain.
        options: topics, world frame and latency.

    Raises:
        ReadingsError: no topic has readings, or the transforms do not connect the frames.
    """
    return readings_at(messages, source, stated, options, (0.0,))[0]


def readings_at(
    messages: RosMessages, source: str, stated: Stated, options: RosOptions, shifts: Sequence[float]
) -> tuple[Readings, ...]:
    """Return the same readings once for each additional latency; see :func:`readings_of_messages`.

    Args:
        messages: collected messages.
        source: file name for messages.
        stated: options for what the messages do not contain.
        options: topics, world frame and latency.
        shifts: latencies added to that of the options [s].

    Raises:
        ReadingsError: no topic has readings, or the transforms do not connect the frames.
    """
    topics, notes = topics_of(messages, options, source)
    kind = messages.kinds[topics[0]]
    beams, scanned = kind in BEAMS, kind in (SCAN, CLOUD)
    rows = _usable(messages, topics, source, notes)
    rows = _drawn(rows, _MOST_SCANNED if scanned else stated.max_points, notes)
    tree = messages.tree()
    later = [replace(options, latency=options.latency + shift) for shift in shifts]
    places = [placing(messages, tree, rows, beams, source, one) for one in later]
    notes += [*_message_notes(messages, options), *places[0].notes]
    kept = _kept(np.logical_and.reduce([place.known for place in places]), places[0], source, notes)
    if scanned and stated.max_points is not None and len(kept) > stated.max_points:
        chosen = spread(_sensed([rows[k] for k in kept], places[0].Ts[kept], beams), stated.max_points)
        notes.append(
            f"{len(chosen)} of {len(kept)} readings of scans are used, spread evenly over what was sensed. "
            "--max-points sets their number."
        )
        kept = [kept[k] for k in chosen]
    rows = [rows[k] for k in kept]
    ids = tuple(f"{rows[i].message}.{k + 1}" if scanned else str(k + 1) for i, k in enumerate(kept))
    stamp = max(row.stamp for row in rows)
    if not beams:
        out = (_points(rows, ids, place.Ts[kept], source, stated, notes, seen=scanned) for place in places)
    else:
        made = _beams if places[0].hand is None else _on_hand
        out = (made(rows, ids, place.Ts[kept], source, notes) for place in places)
    return tuple(replace(one, frame=places[0].world, stamp=stamp) for one in out)


def _sensed(rows: Sequence[Row], Ts: Transforms, beams: bool) -> FloatArray:
    """Return the sensed points in the world ``(n, 3)``; the ends of beams that hit nothing."""
    values = np.array([row.values for row in rows])
    local = np.nan_to_num(values[:, :1], posinf=0.0) * values[:, 4:7] if beams else values
    return np.einsum("nij,nj->ni", Ts[:, :3, :3], local) + Ts[:, :3, 3]


def _drawn(rows: list[Row], most: int | None, notes: list[str]) -> list[Row]:
    """Return at most ``most`` evenly spaced rows, because neighbours in a dense recording are redundant."""
    if most is None or len(rows) <= most:
        return rows
    notes.append(f"{most} of {len(rows)} readings are used, evenly chosen. --max-points sets their number.")
    return [rows[k] for k in np.linspace(0, len(rows) - 1, most).round().astype(int)]


def _message_notes(messages: RosMessages, options: RosOptions) -> list[str]:
    out = list[str]()
    if messages.lags:
        typical = 1e3 * np.median(messages.lags)
        most = 1e3 * max(messages.lags)
        out.append(f"Messages were recorded {typical:.1f} ms after their stamp (median; at most {most:.1f}).")
    if messages.broken:
        out.append(f"{messages.broken} messages were excluded because their numbers form no valid pose or point.")
    parents = dict[str, str]()
    for child, parent in messages.samples:
        if parents.setdefault(child, parent) != parent:
            out.append(f"The frame '{child}' is in '{parents[child]}' and in '{parent}': the last one counts.")
            parents[child] = parent
    if options.latency:
        out.append(f"Readings are taken as {1e3 * options.latency:g} ms older than their stamps.")
    return out


def _usable(messages: RosMessages, topics: Sequence[str], source: str, notes: list[str]) -> list[Row]:
    """Return the usable rows without duplicates, with notes on the discarded ones."""
    all_rows = [row for topic in topics for row in messages.rows[topic]]
    rows = list(unique(all_rows))
    if len(rows) < len(all_rows):
        notes.append(f"{len(all_rows) - len(rows)} of {len(all_rows)} readings came twice, and count once.")
    twice = messages.ambiguous(np.array([row.stamp for row in rows]))
    if twice.any():
        back = max(high - low for low, high in messages.overlaps)
        notes.append(
            f"{int(twice.sum())} of {len(rows)} readings were excluded: a clock was set back by {back:.1f} s, so that "
            "their stamps came twice."
        )
        rows = [row for row, is_twice in zip(rows, twice, strict=True) if not is_twice]
    usable = [row for row in rows if is_usable(messages.kinds[topics[0]], row)]
    if len(usable) < len(rows):
        notes.append(f"{len(rows) - len(usable)} of {len(rows)} ranges are too near or none, and were excluded.")
        rows = usable
    if not rows:
        why = " ".join(note for note in notes if "excluded" in note)
        raise ReadingsError(f"{source}: expected readings that can be used, got none. {why} Check the sensor.")
    return rows


@dataclass(frozen=True, slots=True, eq=False)
class Placing:
    """Poses from which rows were sensed.

    Attributes:
        Ts: poses of the readings' frames, or of the hand, in the world ``(n, 4, 4)`` [m].
        known: mask of the rows whose pose is known ``(n,)``.
        hand: topic of the hand's poses; None where transforms give the poses.
        way: source of the poses, as text.
        world: name of the frame that the poses refer to.
        notes: notes on assumptions.
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
    """Return the poses of the rows' frames at their stamps, from transforms or from the only topic of hand poses.

    Args:
        messages: collected messages.
        tree: transform tree of the messages.
        rows: readings to place.
        beams: whether the readings are ranges, for which hand poses can be used.
        source: file name for messages.
        options: world frame and latency.

    Raises:
        ReadingsError: the transforms do not connect the frames, or neither transforms nor hand poses exist.
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
    Ts = np.zeros((len(rows), 4, 4))
    known = np.zeros(len(rows), dtype=bool)
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
    """Return the world frame, and a note if it was chosen automatically."""
    if options.world is not None:
        for frame in frames:
            if not tree.connects(options.world, frame):
                there = ", ".join(tree.frames(frame))
                raise ReadingsError(
                    f"{source}, --world: expected a frame that transforms connect with '{frame}' ({there}), got "
                    f"'{options.world}'.{did_you_mean(options.world, tree.frames(frame))}"
                )
        return options.world, ()
    roots = {tree.chain(frame)[-1] for frame in frames}
    if len(roots) > 1:
        raise ReadingsError(
            f"{source}: expected one frame over all readings, got {', '.join(sorted(roots))}. Use --world."
        )
    root = roots.pop()
    return root, (f"The world is the frame '{root}'. --world chooses another.",)


def _kept(known: BoolArray, place: Placing, source: str, notes: list[str]) -> list[int]:
    """Return the indices of the rows whose pose is known."""
    if not known.any():
        raise ReadingsError(
            f"{source}: expected poses at the readings' stamps, got none of {place.way}. Record them from before the "
            "first reading to after the last (/tf_static, too), by one clock."
        )
    lost = int((~known).sum())
    if lost:
        what = "transform" if place.hand is None else "hand pose"
        notes.append(f"{lost} of {len(known)} readings were excluded: no {what} is known at their stamps.")
    kept: list[int] = np.flatnonzero(known).tolist()
    return kept


def _values(rows: Sequence[Row]) -> tuple[FloatArray, FloatArray, BoolArray, FloatArray | None]:
    """Return ranges [m], largest ranges [m], mask of beams that hit nothing, and standard deviations [m] if stated."""
    ranges, _, most, variances = np.array([row.values[:4] for row in rows], dtype=np.float64).T
    # 0 means that the publisher left the field empty
    stated = variances > 0
    limited = most > 0
    sds = np.where(stated, np.sqrt(np.where(stated, variances, 1.0)), np.nan) if stated.any() else None
    # drivers write their largest range, and not only more than it, where nothing is in range
    return ranges, most, (limited & (ranges >= most)) | np.isinf(ranges), sds


def _beams(rows: Sequence[Row], ids: Sequence[str], Ts: Transforms, source: str, notes: Sequence[str]) -> Readings:
    ranges, most, free, sds = _values(rows)
    local = np.array([row.values[4:] for row in rows])
    axes = np.einsum("nij,nj->ni", Ts[:, :3, :3], local[:, :3])
    origins = Ts[:, :3, 3]
    points = origins + np.where(free, 0.0, ranges)[:, None] * axes
    return Readings.from_columns(
        points, ids=ids, directions=axes, ranges=np.where(free, np.nan, ranges), is_free=free, sds=sds,
        max_ranges=np.where(free, most, np.nan), across_sds=_across(ranges, free, local[:, 3]), source=source,
        notes=notes,
    )  # fmt: skip


def _across(ranges: FloatArray, free: BoolArray, fields_of_view: FloatArray) -> FloatArray | None:
    """Return standard deviations across the beams [m], half of the half angle times the range; None if none is stated.

    The same rule gives that of a preset's cone (``docs/formats_json.md``).
    """
    wide = ~free & (fields_of_view > 0) & (fields_of_view < np.pi)
    return np.where(wide, 0.25 * fields_of_view * np.where(free, 0.0, ranges), np.nan) if wide.any() else None


def _on_hand(rows: Sequence[Row], ids: Sequence[str], Ts: Transforms, source: str, notes: Sequence[str]) -> Readings:
    """Return ranges of sensors on the hand, whose poses on the hand a rig file gives."""
    ranges, most, free, sds = _values(rows)
    return Readings.from_columns(
        n=len(rows), ids=ids, ranges=np.where(free, np.nan, ranges), is_free=free, sds=sds,
        max_ranges=np.where(free, most, np.nan), Ts_world_hand=Ts, sensors=[row.frame for row in rows],
        source=source, notes=notes,
    )  # fmt: skip


def _points(
    rows: Sequence[Row], ids: tuple[str, ...], Ts: Transforms, source: str, stated: Stated, notes: Sequence[str],
    *, seen: bool,
) -> Readings:  # fmt: skip
    """Return points in the world; those of a cloud are seen from the origin of their frame."""
    points = _sensed(rows, Ts, beams=False)
    away = points - Ts[:, :3, 3] if seen and stated.direction is None else None
    log = Log(points=points, directions=away, unit="m", ids=ids, notes=tuple(notes))
    return readings_of(log, stated, _FORM, source)
