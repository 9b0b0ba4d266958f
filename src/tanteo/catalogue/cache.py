"""Read parts, and what was derived from them, remembered on disk by the content of their files.

An entry is named by a hash of the file's bytes, the unit it was read in and the version of the readers, so it is never
out of date: another content is another entry. It ends in a checksum over its name and its bytes: one that was damaged,
or is another's, is not used and is written again. The folder is ``$TANTEO_CACHE`` or the platform's own for caches, for
its owner alone; deleting it costs only the time to read again. What cannot be written is not remembered.
"""

from __future__ import annotations

import hashlib
import mmap
import os
import stat
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tanteo.catalogue.archive import FORMAT_VERSION, part_from_bytes, part_to_bytes
from tanteo.errors import InputError
from tanteo.parts import CAD_READERS, LARGEST_FILE, Part
from tanteo.replaced import replaced

_CHECKSUM = 8
"""Bytes of it, at the end of an entry."""


_CHUNK = 1 << 24

_REFERENCE = b"DOCUMENT_FILE"
"""In STEP files that refer to others."""


def cache_folder() -> Path:
    """Return the folder of the cache; it need not exist. Without a home it is one for temporary files."""
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


def cache_key(path: Path, unit: str | None) -> str | None:
    """Name the entry of a file by its content, format, unit and the version of the readers.

    Returns:
        The name; None where the file cannot be read, is too large for a part, or refers to other files, or where it is
        not known whether its reader has changed.
    """
    suffix = path.suffix.lower()
    plugin = CAD_READERS.fingerprint(suffix.removeprefix("."))
    if plugin is None:
        return None
    digest = hashlib.sha256(f"{FORMAT_VERSION}|{suffix}|{unit or ''}|{plugin}".encode())
    try:
        if path.stat().st_size > LARGEST_FILE:
            return None
        before = b""
        with open(path, "rb", buffering=0) as file:
            while content := file.read(_CHUNK):
                if suffix in (".step", ".stp") and _REFERENCE in before + content:
                    return None  # what it refers to may change while it stays the same
                before = content[-len(_REFERENCE) :]
                digest.update(content)
    except OSError:
        return None
    return digest.hexdigest()


def load(key: str, *, name: str, source: str) -> Part | None:
    """Return the remembered part under a new name and source; None where there is none or it is damaged."""
    try:
        data = _entry(key, "part").read_bytes()
        if not _whole(memoryview(data), key, "part"):
            return None
        part = part_from_bytes(data[:-_CHECKSUM], name=name, source=source)
    except (OSError, InputError):
        return None
    part.derived["key"] = key
    return part


def store(key: str, part: Part) -> bool:
    """Remember a part; return whether that worked."""
    part.derived["key"] = key
    return _write(key, "part", part_to_bytes(part))


def load_derived(part: Part, kind: str) -> npt.NDArray[np.uint8] | None:
    """Open what was derived from a part and remembered beside it, in place.

    Args:
        part: one that was read with the cache, or is of a catalogue, which keeps such beside it.
        kind: of what was derived, and its version.

    Returns:
        The bytes, memory-mapped ``(n,)``; None where there are none, or others than were written.
    """
    key, stored = part.derived.get("key"), part.derived.get("stored")
    if stored is not None and (found := stored(kind)) is not None:
        return np.asarray(found)
    if key is None:
        return None
    try:
        with _entry(key, kind).open("rb") as file:
            whole = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), dtype=np.uint8)
    except (OSError, ValueError):  # not there, or empty
        return None
    return whole[:-_CHECKSUM] if _whole(memoryview(whole.data), key, kind) else None


def store_derived(part: Part, kind: str, data: bytes) -> bool:
    """Remember what was derived from a part that was read with the cache; return whether that worked."""
    key = part.derived.get("key")
    return key is not None and _write(key, kind, data)


def _write(key: str, kind: str, data: bytes) -> bool:
    """Write an entry, which appears whole or not at all, also when several processes write it at once."""
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
    return True


def _private(folder: Path) -> bool:
    """Make a folder that is its owner's alone; whether it is this user's."""
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
    """Whether an entry is what was written under this name."""
    return bytes(data[-_CHECKSUM:]) == _checksum(data[:-_CHECKSUM], key, kind)


def _checksum(content: bytes | memoryview, key: str, kind: str) -> bytes:
    start = zlib.crc32(f"{key}.{kind}".encode())
    return zlib.crc32(content, start).to_bytes(4, "little") + zlib.adler32(content, start).to_bytes(4, "little")


def _entry(key: str, kind: str) -> Path:
    return cache_folder() / "parts" / key[:2] / f"{key}.{kind}"
