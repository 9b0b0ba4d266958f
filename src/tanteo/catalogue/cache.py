"""Cache parts, and data derived from them, on disk by the content of their files.

An entry's name is a hash of the file's bytes, its unit and the version of the readers, so an entry never becomes
outdated. An entry ends in a checksum of its name and bytes; a damaged or foreign entry is ignored and rewritten. The
folder is ``$TANTEO_CACHE`` or the platform's cache folder, accessible to its owner only. It may be deleted at any time.
If the folder is not writable, nothing is cached. Above ``$TANTEO_CACHE_LIMIT``, 1 GB by default, the entries that were
not used for the longest time are deleted.
"""

from __future__ import annotations

import hashlib
import mmap
import os
import stat
import sys
import tempfile
import zlib
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tanteo.catalogue.archive import FORMAT_VERSION, part_from_bytes, part_to_bytes
from tanteo.errors import InputError
from tanteo.parts import Part
from tanteo.parts.readers import CAD_READERS, LARGEST_FILE, split_body
from tanteo.replaced import replaced

_CHECKSUM = 8
"""Length of the checksum at the end of an entry [bytes]."""


_CHUNK = 1 << 24

_LIMIT = 1e9
"""Default size limit of the cache [bytes]: about 10,000 parts of a few hundred faces."""

_KEPT = 0.8
"""Share of the limit that remains when entries are deleted, so that not every new entry deletes another."""

_SUFFIXES = {"KB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12, "B": 1.0}
"""Units of a limit [bytes]."""

_REFERENCE = b"DOCUMENT_FILE"
"""Keyword in STEP files that refer to other files."""


def cache_folder() -> Path:
    """Return the folder of the cache, which need not exist; without a home it is a temporary folder."""
    chosen = os.environ.get("TANTEO_CACHE")
    try:
        return Path(chosen).expanduser() if chosen else _platform_folder() / "tanteo"
    except RuntimeError:  # there is no home
        user = os.getuid() if hasattr(os, "getuid") else 0
        return Path(tempfile.gettempdir()) / f"tanteo-{user}"


def _platform_folder() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


@dataclass(frozen=True, slots=True)
class CacheSize:
    """Size of the cache, or of a part of it.

    Attributes:
        parts: number of parts.
        entries: number of files: parts, and data derived from them.
        bytes: size of the files [bytes].
    """

    parts: int
    entries: int
    bytes: int


def cache_limit() -> float:
    """Return the size limit of the cache [bytes]: ``$TANTEO_CACHE_LIMIT`` as ``500MB`` or ``2GB``, 1 GB by default.

    Raises:
        InputError: the variable is not a size.
    """
    text = os.environ.get("TANTEO_CACHE_LIMIT", "").strip()
    if not text:
        return _LIMIT
    unit = next((unit for unit in _SUFFIXES if text.upper().endswith(unit)), "")
    try:
        limit = float(text[: len(text) - len(unit)]) * _SUFFIXES.get(unit, 1.0)
    except ValueError:
        limit = -1.0
    if not 0.0 <= limit < float("inf"):
        raise InputError(f"TANTEO_CACHE_LIMIT: expected a size such as 500MB or 2GB, got {text!r}. Correct it.")
    return limit


def cache_size() -> CacheSize:
    """Return the size of the cache."""
    return _size_of(_entries())


def clear_cache() -> CacheSize:
    """Delete all entries of the cache, and return their size."""
    return _size_of([entry for entry in _entries() if _deleted(entry[2])])


def _entries() -> list[tuple[float, int, Path]]:
    """Return the time of the last use, the size and the path of each entry."""
    found = []
    for path in (cache_folder() / "parts").glob("[0-9a-f][0-9a-f]/*.*"):
        with suppress(OSError):
            status = path.stat()
            if stat.S_ISREG(status.st_mode):
                found.append((status.st_mtime, status.st_size, path))
    return found


def _size_of(entries: list[tuple[float, int, Path]]) -> CacheSize:
    parts = sum(path.suffix == ".part" for _, _, path in entries)
    return CacheSize(parts, len(entries), sum(size for _, size, _ in entries))


def _deleted(path: Path) -> bool:
    try:
        path.unlink()
    except OSError:
        return False
    return True


class _Written:
    """Count of the bytes that this process has written since the size of the cache was last compared to its limit."""

    count = float("inf")


def _keep_limit(size: int) -> None:
    """Delete the entries that were not used for the longest time if the cache is above its limit.

    The folder is listed at the first entry that a process writes, and then each time it has written a tenth of the
    limit.

    Args:
        size: size of the entry that was written [bytes].
    """
    limit = cache_limit()
    _Written.count += size
    if _Written.count < limit / 10:
        return
    _Written.count = 0
    entries = sorted(_entries())
    total = sum(one[1] for one in entries)
    if total <= limit:
        return
    for _, bytes_of, path in entries:
        if total <= _KEPT * limit:
            return
        if _deleted(path):
            total -= bytes_of


def _used(path: Path) -> None:
    """Record the use of an entry in its time of modification."""
    with suppress(OSError):
        os.utime(path)


def cache_key(path: Path, unit: str | None) -> str | None:
    """Return the name of a file's entry: a hash of content, format, unit and version of the readers.

    Args:
        path: CAD file.
        unit: length unit; None if the file states it.

    Returns:
        Name of the entry. None if the file cannot be read, is too large for a part, or refers to other files, or if a
        plug-in reads it that has no fingerprint.
    """
    path, body = split_body(path)
    suffix = path.suffix.lower()
    plugin = CAD_READERS.fingerprint(suffix.removeprefix("."))
    if plugin is None:
        return None
    digest = hashlib.sha256(f"{FORMAT_VERSION}|{suffix}|{unit or ''}|{plugin}|{body}".encode())
    try:
        if path.stat().st_size > LARGEST_FILE:
            return None
        before = b""
        with open(path, "rb", buffering=0) as file:
            while content := file.read(_CHUNK):
                if suffix in (".step", ".stp") and _REFERENCE in before + content:
                    return None  # the referenced files may change while this one does not
                before = content[-len(_REFERENCE) :]
                digest.update(content)
    except OSError:
        return None
    return digest.hexdigest()


def load(key: str, *, name: str, source: str) -> Part | None:
    """Return a cached part under a new name and source; None if there is no valid entry.

    Args:
        key: name of the entry, see :func:`cache_key`.
        name: name for the part.
        source: path of the file.
    """
    try:
        entry = _entry(key, "part")
        data = entry.read_bytes()
        _used(entry)
        if not _whole(memoryview(data), key, "part"):
            return None
        part = part_from_bytes(data[:-_CHECKSUM], name=name, source=source)
    except (OSError, InputError):
        return None
    part.derived["key"] = key
    return part


def store(key: str, part: Part) -> bool:
    """Cache a part, and return whether that succeeded.

    Args:
        key: name of the entry, see :func:`cache_key`.
        part: part to store.
    """
    part.derived["key"] = key
    return _write(key, "part", part_to_bytes(part))


def load_derived(part: Part, kind: str) -> npt.NDArray[np.uint8] | None:
    """Return data derived from a part, from the cache or the part's catalogue.

    Args:
        part: part that was read with the cache, or belongs to a catalogue.
        kind: kind of data with its version.

    Returns:
        Memory-mapped bytes ``(n,)``; None if there is no valid entry.
    """
    key = part.derived.get("key")
    stored = part.derived.get("stored")
    if stored is not None and (found := stored(kind)) is not None:
        return np.asarray(found)
    if key is None:
        return None
    try:
        entry = _entry(key, kind)
        _used(entry)
        with entry.open("rb") as file:
            whole = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), dtype=np.uint8)
    except (OSError, ValueError):  # not there, or empty
        return None
    return whole[:-_CHECKSUM] if _whole(memoryview(whole.data), key, kind) else None


