"""Files that are replaced whole or not at all: a full disk or an interruption leaves the old one as it was."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replaced(path: str | Path, *, durable: bool = True) -> Iterator[Path]:
    """A new file to write to inside, which takes the place of the one of this name when all of it is written.

    It ends in the same suffix. A link stays one and its file is replaced; a device or a pipe is written to itself, and
    so is a file in a folder where there may be no other.

    Args:
        path: the file.
        durable: whether it is on the disk, not only on its way there, before it takes that place.

    Raises:
        OSError: It cannot be written.
    """
    file = Path(os.path.realpath(path))  # unlike Path.resolve it takes links that lead in a circle
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
            _settle(other)
        other.replace(file)
        if durable and os.name == "posix":
            with suppress(OSError):  # a folder that may be written to and not read, or a disk elsewhere
                _settle(file.parent)
    except BaseException:
        with suppress(OSError):
            other.unlink()
        raise


def _settle(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
