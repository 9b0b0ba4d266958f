"""Recordings of ROS that are not whole, read from their beginning as far as they hold.

A recorder that is killed, a full disk or a broken copy leave a file without its index, which readers of whole files
refuse. Formats: http://wiki.ros.org/Bags/Format/2.0, https://mcap.dev/spec, the tables of rosbag2_storage_sqlite3.
"""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from tanteo.errors import MissingExtraError

NEEDS_MCAP = "MCAP: expected the package mcap, got none. Install it: pip install 'tanteo[bags]'."
"""What is said where it is missing."""
STARTS = {b"#ROSBAG V": "bag", b"\x89MCAP0\r\n": "mcap", b"SQLite format 3\0": "db3"}
"""What the files of each format begin with."""
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
"""Records of a bag of ROS 1."""
_LARGEST = 1 << 30
"""A record that says that it is longer is none [bytes]."""


class Raw(NamedTuple):
    """One message as it was stored: when it came [s], its bytes, and its definition, which may be empty."""

    topic: str
    kind: str
    received: float
    data: bytes
    definition: str
    ros1: bool = False


def files_of(path: Path) -> list[Path]:
    """The files of a recording, a folder or one of them, in their order."""
    if path.is_dir():
        return sorted(p for p in path.iterdir() if p.suffix in (".mcap", ".db3") and p.is_file())
    return [path]


def until_broken(path: Path) -> Iterator[Raw]:
    """The messages of a recording, up to where it cannot be read on."""
    for file in files_of(path):
        with file.open("rb") as head:
            start = head.read(16)
        kind = next((kind for begin, kind in STARTS.items() if start.startswith(begin)), "")
        yield from {"bag": _bag, "mcap": _mcap, "db3": _database, "": _nothing}[kind](file)


def _nothing(path: Path) -> Iterator[Raw]:
    return iter(())


def _mcap(path: Path) -> Iterator[Raw]:
    try:
        from mcap.records import Channel, Message, Schema
        from mcap.stream_reader import StreamReader
    except ImportError:
        raise MissingExtraError(NEEDS_MCAP) from None

    schemas, channels = dict[int, Schema](), dict[int, Channel]()
    with path.open("rb") as file:
        for record in _while_it_goes(StreamReader(file, record_size_limit=_LARGEST).records):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message) and (channel := channels.get(record.channel_id)) is not None:
                schema = schemas.get(channel.schema_id)
                if schema is not None and schema.encoding == "ros2msg":
                    text = schema.data.decode(errors="replace")
                    yield Raw(channel.topic, schema.name, 1e-9 * record.log_time, record.data, text)


def _while_it_goes(records: Iterator[Any]) -> Iterator[Any]:
    try:
        yield from records
    except Exception:  # noqa: BLE001  a damaged file fails in any way, and here it ends
        return


def _database(path: Path) -> Iterator[Raw]:
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as base:
        try:
            topics = {k: (name, kind) for k, name, kind in base.execute("SELECT id, name, type FROM topics")}
            for topic, stamp, data in base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id"):
                if topic in topics:
                    yield Raw(*topics[topic], 1e-9 * stamp, bytes(data), "")
        except sqlite3.DatabaseError:
            return


def _bag(path: Path) -> Iterator[Raw]:
    connections = dict[int, tuple[str, str, str]]()
    with path.open("rb") as file:
        file.readline()
        for header, data in _records(file):
            inner = _unpacked(header, data) if header.get(b"op") == bytes([_CHUNK]) else [(header, data)]
            for fields, content in inner:
                yield from _message(fields, content, connections)


def _message(fields: dict[bytes, bytes], data: bytes, connections: dict[int, tuple[str, str, str]]) -> Iterator[Raw]:
    op, conn = fields.get(b"op", b"\0")[0], fields.get(b"conn", b"")
    if len(conn) != 4 or op not in (_MESSAGE, _CONNECTION):
        return
    number = struct.unpack("<I", conn)[0]
    if op == _CONNECTION:
        about = _fields(data)
        name, text = (about.get(key, b"").decode(errors="replace") for key in (b"type", b"message_definition"))
        topic = fields.get(b"topic", b"").decode(errors="replace")
        connections[number] = topic, name.replace("/", "/msg/", 1), text
    elif number in connections and len(fields.get(b"time", b"")) == 8:
        topic, kind, text = connections[number]
        seconds, nanos = struct.unpack("<II", fields[b"time"])
        yield Raw(topic, kind, seconds + 1e-9 * nanos, data, text, ros1=True)


def _unpacked(header: dict[bytes, bytes], data: bytes) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    """The records of a chunk, of which the end may be missing."""
    compression = header.get(b"compression", b"none")
    try:
        if compression == b"bz2":
            data = bz2.BZ2Decompressor().decompress(data)
        elif compression == b"lz4":
            from lz4.frame import LZ4FrameDecompressor

            data = LZ4FrameDecompressor().decompress(data)
    except (OSError, RuntimeError, EOFError):
        return
    yield from _records(BytesIO(data))


def _records(file: BinaryIO) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    """Header and data of each record; of the last one the data may be cut, where it is a chunk."""
    while len(head := _sized(file)) and (fields := _fields(head)):
        size = file.read(4)
        if len(size) < 4 or (length := struct.unpack("<I", size)[0]) > _LARGEST:
            return
        data = file.read(length)
        if len(data) == length or fields.get(b"op") == bytes([_CHUNK]):
            yield fields, data


def _sized(file: BinaryIO) -> bytes:
    size = file.read(4)
    length = struct.unpack("<I", size)[0] if len(size) == 4 else 0
    data = file.read(length) if length <= _LARGEST else b""
    return data if len(data) == length else b""


def _fields(data: bytes) -> dict[bytes, bytes]:
    """``name=value`` of a header."""
    out, at = dict[bytes, bytes](), 0
    while at + 4 <= len(data):
        length = struct.unpack_from("<I", data, at)[0]
        name, equals, value = data[at + 4 : at + 4 + length].partition(b"=")
        if equals:
            out[name] = value
        at += 4 + length
    return out

