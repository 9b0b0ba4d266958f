"""Write a session as an MCAP file of ROS 2 messages, for Foxglove and ``ros2 bag play``, with its record inside.

The file is rewritten completely at each step and replaced atomically, so it is always readable. Only the file stores
the time of each step, so the times are read from the file that is replaced.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import InputError, MissingExtraError, install_command
from tanteo.io.documents.session_messages import RECORD, SPREAD, TEXT, Sent, of_end, of_step
from tanteo.io.readings.broken_bags import STARTS
from tanteo.planning import Session
from tanteo.replaced import replaced

NEEDS_MCAP = f"MCAP: expected the packages mcap and rosbags, got none. Install them: {install_command('bags')}."
"""Error message if a package is missing."""
SUFFIX = ".mcap"
"""File name suffix of MCAP records."""
_BLANK = {"string": "", "bool": False}
"""Defaults of message fields that are not numbers."""
_STEP = 1_000_000
"""Smallest time between two steps [ns]."""


def write_mcap(session: Session, document: dict[str, Any], path: str | Path) -> None:
    """Write a session with its record as an MCAP file.

    Args:
        session: session to write.
        document: record of the session, ``tanteo.session/1``.
        path: file to write; replaced if it exists.

    Raises:
        MissingExtraError: rosbags or mcap is not installed.
        OSError: the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise MissingExtraError(NEEDS_MCAP) from None
    stamps = _stamps(Path(path), document, len(session.steps))
    with replaced(path) as name, name.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="tanteo")
        channels = _Channels(writer)
        observed = [one.readings for one in session.observations]
        for stamp, step, readings in zip(stamps, session.steps, observed, strict=True):
            channels.add(of_step(session, step, readings, stamp))
        channels.add(of_end(session, document, stamps[-1] + _STEP // 2 if stamps else _now()))
        writer.finish()


def is_mcap(path: Path) -> bool:
    """Return whether a file starts like an MCAP file; False if it cannot be opened.

    Args:
        path: file to test.
    """
    with suppress(OSError):
        if path.is_file():
            with path.open("rb") as file:
                return STARTS.get(file.read(8)) == "mcap"
    return False


def has_record(path: Path) -> bool:
    """Return whether a file is an MCAP file with a session record; only its index is read.

    Args:
        path: file to test.
    """
    return is_mcap(path) and any(True for _ in _stored(path, RECORD))


def record_text(path: Path) -> str:
    """Return the session record in an MCAP file, ``tanteo.session/1``.

    Args:
        path: MCAP file.

    Raises:
        MissingExtraError: rosbags or mcap is not installed.
        InputError: the file has no record, or a damaged one.
    """
    texts = [data for _, data in _stored(path, RECORD)]
    if not texts:
        raise InputError(
            f"{path}: expected an MCAP file with the record of a session ({RECORD}), got none. Give one that "
            "--record wrote; tanteo identify reads the readings of others."
        )
    store = _typestore()
    try:
        return str(store.deserialize_cdr(texts[-1], TEXT).data)
    except Exception as error:  # noqa: BLE001  damaged bytes can raise anything
        got = f"damaged text: {str(error).rstrip('.')}"
        raise InputError(
            f"{path}: expected the record of a session in {RECORD}, got {got}. Restore the file."
        ) from None


def _stored(path: Path, topic: str) -> Iterator[tuple[int, bytes]]:
    """Yield time [ns] and bytes of the messages of a topic; none if the file has no index, as tanteo writes one."""
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise MissingExtraError(NEEDS_MCAP) from None
    with path.open("rb") as file:
        try:
            for _, _, message in make_reader(file).iter_messages(topics=[topic]):
                yield message.log_time, message.data
        except Exception:  # noqa: BLE001  a damaged file can raise anything
            return


def _now() -> int:
    """Return the time in whole microseconds [ns]; finer digits are lost where readers use floating-point seconds."""
    return time.time_ns() // 1000 * 1000


def _stamps(path: Path, document: dict[str, Any], count: int) -> list[int]:
    """Return the time of each step [ns], from the file or else now; all differ."""
    stamps = _stamps_before(path, document)[:count]
    while len(stamps) < count:
        stamps.append(max(_now(), stamps[-1] + _STEP if stamps else 0))
    return stamps


def _stamps_before(path: Path, document: dict[str, Any]) -> list[int]:
    """Return the times [ns] of the steps in the existing file; empty if the file has a different session."""
    if not is_mcap(path):
        return []
    try:
        before = json.loads(record_text(path))["observations"]
    except (InputError, ValueError, KeyError, TypeError):
        return []
    same = json.loads(json.dumps(document["observations"]))[: len(before)] == before
    found = [stamp for stamp, _ in _stored(path, SPREAD)]
    return found if same else []


def _typestore() -> Any:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError(NEEDS_MCAP) from None
    return get_typestore(Stores.ROS2_JAZZY)


class _Channels:
    """Topics of a file, registered at their first message."""

    def __init__(self, writer: Any) -> None:
        self.writer, self.store, self.ids = writer, _typestore(), dict[str, int]()

    def add(self, messages: Iterable[Sent]) -> None:
        """Write messages.

        Args:
            messages: messages to write.
        """
        for sent in messages:
            data = bytes(self.store.serialize_cdr(_filled(self.store, sent.kind, sent.fields), sent.kind))
            self.writer.add_message(self._of(sent), log_time=sent.stamp, data=data, publish_time=sent.stamp)

    def _of(self, sent: Sent) -> int:
        if sent.topic not in self.ids:
            text, _ = self.store.generate_msgdef(sent.kind, ros_version=2)
            schema = self.writer.register_schema(name=sent.kind, encoding="ros2msg", data=text.encode())
            self.ids[sent.topic] = self.writer.register_channel(
                topic=sent.topic, message_encoding="cdr", schema_id=schema
            )
        return self.ids[sent.topic]


def _filled(store: Any, kind: str, fields: dict[str, Any]) -> Any:
    """Return a message of rosbags' types, with defaults for missing fields."""
    described = store.fielddefs[kind][1]
    return store.types[kind](**{name: _value(store, what, fields.get(name)) for name, what in described})


def _value(store: Any, described: Sequence[Any], given: Any) -> Any:
    """Return one field of a message: a number or text, a message, or a sequence of these."""
    from rosbags.interfaces import Nodetype

    node = described[0]
    what = described[1]
    if node == Nodetype.NAME:
        return _filled(store, what, given or {})
    if node == Nodetype.BASE:
        return _BLANK.get(what[0], 0) if given is None else given
    element, length = what
    items = given if given is not None else [None] * (length if node == Nodetype.ARRAY else 0)
    if element[0] == Nodetype.BASE and element[1][0] != "string":
        return np.array([0 if item is None else item for item in items], dtype=element[1][0])
    return [_value(store, element, item) for item in items]
