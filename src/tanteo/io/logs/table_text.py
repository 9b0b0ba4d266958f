"""Detect how a table is written: encoding, delimiter, decimal comma, as spreadsheets save it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from tanteo.io.logs.contents import HEAD, encoding_of

_SEPARATOR = re.compile(r"sep=(.)\s*$", re.IGNORECASE)
_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?", re.ASCII)
_POINT = re.compile(r"[-+]?\d*\.\d+(?:[eE][-+]?\d+)?", re.ASCII)
_ROWS = 40


class Lines:
    """Iterator over lines without comments and blank lines, which counts line numbers."""

    def __init__(self, text: TextIO) -> None:
        self._text = text
        self.number = 0

    def __iter__(self) -> Iterator[str]:
        for self.number, line in enumerate(self._text, start=1):  # noqa: B020
            # letters, digits and signs come after '#': most lines need no second look
            if line[0] > "#" or ((bare := line.lstrip()) and bare[0] != "#"):
                if self.number == 1 and _SEPARATOR.fullmatch(line):
                    continue
                yield line


@dataclass(frozen=True, slots=True)
class TableText:
    """Text format of a table.

    Attributes:
        encoding: encoding for ``open``.
        delimiter: character between cells.
        decimal_comma: whether numbers have a decimal comma.
    """

    encoding: str = "utf-8-sig"
    delimiter: str = ","
    decimal_comma: bool = False

    def open(self, path: Path) -> TextIO:
        """Open a file in this format.

        Args:
            path: file to open.
        """
        return path.open(encoding=self.encoding, newline="")

    def note(self) -> str:
        """Return a sentence on an unusual encoding or decimal commas; empty if there are none."""
        odd = ["as Windows-1252, for it is no UTF-8"] if self.encoding == "cp1252" else []
        odd += ["with decimal commas"] if self.decimal_comma else []
        return f"The table is read {' and '.join(odd)}." if odd else ""


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
        line for line in text.splitlines()[:_ROWS] if line.strip() and not line.lstrip("\ufeff \t").startswith("#")
    ]
    stated = _SEPARATOR.fullmatch(lines[0].lstrip("\ufeff")) if lines else None
    lines = lines[1:] if stated else lines
    delimiter = stated[1] if stated and stated[1] in ",;\t" else _delimiter(lines[0] if lines else "")
    encoding = "utf-8-sig" if encoding == "utf-8" else encoding
    return TableText(encoding, delimiter, delimiter != "," and _has_decimal_commas(lines[1:], delimiter))


def _delimiter(header: str) -> str:
    outside = re.sub(r'"[^"]*"', "", header)
    found = next((mark for mark in ("\t", ";", ",") if mark in outside), None)
    if found is None:
        return " " if len(outside.split()) > 2 and "|" not in outside else ","
    return found


def _has_decimal_commas(rows: list[str], delimiter: str) -> bool:
    cells = [cell.strip().strip('"') for row in rows for cell in row.split(delimiter)]
    return any(_COMMA.fullmatch(c) for c in cells) and not any(_POINT.fullmatch(c) for c in cells)


HEAD_BYTES = 4 * HEAD
"""Number of leading bytes that :func:`sniff` needs."""
