"""Write and read a segment of a catalogue: some thousand parts, written once."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.catalogue.archive import part_from_bytes
from tanteo.catalogue.index import index_of
from tanteo.catalogue.record import Record
from tanteo.catalogue.shaping import SHAPE
from tanteo.catalogue.stability import RESTS
from tanteo.catalogue.store import Mapped, Packed, Table, damaged, new_name, write_table
from tanteo.errors import InputError
from tanteo.parts import Part

MOST = 8192
"""Largest number of parts in a segment, whose signatures are in memory during writing."""

RAGGED = ("planes", "rounds", "axes", "same", "opposite", "angles", "field", "hull", "rests")
"""Columns with a variable number of rows per part; ``<name>_start`` holds the offsets."""

_KEY = 32


class SegmentWriter:
    """Writer of a segment: parts are written as they come, columns at the end."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.name, self.keys = folder, new_name(), list[str]()
        self._file = (folder / f"{self.name}.parts").open("wb")
        self._places: list[tuple[int, int, int]] = []
        self._texts: list[bytes] = []
        self._columns: list[dict[str, Any]] = []

    def __len__(self) -> int:
        return len(self._places)

    def add(self, record: Record, key: str) -> None:
        """Append a part.

        Args:
            record: part to write.
            key: hash of its file.
        """
        at = self._file.tell()
        self._file.write(record.part + record.shape)
        middle = at + len(record.part)
        self._places.append((at, middle, middle + len(record.shape)))
        self._texts.append("\0".join([record.name, record.source, record.unit]).encode())
        self._columns.append(record.columns)
        self.keys.append(key)

    def drop(self) -> None:
        """Close the unfinished file, which the next sweep removes."""
        self._file.close()

    def close(self) -> dict[str, Any]:
        """Write all columns to disk, and return the manifest entry of the segment."""
        self._file.flush()
        os.fsync(self._file.fileno())
        size = self._file.tell()
        self._file.close()
        arrays: dict[str, np.ndarray] = {
            "record": np.array(self._places, dtype=np.uint64).reshape(-1, 3),
            "key": np.frombuffer(b"".join(map(bytes.fromhex, self.keys)), dtype=np.uint8).reshape(-1, _KEY),
            "text": np.frombuffer(b"".join(self._texts), dtype=np.uint8),
            "text_start": _starts(map(len, self._texts)),
            **tables_of(self._columns),
        }
        table = write_table(self.folder / f"{self.name}.table", arrays)
        units = sorted({text.decode().rsplit("\0", 1)[1] for text in self._texts})
        return {"name": self.name, "parts": len(self), "bytes": size, "units": units, "table": table}


def tables_of(columns: Sequence[Mapping[str, Any]]) -> dict[str, np.ndarray]:
    """Return the arrays of parts with these signatures, including the sorted columns.

    Args:
        columns: signatures of the parts.
    """
    arrays = {name: np.stack([c[name] for c in columns]) for name in ("numbers", "grid")}
    for name in RAGGED:
        arrays[name] = np.concatenate([c[name] for c in columns])
        arrays[f"{name}_start"] = _starts(len(c[name]) for c in columns)
    return {**arrays, **index_of(arrays)}


def _starts(lengths: Iterable[int]) -> np.ndarray:
    return np.cumsum([0, *lengths]).astype(np.int64)


class Segment:
    """Opened segment."""

    def __init__(self, folder: Path, known: dict[str, Any]) -> None:
        self.known, self.folder, self.name = known, folder, str(known["name"])
        self._file = Packed(folder, f"{self.name}.parts", int(known["bytes"]))
        table = known["table"]
        self.table = Table(Mapped(folder, f"{self.name}.table", int(table["bytes"])), table["arrays"])
        self.count = int(known["parts"])

    def __len__(self) -> int:
        return self.count

    def text(self, row: int) -> list[str]:
        """Return name, source and unit of a part.

        Args:
            row: number of the part in the segment.

        Raises:
            InputError: the segment is damaged.
        """
        start = self.table["text_start"]
        try:
            name, source, unit = bytes(self.table["text"][start[row] : start[row + 1]]).decode().split("\0")
        except ValueError:
            raise damaged(self.folder, f"{self.name}.table without the name of part {row}") from None
        return [name, source, unit]

    def key(self, row: int) -> str:
        """Return the file hash of a part.

        Args:
            row: number of the part in the segment.
        """
        return bytes(self.table["key"][row]).hex()

    def keys(self) -> Iterator[str]:
        """Return an iterator over the file hashes of all parts."""
        return (self.key(row) for row in range(self.count))

    def packed(self, row: int) -> tuple[bytes, bytes]:
        """Return the compressed bytes of a part and of its shape.

        Args:
            row: number of the part in the segment.

        Raises:
            InputError: the table is damaged.
        """
        first, middle, last = (int(x) for x in self.table["record"][row])
        if not first <= middle <= last <= int(self.known["bytes"]):
            raise damaged(self.folder, f"{self.name}.table with places beyond {self.name}.parts")
        return self._file.read(first, middle), self._file.read(middle, last)

    def record(self, row: int) -> Record:
        """Return the record of a part, to be written to another segment.

        Args:
            row: number of the part in the segment.
        """
        columns = {"numbers": self.table["numbers"][row], "grid": self.table["grid"][row]}
        for name in RAGGED:
            start = self.table[f"{name}_start"]
            columns[name] = self.table[name][start[row] : start[row + 1]]
        name, source, unit = self.text(row)
        part, shape = self.packed(row)
        return Record(name, source, unit, part, shape, columns)

    def part(self, row: int) -> Part:
        """Return a part whose attributes are decoded at first use.

        Args:
            row: number of the part in the segment.

        Raises:
            InputError: its bytes are damaged.
        """
        name, source, _ = self.text(row)
        part_bytes, _ = self.packed(row)
        part = part_from_bytes(self._unpacked(part_bytes, name), name=name, source=source)
        part.derived["stored"] = self._beside(row, name)
        return part

    def _beside(self, row: int, name: str) -> Callable[[str], Any]:
        """Return a function that loads stored data of a part by kind."""

        def load(kind: str) -> Any:
            if kind == RESTS:
                start = self.table["rests_start"]
                return self.table["rests"][start[row] : start[row + 1]].reshape(-1).view(np.uint8)
            if kind != SHAPE:
                return None
            return np.frombuffer(self._unpacked(self.packed(row)[1], name), dtype=np.uint8)

        return load

    def _unpacked(self, data: bytes, name: str) -> bytes:
        try:
            return zlib.decompress(data)
        except zlib.error as error:
            raise damaged(self.folder, f"damaged bytes of part '{name}' ({error})") from None

    def check(self) -> None:
        """Read and check the whole segment.

        Raises:
            InputError: a part or a column is damaged.
        """
        from tanteo import _core

        for name in self.known["table"]["arrays"]:
            self.table[name]
        for row in range(self.count):
            part = self.part(row)
            try:
                for field in ("faces", "planes", "edges", "symmetry"):
                    getattr(part, field)
                _core.open_shape(part.derived["stored"](SHAPE))
            except (InputError, ValueError) as error:
                raise damaged(self.folder, f"part '{part.name}' that cannot be opened ({error})") from None
