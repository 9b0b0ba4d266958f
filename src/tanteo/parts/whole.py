"""Read files with a bound of their size; pipes and devices are refused.

A reader that waits for a pipe hangs, one that reads ``/dev/zero`` takes all memory; both are refused before a byte is
read. The bound holds for what is read, not for the size that the file system states.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from tanteo.errors import InputError

DOCUMENT = 4_000_000
"""Bytes of a file that a person writes (rig, scene, calibration): a thousand times an ordinary one."""

RECORD = 512_000_000
"""Bytes of a file that programs write (session record, image)."""


def read_whole(path: str | Path, what: str, most: int = DOCUMENT) -> bytes:
    """Return the content of a file.

    Args:
        path: file to read; links are followed.
        what: expected kind of file with its article, for the message.
        most: largest accepted size [bytes].

    Raises:
        InputError: the file cannot be read, is a folder, pipe or device, or is too large.

    Example:
        >>> len(read_whole("images/camera.yaml", "a calibration file")) > 100
        True
    """
    check_file(path, what)
    try:
        with Path(path).open("rb") as file:
            content = file.read(most + 1)
    except OSError as error:
        raise InputError(f"{path}: expected {what}, got: {error.strerror or error}. Check the path.") from None
    if len(content) > most:
        raise InputError(f"{path}: expected {what} of up to {most / 1e6:g} MB, got more. Is it the right file?")
    return content


def check_file(path: str | Path, what: str) -> None:
    """Check that a path names a regular file, without opening it.

    Args:
        path: path to check.
        what: kind of the expected file, for the message.

    Raises:
        InputError: the path is missing, or names a folder, a pipe or a device.
    """
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: expected {what}, got: {why}. Check the path.") from None
    if stat.S_ISDIR(mode):
        raise InputError(f"{path}: expected {what}, got a folder. Name a file in it.")
    if not stat.S_ISREG(mode):
        raise InputError(f"{path}: expected {what}, got a pipe or device. Save it to a file first.")
