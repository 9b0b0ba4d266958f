"""Read lines of numbers, separated by blanks, tabs, commas or semicolons, as machines and scanners write them.

Each line may start with names (``P1``, ``Collection Group Target`` of SpatialAnalyzer's ASCII export, SpatialAnalyzer
user's manual, "Exporting ASCII Formatted Points"; a name in quotation marks of PowerInspect, "To export dynamic points
to an ASCII file") or with the number of the line, and end with other words, which are excluded.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.io.logs.contents import Contents, is_whole
from tanteo.io.logs.value_words import LENGTH_UNITS, plain

_NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_COMMA_NUMBER = re.compile(r"[-+]?\d+(?:,\d+)?", re.ASCII)
_WORD = re.compile(r"\"[^\"]*\"|'[^']*'|[^\s,;]+")
_WIDE_WORD = re.compile(r"\"[^\"]*\"|'[^']*'|[^\s;]+")
_NAME = re.compile(r"\"[^\"]*\"|'[^']*'|\w\S*|[-+][XYZxyz]:?")
_NO_NAME = re.compile(r"[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
_COMMENT = ("#", "//", "%", "(")
_ENOUGH = 50
"""Number of rows that format recognition uses."""
_NAMES = 3
"""Largest number of names before the numbers of a row."""
_LEAST = 3
"""Smallest number of numbers in a row with names, and of rows whose first number is that of the row."""
_SLACK = 2e-2
"""Largest deviation of a direction's length from one that rounding explains."""


@dataclass(frozen=True, slots=True)
class NumberRows:
    """Rows of a file of numbers.

    Attributes:
        values: numbers ``(n, k)``.
        names: column names from a comment above the rows; empty if there is none.
        labels: names of the rows, from words or numbers at their start; None if there are none.
        others: number of words after the numbers of a row.
        unit: unit behind each number; None if there is none.
    """

    values: FloatArray
    names: tuple[str, ...]
    labels: tuple[str, ...] | None = None
    others: int = 0
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class _Row:
    """Words of a row: names at the start, numbers, and the number of words after them."""

    label: str
    numbers: list[str]
    others: int


_BRACKETS = re.compile(r"[\[({]{1,3}\s*([-+]?[\d.][-+\d.eE,;\s]{0,400}?)\s*[\])}]{1,3}(?=[\s,;]*$)")
"""Coordinates in brackets at the end of a row: ``P1: (1, 2, 3)``, ``[[1 2 3]``."""


def _bare(line: str) -> str:
    """Return a row without brackets around its numbers."""
    return _BRACKETS.sub(r"\1", line) if line.rstrip(" \t,;")[-1:] in (")", "]", "}") else line


_ASSIGNED = re.compile(r"[A-Za-z][\w.]*\s*=\s*(?:[\w.]+\()?(?=[\[({])")
_BETWEEN = re.compile(r"(?<=[)\]}])\s*[,;]\s*(?=[(\[{])")
_VDA = re.compile(r"(\w+)\s*=\s*POINT\s*/\s*")
"""Point of VDA-FS (DIN 66301), ``P1 = POINT / 1.0, 2.0, 3.0``."""
_LIST = "[](){},; \t"
"""Characters around the rows of a list."""


_WITH_UNIT = re.compile(r"(?<=[\d.])(mm|um|in|m|[\"″])(?=[\s,;]|$)")
"""Unit behind a number, as in curve files of SolidWorks: ``25.4mm 0mm 3mm``."""
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[-+]?\d)")
_TIMES = 1e8
"""Definition: number above which a first column has times of a computer [s]: no unit makes it a place within 100 m."""


def _unit_of(lines: list[str]) -> str | None:
    """Return the unit behind the numbers of the first row; None if there is none."""
    first = next((line for line in lines if line.strip() and not _is_comment(line.strip())), "")
    units = _WITH_UNIT.findall(first)
    return LENGTH_UNITS[plain(units[0])] if len(units) >= _LEAST and len(set(units)) == 1 else None


def _rows(line: str, unit: str | None = None) -> list[str]:
    """Return the rows of a line: of lists in programs (``P = [1 2 3; 4 5 6]``, ``[(1, 2, 3), (4, 5, 6)]``) several."""
    line = line.strip()
    if unit is not None:
        line = _WITH_UNIT.sub(lambda match: "" if LENGTH_UNITS[plain(match[1])] == unit else match[0], line)
    if "D" in line or "d" in line:
        line = _FORTRAN.sub("e", line)
    if "=" in line:
        line = _VDA.sub(r"\1 ", _ASSIGNED.sub("", line, count=1), count=1)
    if line[:1] not in set("[({])}"):
        return [_bare(line)]
    pieces = _BETWEEN.split(line)
    if line[0] == "[":
        pieces = [part for piece in pieces for part in piece.split(";")]
    if len(pieces) > 1:
        pieces = [piece.strip(_LIST) for piece in pieces]
    return [_bare(piece) for piece in pieces if piece.strip(_LIST)]


def _is_comment(line: str) -> bool:
    return line.startswith(_COMMENT)


