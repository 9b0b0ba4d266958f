"""Read lines of numbers only, separated by blanks, tabs, commas or semicolons, as machines and scanners write them."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.io.logs.contents import Contents, is_whole

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
_ROW = re.compile(rf"\s*{_NUMBER}(?:[\s,;]+{_NUMBER})+[\s,;]*", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[-+]?\d+(?:,\d+)?(?:[ \t;]+[-+]?\d+(?:,\d+)?)+[ \t;]*", re.ASCII)
_COMMENT = ("#", "//", "%", "(")
_ENOUGH = 50
"""Number of rows that format recognition uses."""
_SLACK = 2e-2
"""Largest deviation of a direction's length from one that rounding explains."""


@dataclass(frozen=True, slots=True)
class NumberRows:
    """Rows of a file of numbers.

    Attributes:
        values: numbers ``(n, k)``.
        names: column names from a comment above the rows; empty if there is none.
    """

    values: FloatArray
    names: tuple[str, ...]


def _is_comment(line: str) -> bool:
    return line.startswith(_COMMENT)


def first_rows(contents: Contents) -> NumberRows | None:
    """Return the first rows if the file starts with numbers only; None otherwise.

    Args:
        contents: file to read.
    """
    lines = [line.strip() for line in contents.head.splitlines()[: _ENOUGH + 20]]
    if len(contents.data) > len(contents.head.encode()):
        lines = lines[:-1] or lines
    rows = [line for line in lines if line and not _is_comment(line)]
    if rows and is_whole(rows[0]):
        rows = rows[1:]  # CloudCompare writes the number of points first
    if not rows or not all(_ROW.fullmatch(row) or _DECIMAL_COMMA.fullmatch(row) for row in rows):
        return None
    words = [_words(row) for row in rows]
    if len({len(row) for row in words}) != 1:
        return None
    return NumberRows(np.array(words, dtype=np.float64), _names(lines, len(words[0])))


def all_rows(contents: Contents, what: str) -> NumberRows:
    """Return all rows of a file.

    Args:
        contents: file to read.
        what: description of a row, for messages.

    Raises:
        ReadingsError: a line is not numeric or has another number of columns; the message names it.
    """
    kept = [(k, line) for k, line in enumerate(contents.lines, start=1) if line and not _is_comment(line)]
    if kept and is_whole(kept[0][1]):
        kept = kept[1:]
    names = _names(contents.lines, len(_words(kept[0][1])) if kept else 0)
    text = [line.replace(",", " ").replace(";", " ") for _, line in kept]
    if not any(_DECIMAL_COMMA.fullmatch(line) and "," in line and "." not in line for _, line in kept[:_ENOUGH]):
        try:
            values = np.loadtxt(text, ndmin=2, comments=None)
        except ValueError:
            values = np.empty((0, 0))
        if values.size and np.isfinite(values).all():
            return NumberRows(values, names)
    return NumberRows(contents.numbers([_words(line) for _, line in kept], [k for k, _ in kept], what), names)


def _words(row: str) -> list[str]:
    if "," in row and "." not in row and re.search(r"[ \t;]", row) and _DECIMAL_COMMA.fullmatch(row):
        return row.replace(",", ".").replace(";", " ").split()
    return re.split(r"[\s,;]+", row.strip(" \t,;"))


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
