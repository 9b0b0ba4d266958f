"""Read parts, remembered on disk by the content of their files.

An entry is named by a hash of the file's bytes, the unit it was read in and the version of the readers, so it is never
out of date: another content is another entry. The folder is ``$TANTEO_CACHE`` or the platform's own for caches;
deleting it costs only the time to read again. What cannot be written is not remembered, what is damaged is read again.
"""

from __future__ import annotations

import hashlib
import os
import sys
from pathlib import Path

from tanteo.catalogue.archive import FORMAT_VERSION, part_from_bytes, part_to_bytes
from tanteo.errors import InputError
from tanteo.parts import Part
from tanteo.parts.files import UNITLESS
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
        content = path.read_bytes()
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
        data = _entry(key).read_bytes()
        return part_from_bytes(data, name=name, source=source)
    except (OSError, InputError):
        return None


def store(key: str, part: Part) -> bool:
    """Remember a part; return whether that worked.

    The entry appears whole or not at all, also when several processes write it at once.
    """
    entry = _entry(key)
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        with replaced(entry) as file:
            file.write_bytes(part_to_bytes(part))
    except OSError:
        return False
    return True


def _entry(key: str) -> Path:
    return cache_folder() / "parts" / key[:2] / f"{key}.npz"
