"""Detect how a table is written: encoding, delimiter, decimal comma, as spreadsheets save it."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TextIO

from tanteo.io.logs.contents import HEAD, encoding_of
from tanteo.io.logs.value_words import stated_unit

_SEPARATOR = re.compile(r"sep=(.)\s*$", re.IGNORECASE)
_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?", re.ASCII)
_POINT = re.compile(r"[-+]?\d*\.\d+(?:[eE][-+]?\d+)?", re.ASCII)
_WHOLE = re.compile(r"[-+]?\d+\.?(?:[eE][-+]?\d+)?", re.ASCII)
_ROWS = 40
"""Number of rows in which the header is searched."""
_LEAST = 3
"""Smallest number of columns of a table of readings."""
_MARKS = "\t;,| "
"""Delimiters in the order in which they are tried."""
_RULE = re.compile(r"[\s|+:=_-]+")
"""Line that only separates, such as ``|---|---|``."""


_END = "[END]"
"""Last line of a table of Heidenhain (``BEGIN POINTS.PNT MM``, ``NR X Y Z``)."""


class Lines:
    """Iterator over the lines of a table, which counts line numbers.

    Comments, blank lines, lines above the header, rules and repeated headers are excluded.

    Attributes:
        number: number of the current line.
        ended: whether the file ends in a line break, once all lines were read.
    """

    def __init__(self, text: TextIO, titles: int = 0, *, barred: bool = False) -> None:
        """Create an iterator.

        Args:
            text: open file.
            titles: number of lines above the header, see :attr:`TableText.titles`.
            barred: whether cells are separated by bars, which may also stand at both ends of a line.
        """
        self._text, self._titles, self._barred = text, titles, barred
        self._header = ""
        self.number = 0
        self.ended = True

    def __iter__(self) -> Iterator[str]:
        line = "\n"
        for self.number, line in enumerate(self._text, start=1):  # noqa: B020
            # small letters come after '#' and '[': such lines need no second look
            if line[0] > "[" or ((bare := line.strip()) and bare[0] != "#" and bare != _END):
                if self._titles or (self.number == 1 and _SEPARATOR.fullmatch(line)):
                    self._titles = max(self._titles - 1, 0)
                    continue
                if line == self._header or (line[0] in " \t|+-=_" and _RULE.fullmatch(line)):
                    continue
                self._header = self._header or line
                yield self._without_bars(line) if self._barred else line
        self.ended = line.endswith(("\n", "\r"))

    def _without_bars(self, line: str) -> str:
        """Return a line without bars at both ends; a last cell that its bar does not close is incomplete."""
        closed = self._header.rstrip().endswith("|") <= line.rstrip().endswith("|")
        return "|".join(_cells(line, "|")[: None if closed else -1])


@dataclass(frozen=True, slots=True)
class TableText:
    """Text format of a table.

    Attributes:
        encoding: encoding for ``open``.
        delimiter: character between cells.
        decimal_comma: whether numbers have a decimal comma.
        titles: number of lines above the header, without blank lines and comments.
        converted: table that the file's other format was converted to; None where the file is the table.
        unit: length unit that a comment or title states; None if there is none.
        over: line above the header, which may name groups of its columns; empty if there is none.
    """

    encoding: str = "utf-8-sig"
    delimiter: str = ","
    decimal_comma: bool = False
    titles: int = 0
    converted: str | None = None
    unit: str | None = None
    over: str = ""

    def open(self, path: Path) -> TextIO:
        """Open a file in this format.

        Args:
            path: file to open.
        """
        return path.open(encoding=self.encoding, newline="") if self.converted is None else StringIO(self.converted)

    def lines(self, text: TextIO) -> Lines:
        """Return an iterator over the lines of the table.

        Args:
            text: open file.
        """
        return Lines(text, self.titles, barred=self.delimiter == "|")

    def with_groups(self, header: list[str]) -> list[str]:
        """Return the header with the names of groups above it, where its own names repeat: ``Nominal X``, ``Actual X``.

        Args:
            header: cells of the header.
        """
        names = [name for name in header if name.strip()]
        over = _cells(self.over, self.delimiter) if self.over and len(set(names)) < len(names) else []
        if len(over) < 2 or len(over) > len(header):
            return header
        group, out = "", list[str]()
        for k, name in enumerate(header):
            group = over[k] if k < len(over) and over[k] else group
            out.append(f"{group} {name}".strip())
        return out

    def place(self, path: Path, number: int) -> str:
        """Return the place of a line for messages.

        Args:
            path: the file.
            number: line of the table, counted from 1.
        """
        return f"{path}, line {number}" if self.converted is None else f"{path}, object {number - 1}"

    def note(self) -> str:
        """Return a sentence on an unusual encoding or decimal commas; empty if there are none."""
        odd = ["as Windows-1252, for it is no UTF-8"] if self.encoding == "cp1252" else []
        odd += ["with decimal commas"] if self.decimal_comma else []
        titles = f"{self.titles} title line{'s' * (self.titles > 1)} above the header excluded." if self.titles else ""
        how = f"The table is read {' and '.join(odd)}." if odd else ""
        return f"{titles} {how}".strip()


def sniff(start: bytes, *, whole: bool) -> TableText | None:
    """Return the text format of a table from its start; None for a binary file.

    Args:
        start: first bytes of the file.
        whole: whether these are all bytes of the file.
    """
    encoding = encoding_of(start, whole=whole)
    if encoding is None:
        return None
    text = start.decode(encoding, errors="replace")
    lines = [
        line
        for line in text.splitlines()[:_ROWS]
        if line.strip() and not line.lstrip("\ufeff \t").startswith("#") and not _RULE.fullmatch(line)
    ]
    stated = _SEPARATOR.fullmatch(lines[0].lstrip("\ufeff")) if lines else None
    marks = stated[1] if stated and stated[1] in ",;\t" else _MARKS
    rows = lines[1:] if stated else lines
    titles, delimiter = find_header(rows, marks) or (0, marks if stated else _delimiter(rows[0] if rows else ""))
    encoding = "utf-8-sig" if encoding == "utf-8" else encoding
    commas = delimiter != "," and _has_decimal_commas(rows[titles + 1 :], delimiter)
    beside = [line for line in text.splitlines()[:_ROWS] if line.lstrip("\ufeff \t").startswith("#")]
    return TableText(
        encoding, delimiter, commas, titles + (stated is not None and titles > 0),
        unit=stated_unit([*beside, *rows[:titles]]), over=rows[titles - 1] if titles else "",
    )  # fmt: skip


def find_header(rows: list[str], marks: str) -> tuple[int, str] | None:
    """Return the index of the header and the delimiter.

    The header is the first row of :data:`_LEAST` names or more, without a number, above a row of as many cells with
    three numbers; a row of units may stand between them.

    Args:
        rows: first rows of the table.
        marks: delimiters to try.
    """
    for k, row in enumerate(rows[:-1]):
        for mark in marks:
            cells = _cells(row, mark)
            if len(cells) < _LEAST or any(map(_is_number, cells)):
                continue
            below = (_cells(other, mark) for other in rows[k + 1 : k + 3])
            if any(len(b) == len(cells) and sum(map(_is_number, b)) >= _LEAST for b in below):
                return k, mark
    return None


def _cells(row: str, mark: str) -> list[str]:
    """Return the cells of a row without empty ones at its end, and without bars at both ends."""
    row = row.strip().strip("|") if mark == "|" else row
    cells = [cell.strip().strip('"') for cell in next(csv.reader([row], delimiter=mark, skipinitialspace=mark == " "))]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _is_number(cell: str) -> bool:
    return bool(_COMMA.fullmatch(cell) or _POINT.fullmatch(cell) or _WHOLE.fullmatch(cell))


def _delimiter(header: str) -> str:
    outside = re.sub(r'"[^"]*"', "", header)
    found = next((mark for mark in ("\t", ";", ",") if mark in outside), None)
    if found is None:
        return "|" if outside.count("|") >= _LEAST - 1 else " " if len(outside.split()) > 2 else ","
    return found


def _has_decimal_commas(rows: list[str], delimiter: str) -> bool:
    cells = [cell.strip().strip('"') for row in rows for cell in row.split(delimiter)]
    return any(_COMMA.fullmatch(c) for c in cells) and not any(_POINT.fullmatch(c) for c in cells)


HEAD_BYTES = 4 * HEAD
"""Number of leading bytes that :func:`sniff` needs."""
