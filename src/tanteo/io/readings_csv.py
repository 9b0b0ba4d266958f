"""Readings files: comma-separated, UTF-8, one reading a row (``docs/formats.md``)."""

from __future__ import annotations

import csv
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import TextIO

from tanteo.errors import ReadingsError, check_kind
from tanteo.io.columns import read_header
from tanteo.io.lines import Lines
from tanteo.io.table import Table
from tanteo.sensors import Readings

CHUNK = 50_000
"""Rows converted at a time: the text of no more than these is held."""


def read_readings(path: str | Path, progress: Callable[[int], None] | None = None) -> Readings:
    """Read a readings file.

    Args:
        path: The file.
        progress: Called with the number of rows read so far, every so often.

    Raises:
        ReadingsError: The file cannot be read or says something that a readings file cannot say; the message names
            file, line, column and value.
        UnitError: A unit is missing, unknown or contradictory.

    Example:
        >>> readings = tanteo.read_readings("readings/bracket_left.csv")
        >>> len(readings)
        30
    """
    check_kind("path", path, (str, Path), "Name the file.")
    path = Path(path)
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            # complaints read the file again to find their line, which a pipe cannot
            raise ReadingsError(f"{path}: expected a file, got a pipe or device. Save the readings to a file first.")
        with path.open("rb") as binary:
            start = binary.read(4096)
        if b"\0" in start:
            raise ReadingsError(f"{path}: expected a text file (UTF-8, commas), got a binary one. Export it as CSV.")
        with path.open(encoding="utf-8-sig", newline="") as text:
            return _read_table(path, text, progress)
    except UnicodeDecodeError as error:
        raise ReadingsError(
            f"{path}: expected UTF-8 text, got byte {error.object[error.start]:#04x}. Re-save it."
        ) from None
    except OSError as error:
        raise ReadingsError(
            f"{path}: expected a readings file, got: {error.strerror or error}. Check the path."
        ) from None


def _read_table(path: Path, text: TextIO, progress: Callable[[int], None] | None) -> Readings:
    lines = Lines(text)
    rows = csv.reader(lines, strict=True)
    try:
        header = next(rows, None)
        if header is None:
            raise ReadingsError(f"{path}: expected a header line, got an empty file. Name the columns in it.")
        table = Table(path, read_header(header, f"{path}, line {lines.number}"))
        while chunk := list(islice(rows, CHUNK)):
            table.add(chunk)
            if progress is not None:
                progress(table.count)
    except csv.Error as error:
        raise _no_table(path, lines.number, error) from None
    if not table.count:
        raise ReadingsError(f"{path}: expected at least one reading below the header, got none. Add rows.")
    return table.readings()


def _no_table(path: Path, number: int, error: csv.Error) -> ReadingsError:
    """What is wrong with a file of which some line cannot be read: the last, where a quotation mark is still open."""
    if "unexpected end" not in str(error):
        return ReadingsError(f"{path}, line {number}: expected comma-separated cells, got: {error}. Correct the line.")
    first = number
    with path.open(encoding="utf-8-sig", newline="") as text:
        lines = Lines(text)
        rows = csv.reader(lines, strict=True)
        try:
            for _ in rows:
                first = lines.number + 1
        except csv.Error:
            pass
    return ReadingsError(
        f"{path}, line {first}: expected comma-separated cells, got a quotation mark that is never closed, from this "
        "line on. Close it or leave it out."
    )
