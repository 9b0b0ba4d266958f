"""Read ROS recordings with rosbags: ROS 1 bags and ROS 2 SQLite or MCAP files, damaged ones as far as possible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tanteo.errors import MissingExtraError, ReadingsError, install_command
from tanteo.io.documents.ros_messages import RosMessages, RosOptions, check_topics, wanted_topics
from tanteo.io.readings.broken_bags import STARTS, Raw, files_of, messages_until_damage
from tanteo.io.readings.ros_readings import readings_at, readings_of_messages
from tanteo.io.readings.session_readings import session_readings
from tanteo.io.readings.stated import Stated
from tanteo.sensors import Readings


def is_bag(path: Path) -> bool:
    """Return whether a path is a ROS recording: a file, or a folder of files.

    Args:
        path: file or folder.
    """
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
    """Return the readings of a recording, in the world frame at their time stamps.

    A recording that holds a tanteo session yields the readings of that session unless the options name topics.

    Args:
        path: file or folder of the recording.
        stated: options for what the recording does not contain.
        options: topics, frames and time offsets.

    Raises:
        MissingExtraError: rosbags is not installed.
        ReadingsError: the file cannot be read, has no topic with readings, or has no path between two frames.
    """
    if not options.topics and _is_session(path):
        from tanteo.io.documents.session_messages import RECORD

        readings = session_readings(path)
        note = f"The record is in {RECORD}. Use --topic to read other topics."
        return replace(readings, notes=(*readings.notes, note))
    messages, notes = messages_of(path, options)
    try:
        readings = readings_of_messages(messages, str(path), stated, options)
    except ReadingsError as error:
        if notes:  # the missing topic or frame may be in the lost part
            raise ReadingsError(" ".join([str(error), *notes])) from None
        raise
    return replace(readings, notes=(*notes, *readings.notes)) if notes else readings


def shifted(path: Path, stated: Stated, options: RosOptions, shifts: Sequence[float]) -> tuple[Readings, ...]:
    """Return the readings of a recording once for each time shift, as :func:`read_bag` would at shifted stamps.

    Args:
        path: file or folder of the recording.
        stated: options for what the recording does not contain.
        options: topics, frames and time offsets.
        shifts: time shifts subtracted from the stamps [s].

    Returns:
        One set of readings for each shift; empty for a recorded session, which does not store the sensor's motion.
    """
    if not options.topics and _is_session(path):
        return ()
    return readings_at(messages_of(path, options)[0], str(path), stated, options, shifts)


def _is_session(path: Path) -> bool:
    from tanteo.io.documents.session_mcap import has_record

    return has_record(path)


def messages_of(path: Path, options: RosOptions) -> tuple[RosMessages, list[str]]:
    """Return the messages of a recording, and notes on what could not be read.

    Args:
        path: file or folder of the recording.
        options: topics to read.

    Raises:
        MissingExtraError: rosbags is not installed.
        ReadingsError: nothing can be read, or a topic is missing.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError(
            f"recordings of ROS: expected rosbags, got none. Install it: {install_command('bags')}."
        ) from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            return _of_whole(reader, path, options), []
    except ReadingsError:
        raise
    except Exception as error:  # noqa: BLE001  a damaged file can raise anything
        return _of_broken(path, options, str(error).split("\n")[0][:120] or type(error).__name__)


def _of_whole(reader: Any, path: Path, options: RosOptions) -> RosMessages:
    there = {c.topic: c.msgtype for c in reader.connections}
    check_topics(there, options, str(path))
    messages = RosMessages(kinds=wanted_topics(there, options))
    for connection, received, raw in reader.messages([c for c in reader.connections if c.topic in messages.kinds]):
        messages.take(connection.topic, 1e-9 * received, reader.deserialize(raw, connection.msgtype))
    return messages


def _of_broken(path: Path, options: RosOptions, why: str) -> tuple[RosMessages, list[str]]:
    """Return the readable messages of a damaged recording."""
    raws = list(messages_until_damage(path))
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
    readable = f"{len(raws)} messages over {seconds:.1f} s could be read"
    return messages, [f"The recording is damaged ({why.rstrip('.')}): {readable}, all others are lost."]


def _parsed(raws: list[Raw], messages: RosMessages) -> Iterator[tuple[Raw, Any]]:
    """Yield messages as objects, decoded by the stored definitions, otherwise by those of ROS 2 Humble."""
    from rosbags.typesys import Stores, get_typestore

    standard = get_typestore(Stores.ROS2_HUMBLE)
    readers = dict[str, Any]()
    for raw in raws:
        if raw.topic not in messages.kinds:
            continue
        if raw.topic not in readers:
            readers[raw.topic] = _store(raw) or standard
        store = readers[raw.topic]
        try:
            message = (store.deserialize_ros1 if raw.ros1 else store.deserialize_cdr)(raw.data, raw.kind)
        except Exception:  # noqa: BLE001  damaged data can raise anything
            messages.broken += 1
            continue
        yield raw, message


def _store(raw: Raw) -> Any:
    """Return the type store of the definition stored with a message; None if it is missing or invalid."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    try:
        store.register(get_types_from_msg(raw.definition, raw.kind))
    except Exception:  # noqa: BLE001  a damaged definition can raise anything
        return None
    return store if raw.definition else None
