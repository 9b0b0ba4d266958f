"""Replace files atomically: a full disk or an interruption leaves the old file unchanged."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replaced(path: str | Path, *, durable: bool = True) -> Iterator[Path]:
    """Yield a new file to write to, which replaces the file of this name at the end of the context.

    The new file has the same suffix. The target of a link is replaced. Devices, pipes, and files in folders without
    permission for new files are written directly.

    Args:
        path: file to replace.
        durable: whether the content is flushed to the disk before the replacement.

    Raises:
        OSError: the file cannot be written.
    """
    file = Path(os.path.realpath(path))  # unlike Path.resolve, it accepts circular links
    other = file.with_name(f".{secrets.token_hex(6)}-{file.name[-60:]}")
    if file.exists() and not file.is_file():
        yield file
        return
    try:
        other.touch(exist_ok=False)
    except PermissionError:
        yield file
        return
    try:
        yield other
        if file.exists():
            shutil.copymode(file, other)
        if durable:
            _flush(other)
        other.replace(file)
        if durable and os.name == "posix":
            with suppress(OSError):  # a folder without read permission, or a network disk
                _flush(file.parent)
    except BaseException:
        with suppress(OSError):
            other.unlink()
        raise


def _flush(path: Path) -> None:
    """Flush a file, or the names in a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
