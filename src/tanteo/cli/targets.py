"""Files that a command is to write: asked for before the long work, and what to do if it fails all the same."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tanteo.cli.options import MisuseError
from tanteo.errors import InputError

_ELSEWHERE = "Choose another folder"


def check_target(name: str, path: str | None, suffixes: Sequence[str] = ()) -> None:
    """Can this file be written? Asked before the long work, whose result would be lost. None is no file.

    Args:
        name: Of the option, as it is typed.
        path: Of the file.
        suffixes: With which it may end; with any if none are given.

    Raises:
        MisuseError: Another suffix.
        InputError: A folder that is not there or in which nothing may be written, or no name at all.
    """
    if path is None:
        return
    file = Path(path)
    if suffixes and file.suffix.lower() not in suffixes:
        raise MisuseError(
            f"{name}: expected a file name that ends in {' or '.join(suffixes)}, got '{path}'. Add the suffix."
        )
    with writing(name, path):
        if file.is_dir():
            raise _refused(name, path, "it is a folder. Name a file in it")
        if not file.parent.is_dir():
            raise _refused(name, path, f"there is no folder '{file.parent}'. Make it first")
        if not os.access(file if file.exists() else file.parent, os.W_OK):
            raise _refused(name, path, f"permission denied. {_ELSEWHERE}")


def check_different(*targets: tuple[str, str | None], inputs: Sequence[tuple[str, str | None]] = ()) -> None:
    """Are these files different ones, and none of them one that is read? Options and paths; None is no file.

    Raises:
        MisuseError: Two of them are one, or one would be written over what is read.
    """
    seen = {os.path.realpath(path): name for name, path in inputs if path is not None}
    for name, path in targets:
        if path is None:
            continue
        file = os.path.realpath(path)
        if other := seen.get(file):
            raise MisuseError(f"{name}: expected another file than that of {other}, got '{path}' for both. Name two.")
        seen[file] = name


def parts_read(paths: Sequence[str]) -> list[tuple[str, str]]:
    """Inputs of :func:`check_different`: files of parts, and those in folders of them."""
    from tanteo.parts import READABLE

    found = [str(f) for path in paths for f in inside(path) if f.suffix.lower() in READABLE]
    return [("a part", path) for path in (*paths, *found)]


def inside(path: str | Path) -> list[Path]:
    """What is in a folder, in order; nothing where that is none, or one that may not be read."""
    try:
        return sorted(Path(path).iterdir()) if Path(path).is_dir() else []
    except OSError:
        return []


@contextmanager
def writing(name: str, path: str) -> Iterator[None]:
    """Write this file inside; what the system refuses becomes advice.

    Raises:
        InputError: It could not be written: the disk is full, or the folder went away.
    """
    try:
        yield
    except OSError as error:
        raise _refused(name, path, f"{error.strerror or error}. {_ELSEWHERE}") from None


def _refused(name: str, path: str, why: str) -> InputError:
    return InputError(f"{name}: expected a file that can be written, got '{path}': {why}.")
