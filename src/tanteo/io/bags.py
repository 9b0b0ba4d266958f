"""Recordings of ROS: bags of ROS 1, ROS 2 (SQLite, MCAP), by rosbags; what is not whole, as far as it holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tanteo.errors import MissingExtraError, ReadingsError
from tanteo.io.broken_bags import STARTS, Raw, files_of, until_broken
from tanteo.io.ros_messages import RosMessages, RosOptions, check_topics, wanted_topics
from tanteo.io.ros_readings import readings_at, readings_of_messages
from tanteo.io.stated import Stated
from tanteo.sensors import Readings, concatenate


def is_bag(path: Path) -> bool:
    """Whether it is a recording of ROS: a file, or a folder of them."""
    try:
        if path.is_dir():
            return (path / "metadata.yaml").is_file() or bool(files_of(path))
        if not path.is_file():  # opening a pipe would wait for who writes to it
            return False
        with path.open("rb") as file:
            return file.read(16).startswith(tuple(STARTS))
    except OSError:
        return False


def read_bag(path: Path, stated: Stated, options: RosOptions) -> Readings:
    """Readings of a recording, in the world at their stamps.

    Raises:
        MissingExtraError: rosbags is not installed.
        ReadingsError: nothing of it can be read, it has no topic of readings, or frames that do not hang together.
    """
    if not options.topics and (told := _told(path)) is not None:
        return told
    messages, notes = messages_of(path, options)
    try:
        readings = readings_of_messages(messages, str(path), stated, options)
    except ReadingsError as error:
        if notes:  # what is missing may be in the part that is lost
            raise ReadingsError(" ".join([str(error), *notes])) from None
        raise
    return replace(readings, notes=(*notes, *readings.notes)) if notes else readings


def shifted(path: Path, stated: Stated, options: RosOptions, shifts: Sequence[float]) -> tuple[Readings, ...]:
    """The same readings of a recording, as they would be if they were older by several times [s]; as :func:`read_bag`.

    Empty where a session was told them: then it is not known how the sensor moved.
    """
    if not options.topics and _is_session(path):
        return ()
    return readings_at(messages_of(path, options)[0], str(path), stated, options, shifts)


def _is_session(path: Path) -> bool:
    from tanteo.io.session_mcap import has_record

    return has_record(path)


def _told(path: Path) -> Readings | None:
    """What a session was told whose record is in the file; None if there is none."""
    from tanteo.io.session_messages import RECORD
    from tanteo.io.session_record import load_record

    if not _is_session(path):
        return None
    told = [one.readings for one in (o.observation() for o in load_record(path).observations) if one.readings]
    if not told:
        raise ReadingsError(f"{path}: expected a session that was told readings, got one without. Record one.")
    note = f"Readings are those that the session of {RECORD} was told, as it was told them; others with --topic."
    return replace(concatenate(told), source=str(path), notes=(note,))


def messages_of(path: Path, options: RosOptions) -> tuple[RosMessages, list[str]]:
    """What a recording says, and what of it is lost.

    Raises:
        MissingExtraError: rosbags is not installed.
        ReadingsError: nothing of it can be read, or it has no such topic.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError(
            "recordings of ROS: expected rosbags, got none. Install it: pip install 'tanteo[bags]'."
        ) from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            return _of_whole(reader, path, options), []
    except ReadingsError:
        raise
    except Exception as error:  # noqa: BLE001  a damaged file fails in any way
        return _of_broken(path, options, str(error).split("\n")[0][:120] or type(error).__name__)


def _of_whole(reader: Any, path: Path, options: RosOptions) -> RosMessages:
    there = {c.topic: c.msgtype for c in reader.connections}
    check_topics(there, options, str(path))
    messages = RosMessages(kinds=wanted_topics(there, options))
    for connection, received, raw in reader.messages([c for c in reader.connections if c.topic in messages.kinds]):
        messages.take(connection.topic, 1e-9 * received, reader.deserialize(raw, connection.msgtype))
    return messages


def _of_broken(path: Path, options: RosOptions, why: str) -> tuple[RosMessages, list[str]]:
    """What can be read of a recording that is not whole."""
    raws = list(until_broken(path))
    if not raws:
        raise ReadingsError(
            f"{path}: expected a recording of ROS, got one that cannot be read: {why}. Record it again."
        )
    there = {raw.topic: raw.kind for raw in raws}
    check_topics(there, options, str(path))
    messages = RosMessages(kinds=wanted_topics(there, options))
    for raw, message in _parsed(raws, messages):
        messages.take(raw.topic, raw.received, message)
    seconds = raws[-1].received - raws[0].received
    held = f"{len(raws)} messages over {seconds:.1f} s could be read"
    return messages, [f"The recording is not whole ({why.rstrip('.')}): {held}, all others are lost."]


def _parsed(raws: list[Raw], messages: RosMessages) -> Iterator[tuple[Raw, Any]]:
    """Messages as objects, by the definitions that are stored with them, or else those of ROS 2 Humble."""
    from rosbags.typesys import Stores, get_typestore

    standard, readers = get_typestore(Stores.ROS2_HUMBLE), dict[str, Any]()
    for raw in raws:
        if raw.topic not in messages.kinds:
            continue
        if raw.topic not in readers:
            readers[raw.topic] = _store(raw) or standard
        store = readers[raw.topic]
        try:
            message = (store.deserialize_ros1 if raw.ros1 else store.deserialize_cdr)(raw.data, raw.kind)
        except Exception:  # noqa: BLE001  what is spoiled fails in any way
            messages.broken += 1
            continue
        yield raw, message


def _store(raw: Raw) -> Any:
    """The types of the definition that is stored with a message; None where that is missing or spoiled."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(raw.definition, raw.kind))
    except Exception:  # noqa: BLE001  the same of a definition
        return None
    return store if raw.definition else None
