"""Store a catalogue on disk: segments that never change, and a manifest that lists the valid ones.

``catalogue.json`` is the manifest. A segment consists of ``<name>.parts``, the compressed bytes of its parts, and
``<name>.table``, memory-mapped arrays of all its parts. New data goes into new segments, then the manifest is replaced,
so a reader opens either the old or the new catalogue. A writer holds a lock of the operating system, which ends with
its process.
"""

from __future__ import annotations

import hashlib
import json
import mmap
import os
import secrets
import sys
import threading
import weakref
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.catalogue.archive import FORMAT_VERSION
from tanteo.catalogue.shaping import SHAPE
from tanteo.errors import InputError
from tanteo.parts import RECORD, read_whole
from tanteo.replaced import replaced

MANIFEST, LOCK = "catalogue.json", "catalogue.lock"

SCHEMA = "tanteo.catalogue/1"

FORMATS = {"part": FORMAT_VERSION, "shape": SHAPE, "table": 2, "byteorder": sys.byteorder}
"""Versions of a catalogue's content; a catalogue with other versions must be rebuilt."""

_ALIGNED = 64

_AGAIN = "Build the catalogue again: tanteo catalogue build FOLDER... --out {}."


def is_catalogue(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is a folder with a catalogue.

    Args:
        path: path to test.
    """
    return (Path(path) / MANIFEST).is_file()


def damaged(folder: Path, what: str) -> InputError:
    """Return the error for a damaged catalogue.

    Args:
        folder: folder of the catalogue.
        what: description of the fault.
    """
    return InputError(f"{folder}: expected an undamaged catalogue, got {what}. {_AGAIN.format(folder)}")


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return the manifest of a catalogue.

    Args:
        folder: folder of the catalogue.

    Raises:
        InputError: there is none, or it is damaged or of another version.
    """
    if not is_catalogue(folder):
        raise InputError(
            f"{folder}: expected a catalogue (a folder with {MANIFEST}), got none there. "
            f"Make one: tanteo catalogue build FOLDER... --out {folder}."
        )
    content = read_whole(folder / MANIFEST, "the manifest of a catalogue", RECORD)
    try:
        manifest = json.loads(content)
        known = manifest["schema"]
        total = manifest.pop("sha256")
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise damaged(folder, f"a {MANIFEST} that is no manifest") from None
    if known != SCHEMA:
        newer = f"'{known}', which another version of tanteo wrote" if isinstance(known, str) else "no known schema"
        raise InputError(f"{folder}: expected {SCHEMA}, got {newer}. Use that version, or build it again.")
    if total != _sum(manifest):
        raise damaged(folder, f"a {MANIFEST} with a wrong checksum")
    return dict(manifest)


def check_formats(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Check that this version and machine can read the catalogue.

    Args:
        folder: folder of the catalogue, for messages.
        manifest: manifest of the catalogue.

    Raises:
        InputError: the catalogue has other formats of parts, shapes or tables.
    """
    if manifest["formats"] != FORMATS:
        own = ", ".join(f"{name} {version}" for name, version in FORMATS.items())
        other = ", ".join(f"{name} {version}" for name, version in manifest["formats"].items())
        raise InputError(
            f"{folder}: expected formats {own}, got {other}, of another version of tanteo. {_AGAIN.format(folder)}"
        )


def write_manifest(folder: Path, segments: list[dict[str, Any]], **facts: Any) -> None:
    """Replace the manifest, which makes the listed segments the content of the catalogue.

    Args:
        folder: folder of the catalogue.
        segments: manifest entries of the segments.
        facts: further entries of the manifest.
    """
    manifest = {"schema": SCHEMA, "formats": FORMATS, **facts, "segments": segments}
    with replaced(folder / MANIFEST) as file:
        file.write_text(json.dumps({**manifest, "sha256": _sum(manifest)}, indent=1) + "\n", encoding="utf-8")


def _sum(manifest: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(manifest, sort_keys=True).encode()).hexdigest()


@contextmanager
def writer(folder: Path) -> Iterator[None]:
    """Hold the catalogue's write lock inside a with block; do not wait for another writer.

    Args:
        folder: folder of the catalogue, which is created if missing.

    Raises:
        InputError: another process writes, or the folder is not writable.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        why = error.strerror or error
        raise InputError(f"{folder}: expected a folder to write a catalogue to, got: {why}. Choose another.") from None
    try:
        try:
            _lock(handle)
        except OSError:
            raise InputError(f"{folder}: expected no other writer, got one at work. Wait until it has ended.") from None
        yield
    finally:
        os.close(handle)  # closing releases the lock


def _lock(handle: int) -> None:
    """Lock an open file; the operating system releases the lock when the process ends."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def sweep(folder: Path, segments: list[dict[str, Any]]) -> None:
    """Remove segments that are not in the manifest: replaced ones, and those of interrupted writers.

    Readers keep their mapped files.

    Args:
        folder: folder of the catalogue.
        segments: manifest entries of the segments to keep.
    """
    kept = {f"{segment['name']}{suffix}" for segment in segments for suffix in (".parts", ".table")}
    for suffix in (".parts", ".table"):
        for file in folder.glob(f"segment-*{suffix}"):
            if file.name not in kept:
                with suppress(OSError):  # Windows: a reader has it open; the next writer finds it
                    file.unlink()


def new_name() -> str:
    """Return a unique name for a new segment."""
    return f"segment-{secrets.token_hex(8)}"


def write_table(path: Path, arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Write arrays to one file, synchronized to disk, and return its manifest entry.

    Args:
        path: file to write.
        arrays: arrays by name.
    """
    places = {}
    at = 0
    with path.open("wb") as file:
        for name, given in arrays.items():
            array = np.ascontiguousarray(given)
            at += file.write(bytes(-at % _ALIGNED))
            data = array.tobytes()
            places[name] = [at, array.dtype.str, list(array.shape), zlib.crc32(data)]
            at += file.write(data)
        file.flush()
        os.fsync(file.fileno())
    return {"bytes": at, "arrays": places}


class Mapped:
    """Memory-mapped file of a catalogue, whose pages all processes share."""

    def __init__(self, folder: Path, name: str, size: int) -> None:
        self.folder, self.name = folder, name
        path = folder / name
        with path.open("rb") as file:
            there = os.fstat(file.fileno()).st_size
            if there != size:
                raise damaged(folder, f"{there:,} bytes of {name} instead of {size:,}")
            self.data: Any = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""


class Packed:
    """File of a catalogue that is read in pieces; mapping has no benefit, because the pieces are decompressed."""

    def __init__(self, folder: Path, name: str, size: int) -> None:
        self.folder, self.name, self.size = folder, name, size
        self._file = (folder / name).open("rb", buffering=0)
        weakref.finalize(self, self._file.close)
        self._lock = threading.Lock()
        there = os.fstat(self._file.fileno()).st_size
        if there != size:
            self._file.close()
            raise damaged(folder, f"{there:,} bytes of {name} instead of {size:,}")

    def read(self, first: int, last: int) -> bytes:
        """Return the bytes between two offsets.

        Args:
            first: offset of the first byte.
            last: offset after the last byte.
        """
        with self._lock:
            self._file.seek(first)
            return self._file.read(last - first)


class Table:
    """Arrays of a segment, each checked at first use."""

    def __init__(self, file: Mapped, places: Mapping[str, Any]) -> None:
        self._file, self._places = file, places
        self._known: dict[str, np.ndarray] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._places

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._known:
            self._known[name] = self._checked(name)
        return self._known[name]

    def _checked(self, name: str) -> np.ndarray:
        file = self._file
        try:
            at, kind, shape, checksum = self._places[name]
            dtype = np.dtype(kind)
            count = int(np.prod(shape, dtype=np.int64))
            array = np.frombuffer(file.data, dtype, count, at) if count else np.zeros(0, dtype)
        except (ValueError, TypeError, KeyError) as error:
            raise damaged(file.folder, f"a manifest that does not fit {file.name} ({error})") from None
        if zlib.crc32(array.view(np.uint8).data if count else b"") != checksum:
            raise damaged(file.folder, f"{file.name} with a wrong checksum of '{name}'")
        return array.reshape(shape)
