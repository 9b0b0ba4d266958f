"""Read damaged ROS recordings from the beginning up to the first unreadable byte.

A killed recorder, a full disk or an interrupted copy leaves a file without its index, which normal readers refuse.
Formats: http://wiki.ros.org/Bags/Format/2.0, https://mcap.dev/spec, the tables of rosbag2_storage_sqlite3.
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

STARTS = {b"#ROSBAG V": "bag", b"\x89MCAP0\r\n": "mcap", b"SQLite format 3\0": "db3"}
"""Leading bytes of the files of each format."""
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
"""Operation codes of the records in a ROS 1 bag."""
_LARGEST = 1 << 30
"""Largest plausible record length [bytes]; a larger value means that the length field is damaged."""


class Raw(NamedTuple):
    """Undecoded message: topic, type, time of reception [s], bytes, and message definition, which may be empty."""

    topic: str
    kind: str
    received: float
    data: bytes
    definition: str
    ros1: bool = False


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording in order.

    Args:
        path: folder, or a single file.
    """
    if path.is_dir():
        return sorted(p for p in path.iterdir() if p.suffix in (".mcap", ".db3") and p.is_file())
    return [path]


def messages_until_damage(path: Path) -> Iterator[Raw]:
    """Yield the messages of a recording up to the first unreadable byte.

    Args:
        path: folder, or a single file.
    """
    for file in files_of(path):
        with file.open("rb") as head:
            start = head.read(16)
        kind = next((kind for begin, kind in STARTS.items() if start.startswith(begin)), "")
        yield from {"bag": _bag, "mcap": _mcap, "db3": _database, "": _nothing}[kind](file)


def _nothing(path: Path) -> Iterator[Raw]:
    return iter(())


def _mcap(path: Path) -> Iterator[Raw]:
    schemas = dict[int, tuple[str, str, str]]()
    channels = dict[int, tuple[int, str]]()
    with path.open("rb") as file:
        file.read(8)
        for op, data in _mcap_records(file):
            try:
                number, *more = _MCAP_PARTS[op](data)
            except (struct.error, IndexError):
                return
            if op == _SCHEMA:
                schemas[number] = more[0], more[1], more[2]
            elif op == _CHANNEL:
                channels[number] = more[0], more[1]
            elif number in channels and channels[number][0] in schemas:
                schema, topic = channels[number]
                name, encoding, text = schemas[schema]
                if encoding == "ros2msg":
                    yield Raw(topic, name, 1e-9 * more[0], more[1], text)


def _mcap_records(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Yield operation code and data of schemas, channels and messages, also inside chunks and truncated chunks."""
    while len(head := file.read(9)) == 9:
        op, length = struct.unpack("<BQ", head)
        if length > _LARGEST:
            return
        data = file.read(length)
        if op == _MCAP_CHUNK:
            yield from _mcap_records(BytesIO(_mcap_chunk(data)))
        elif op in _MCAP_PARTS and len(data) == length:
            yield op, data


def _mcap_chunk(data: bytes) -> bytes:
    """Return the uncompressed records of a chunk, up to the first damaged byte."""
    at = 28  # times, size, checksum
    if len(data) < at + 4:
        return b""
    length = struct.unpack_from("<I", data, at)[0]
    compression = data[at + 4 : at + 4 + length]
    packed = data[at + 4 + length + 8 :]
    return _unpacked_bytes(compression, packed)


def _unpacked_bytes(compression: bytes, data: bytes) -> bytes:
    """Return decompressed bytes up to a truncation; empty if the data is damaged."""
    try:
        if compression == b"bz2":
            return bz2.BZ2Decompressor().decompress(data)
        if compression == b"lz4":
            from lz4.frame import LZ4FrameDecompressor

            return bytes(LZ4FrameDecompressor().decompress(data))
        if compression == b"zstd":
            from zstandard import ZstdDecompressor, ZstdError

            try:
                return bytes(ZstdDecompressor().decompressobj().decompress(data))
            except ZstdError:
                return b""
    except (OSError, RuntimeError, EOFError):
        return b""
    return data


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Return the text at an offset, and the offset after it."""
    length = struct.unpack_from("<I", data, at)[0]
    return data[at + 4 : at + 4 + length].decode(errors="replace"), at + 4 + length


def _schema(data: bytes) -> tuple[Any, ...]:
    name, at = _text(data, 2)
    encoding, at = _text(data, at)
    return struct.unpack_from("<H", data)[0], name, encoding, _text(data, at)[0]


def _channel(data: bytes) -> tuple[Any, ...]:
    number, schema = struct.unpack_from("<HH", data)
    return number, schema, _text(data, 4)[0]


def _mcap_message(data: bytes) -> tuple[Any, ...]:
    number, _, logged = struct.unpack_from("<HIQ", data)
    return number, logged, data[22:]


_SCHEMA, _CHANNEL, _MCAP_CHUNK = 3, 4, 6
_MCAP_PARTS: dict[int, Any] = {_SCHEMA: _schema, _CHANNEL: _channel, 5: _mcap_message}
"""Decoders of the MCAP records that are used, by operation code."""


def _database(path: Path) -> Iterator[Raw]:
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as base:
        try:
            base.execute("PRAGMA writable_schema = ON")  # else SQLite refuses a file that is shorter than it states
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
    op = fields.get(b"op", b"\0")[0]
    conn = fields.get(b"conn", b"")
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
    """Yield the records of a chunk whose end may be missing."""
    yield from _records(BytesIO(_unpacked_bytes(header.get(b"compression", b"none"), data)))


def _records(file: BinaryIO) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    """Yield header and data of each record; the last one may be a truncated chunk."""
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
    """Return the ``name=value`` fields of a record header."""
    out = dict[bytes, bytes]()
    at = 0
    while at + 4 <= len(data):
        length = struct.unpack_from("<I", data, at)[0]
        name, equals, value = data[at + 4 : at + 4 + length].partition(b"=")
        if equals:
            out[name] = value
        at += 4 + length
    return out