def first_rows(contents: Contents) -> NumberRows | None:
    """Return the first rows if the file starts with rows of numbers; None otherwise.

    Args:
        contents: file to read.
    """
    unit = _unit_of(contents.head.splitlines()[: _ENOUGH + 20])
    lines = [row for line in contents.head.splitlines()[: _ENOUGH + 20] for row in _rows(line, unit)]
    if len(contents.data) > len(contents.head.encode()):
        lines = lines[:-1] or lines
    kept = [line for line in lines if line and not _is_comment(line)]
    if kept and is_whole(kept[0]):
        kept = kept[1:]  # CloudCompare writes the number of points first
    rows = [row for row in map(_row, kept) if row is not None]
    if not rows or len(rows) < len(kept) or len({(bool(row.label), len(row.numbers)) for row in rows}) != 1:
        return None
    return _as_rows(np.array([row.numbers for row in rows], dtype=np.float64), lines, rows)


def all_rows(contents: Contents, what: str) -> NumberRows:
    """Return all rows of a file.

    Args:
        contents: file to read.
        what: description of a row, for messages.

    Raises:
        ReadingsError: a line is not numeric or has another number of columns, or the file ends within a number; the
            message names the line.
    """
    unit = _unit_of(contents.lines[:_ENOUGH])
    bare = ((k, row) for k, line in enumerate(contents.lines, start=1) for row in _rows(line, unit))
    kept = [(k, line) for k, line in bare if line and not _is_comment(line)]
    if kept and is_whole(kept[0][1]):
        kept = kept[1:]
    first = [row for _, line in kept[:_ENOUGH] if (row := _row(line))]
    plain = not any(row.label or row.others for row in first)
    if plain and not any("," in line and "." not in line and re.search(r"[ \t;]", line) for _, line in kept[:_ENOUGH]):
        try:
            values = np.loadtxt([line.replace(",", " ").replace(";", " ") for _, line in kept], ndmin=2, comments=None)
        except ValueError:
            values = np.empty((0, 0))
        if values.size and np.isfinite(values).all():
            contents.check_last(
                [re.split(r"[\s,;]+", line.strip(" \t,;"))[-1] for _, line in kept[-_ENOUGH:]], kept[-1][0]
            )
            return replace(_as_rows(values, contents.lines, first), unit=unit)
    rows = [_row(line) or _Row("", re.split(r"[\s,;]+", line.strip(" \t,;")), 0) for _, line in kept]
    values = contents.numbers([row.numbers for row in rows], [k for k, _ in kept], what)
    if not any(row.others for row in rows):
        contents.check_last([row.numbers[-1] for row in rows[-_ENOUGH:]], kept[-1][0])
    return replace(_as_rows(values, contents.lines, rows), unit=unit)


def _row(line: str) -> _Row | None:
    """Return the words of a row; None if it has no numbers in one run, or another number of names than allowed."""
    line = line.strip(" \t,;")
    words = _WORD.findall(line)
    number = _NUMBER
    if "," in line and "." not in line and re.search(r"[ \t;]", line):
        wide = _WIDE_WORD.findall(line)
        if all(_COMMA_NUMBER.fullmatch(word) or not (word[0].isdigit() or word[0] in "+-") for word in wide):
            words, number = wide, _COMMA_NUMBER
    start = next((k for k, word in enumerate(words) if number.fullmatch(word)), len(words))
    stop = next((k for k in range(start, len(words)) if not number.fullmatch(words[k])), len(words))
    names = words[:start]
    if start > _NAMES or any(
        not _NAME.fullmatch(w) or _NO_NAME.fullmatch(w) for w in (*names, *words[stop : stop + 1])
    ):
        return None
    if stop - start < (_LEAST if len(words) > stop - start else 2):
        return None
    label = " ".join(word.strip("\"'") for word in names)
    numbers = words[start:stop]
    return _Row(
        label, [n.replace(",", ".") for n in numbers] if number is _COMMA_NUMBER else numbers, len(words) - stop
    )


def _as_rows(values: FloatArray, lines: list[str], rows: list[_Row]) -> NumberRows:
    """Return the rows with the names of columns and rows; a first column of 1, 2, 3 .. numbers the rows."""
    names = _names(lines, values.shape[1])
    labels = tuple(row.label for row in rows) if rows and rows[0].label else None
    first = values[:, 0]
    counted = values.shape[1] > _LEAST and len(values) >= _LEAST and not names and first[0] in (0, 1)
    counted &= bool(np.all(np.diff(first) == 1)) and all(is_whole(row.numbers[0]) for row in rows)
    if values.shape[1] > _LEAST and len(first) and first.min() > _TIMES:
        return NumberRows(values[:, 1:], names[1:], labels, max((row.others for row in rows), default=0))
    if counted and not all(is_whole(word.lstrip("+-")) for row in rows for word in row.numbers[1:4]):
        numbers = (f"{value:.0f}" for value in first)
        labels = tuple(f"{label} {n}" for label, n in zip(labels, numbers, strict=True)) if labels else tuple(numbers)
        values = values[:, 1:]
    return NumberRows(values, names, labels, max((row.others for row in rows), default=0))


def _names(lines: list[str], count: int) -> tuple[str, ...]:
    """Return the column names from a comment that has as many words as there are columns; empty if there is none."""
    for line in lines[:20]:
        words = re.split(r"[\s,;]+", line.lstrip("#/%( ").rstrip(") ").strip().lower())
        if _is_comment(line) and len(words) == count and words[:3] == ["x", "y", "z"]:
            return tuple(words)
    return ()


def are_unit(vectors: FloatArray) -> bool:
    """Return whether all vectors have length one.

    Args:
        vectors: vectors ``(n, 3)``.
    """
    return bool(len(vectors) and np.all(np.abs(np.linalg.norm(vectors, axis=1) - 1) < _SLACK))
