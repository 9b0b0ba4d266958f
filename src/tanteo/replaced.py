"""Files that are replaced whole or not at all: a full disk or an interruption leaves the old one as it was."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replaced(path: str | Path) -> Iterator[Path]:
    """A new file to write to inside, which takes the place of the one of this name when all of it is written.

    It ends in the same suffix. A link stays one and its file is replaced; a device or a pipe is written to itself, and
    so is a file in a folder where there may be no other.

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
        other.replace(file)
    except BaseException:
        with suppress(OSError):
            other.unlink()
        raise
