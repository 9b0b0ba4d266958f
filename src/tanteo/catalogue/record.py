"""Define the record of a part that a reading process sends to the catalogue writer: compressed bytes and signature."""

from __future__ import annotations

import io
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.catalogue.archive import part_to_bytes
from tanteo.catalogue.shaping import compiled_shape
from tanteo.catalogue.signatures import signature
from tanteo.parts import Part

_LEVEL = 1
"""Compression level of zlib: four to six times smaller, decompressed in less than a millisecond."""


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """Part in the form in which a catalogue stores it.

    Attributes:
        name: name of the part.
        source: path of its file.
        unit: length unit of the file.
        part: compressed bytes of the part.
        shape: compressed bytes of its compiled shape.
        columns: signature by column name.
    """

    name: str
    source: str
    unit: str
    part: bytes
    shape: bytes
    columns: dict[str, Any]


def record_of(part: Part) -> Record:
    """Return the record of a part, with its compiled shape and signature.

    Args:
        part: part to store.
    """
    shape = compiled_shape(part)
    whole, own = (zlib.compress(data, _LEVEL) for data in (part_to_bytes(part), shape.bytes()))
    return Record(part.name, part.source, part.unit, whole, own, signature(part, lambda: shape))


def record_to_bytes(record: Record) -> bytes:
    """Return a record as bytes for another process, without pickle.

    Args:
        record: record to send.
    """
    out = io.BytesIO()
    text = "\0".join([record.name, record.source, record.unit])
    blobs = {"text": text.encode(), "part": record.part, "shape": record.shape}
    arrays = {f".{name}": np.frombuffer(data, dtype=np.uint8) for name, data in blobs.items()}
    every: dict[str, Any] = {**arrays, **record.columns}
    np.savez(out, **every)
    return out.getvalue()


def record_from_bytes(data: bytes) -> Record:
    """Return the record from the bytes of :func:`record_to_bytes`.

    Args:
        data: bytes of a record.
    """
    with np.load(io.BytesIO(data), allow_pickle=False) as known:
        arrays = {name: known[name] for name in known.files}
    text, part, shape = (arrays.pop(f".{name}").tobytes() for name in ("text", "part", "shape"))
    name, source, unit = text.decode().split("\0")
    return Record(name, source, unit, part, shape, arrays)