def keeps(part: Part) -> bool:
    """Return whether the part was read with the cache, which then keeps what is derived from it."""
    return part.derived.get("key") is not None


def store_derived(part: Part, kind: str, data: bytes) -> bool:
    """Cache data derived from a part that was read with the cache, and return whether that succeeded.

    Args:
        part: part that the data belongs to.
        kind: kind of data with its version.
        data: bytes to store.
    """
    key = part.derived.get("key")
    return key is not None and _write(key, kind, data)


def _write(key: str, kind: str, data: bytes) -> bool:
    """Write an entry atomically, also when several processes write it at once."""
    entry = _entry(key, kind)
    try:
        if not _private(entry.parent.parent):
            return False
        entry.parent.mkdir(mode=0o700, exist_ok=True)
        with replaced(entry, durable=False) as file, file.open("wb") as stream:
            stream.write(data)
            stream.write(_checksum(data, key, kind))
    except OSError:
        return False
    _keep_limit(len(data))
    return True


def _private(folder: Path) -> bool:
    """Create a folder that only its owner can access, and return whether this user owns it."""
    folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    folder.mkdir(mode=0o700, exist_ok=True)
    if not hasattr(os, "getuid"):
        return True
    found = folder.stat()
    if found.st_uid != os.getuid():
        return False
    if stat.S_IMODE(found.st_mode) & 0o077:
        folder.chmod(0o700)
    return True


def _whole(data: memoryview, key: str, kind: str) -> bool:
    """Return whether an entry's checksum matches its name and content."""
    return bytes(data[-_CHECKSUM:]) == _checksum(data[:-_CHECKSUM], key, kind)


def _checksum(content: bytes | memoryview, key: str, kind: str) -> bytes:
    start = zlib.crc32(f"{key}.{kind}".encode())
    return zlib.crc32(content, start).to_bytes(4, "little") + zlib.adler32(content, start).to_bytes(4, "little")


def _entry(key: str, kind: str) -> Path:
    return cache_folder() / "parts" / key[:2] / f"{key}.{kind}"
