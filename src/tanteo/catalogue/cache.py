"""Read parts, and what was derived from them, remembered on disk by the content of their files.

An entry is named by a hash of the file's bytes, the unit it was read in and the version of the readers, so it is never
out of date: another content is another entry. The folder is ``$TANTEO_CACHE`` or the platform's own for caches;
deleting it costs only the time to read again. What cannot be written is not remembered, what is damaged is read again.
"""

from __future__ import annotations

import hashlib
import mmap
import os
import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tanteo.catalogue.archive import FORMAT_VERSION, part_from_bytes, part_to_bytes
from tanteo.errors import InputError
from tanteo.parts import UNITLESS, Part
from tanteo.replaced import replaced


def cache_folder() -> Path:
    """Return the folder of the cache; it need not exist."""
    chosen = os.environ.get("TANTEO_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "tanteo"


def cache_key(path: Path, unit: str | None) -> str | None:
    """Name the entry of a file by its content, format, unit and the version of the readers.

    Returns:
        The name; None where the file cannot be read.
    """
    try:
        with open(path, "rb", buffering=0) as file:
            content = file.read()
    except OSError:
        return None
    suffix = path.suffix.lower()
    means = unit if suffix in UNITLESS else None
    digest = hashlib.sha256(f"{FORMAT_VERSION}|{suffix}|{means or ''}|".encode())
    digest.update(content)
    return digest.hexdigest()


def load(key: str, *, name: str, source: str) -> Part | None:
    """Return the remembered part under a new name and source; None where there is none or it is damaged."""
    try:
        part = part_from_bytes(_entry(key, "part").read_bytes(), name=name, source=source)
    except (OSError, InputError):
        return None
    part.derived["key"] = key
    return part


def store(key: str, part: Part) -> bool:
    """Remember a part; return whether that worked."""
    part.derived["key"] = key
    return _write(key, "part", part_to_bytes(part))


def load_derived(part: Part, kind: str) -> npt.NDArray[np.uint8] | None:
    """Open what was derived from a part and remembered beside it, in place, without reading it.

    Args:
        part: one that was read with the cache.
        kind: of what was derived, and its version.

    Returns:
        The bytes, memory-mapped ``(n,)``; None where there are none. Whether they are whole is for the caller to see.
    """
    key = part.derived.get("key")
    if key is None:
        return None
    try:
        with _entry(key, kind).open("rb") as file:
            return np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), dtype=np.uint8)
    except (OSError, ValueError):  # not there, or empty
        return None


def store_derived(part: Part, kind: str, data: bytes) -> bool:
    """Remember what was derived from a part that was read with the cache; return whether that worked."""
    key = part.derived.get("key")
    return key is not None and _write(key, kind, data)


def _write(key: str, kind: str, data: bytes) -> bool:
    """Write an entry, which appears whole or not at all, also when several processes write it at once."""
    entry = _entry(key, kind)
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        with replaced(entry, durable=False) as file:
            file.write_bytes(data)
    except OSError:
        return False
    return True


def _entry(key: str, kind: str) -> Path:
    return cache_folder() / "parts" / key[:2] / f"{key}.{kind}"
