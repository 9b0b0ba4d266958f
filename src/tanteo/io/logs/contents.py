"""Hold the bytes of a file, and decode its text in any encoding."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NoReturn

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.geometry.typing import FloatArray

HEAD = 16_384
"""Number of leading bytes that format recognition uses."""

_DIGITS = 18
"""Largest number of digits in a whole number."""

_ROWS = 3
"""Smallest number of rows that show how many decimals a program writes."""
_DECIMALS = re.compile(r"[-+]?\d*(?:[.,](\d*))?", re.ASCII)

_OTHERS = ("cp932", "gb18030", "cp949", "cp1251", "cp1250")
"""Encodings that are tried if a text is no UTF-8; one is chosen if a word for measured values shows it."""
_MEASURED = re.compile(r"実測|測定|实测|测定|测量|측정|실측|изм|факт|naměřen|zmierzon|mért")

_MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


def encoding_of(data: bytes, *, whole: bool = True) -> str | None:
    """Return the encoding of a text: by its byte-order mark, else UTF-8, UTF-16, Windows-1252; None if binary.

    Other encodings are recognized by a word for measured values.

    Args:
        data: bytes of the text.
        whole: whether these are all bytes; otherwise the last character may be incomplete.
    """
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    if b"\0" in data:
        for name, zeros in (("utf-16-le", data[1::2]), ("utf-16-be", data[0::2])):
            if zeros and zeros.count(0) > 0.9 * len(zeros):
                return name
        return None
    try:
        data.decode("utf-8")
    except UnicodeDecodeError as error:
        if whole or error.start < len(data) - 4:
            return next((name for name in _OTHERS if _MEASURED.search(_decoded(data, name))), "cp1252")
    return "utf-8"


def _decoded(data: bytes, encoding: str) -> str:
    """Return the text of bytes in small letters; empty if they are not in the encoding."""
    try:
        return data[: data.rfind(b"\n") + 1 or None].decode(encoding).lower()
    except UnicodeDecodeError:
        return ""


@dataclass(frozen=True)
class Contents:
    """Content of a file.

    Attributes:
        data: bytes of the file.
        name: name of the file for messages.
    """

    data: bytes = field(repr=False)
    name: str = "log"

    @cached_property
    def encoding(self) -> str | None:
        """Encoding of the text; None for a binary file."""
        return encoding_of(self.data)

    @cached_property
    def head(self) -> str:
        """Start of the file as text; empty for a binary file."""
        start = self.data[:HEAD]
        encoding = encoding_of(start, whole=len(start) == len(self.data))
        return "" if encoding is None else start.decode(encoding, errors="replace").lstrip("\ufeff").replace("−", "-")

    @cached_property
    def text(self) -> str:
        """Complete text.

        Raises:
            ReadingsError: the file is binary.
        """
        if self.encoding is None:
            self.fail("text", "a binary file", "Export it as text, or name its format with --format.")
        return self.data.decode(self.encoding, errors="replace").lstrip("\ufeff").replace("−", "-")

    @cached_property
    def lines(self) -> list[str]:
        """Lines without surrounding blanks; index 0 is line 1."""
        return [line.strip() for line in self.text.splitlines()]

    @cached_property
    def is_open(self) -> bool:
        """Whether the last line has no line break, so that it may be cut off."""
        return bool(self.text) and self.text[-1] not in "\r\n"

    def fail(self, expected: str, got: str, advice: str, line: int | None = None) -> NoReturn:
        """Refuse the file.

        Args:
            expected: accepted content, as text.
            got: found content, as text.
            advice: correction to suggest, as a sentence.
            line: line number; None for the file as a whole.

        Raises:
            ReadingsError: always.
        """
        place = self.name if line is None else f"{self.name}, line {line}"
        raise ReadingsError(f"{place}: expected {expected}, got {got}. {advice}")

    def check_last(self, words: Sequence[str], line: int) -> None:
        """Refuse a file without a line break at its end whose last number has lost digits.

        Args:
            words: last word of each of the last rows, in order.
            line: number of the last line.

        Raises:
            ReadingsError: the last number has fewer decimals than those above it.
        """
        if self.is_open and lost_digits(words):
            self.fail(
                "a complete last line", f"a file that breaks off in '{words[-1][-40:]}', with fewer decimals than the "
                "numbers above it",
                "Copy or export it again; if the number is complete, end the line with a line break.", line,
            )  # fmt: skip

    def numbers(self, rows: list[list[str]], lines: list[int], what: str) -> FloatArray:
        """Return rows of words as finite numbers ``(n, k)``.

        Args:
            rows: words of each row; all rows must have the same number.
            lines: line number of each row.
            what: description of a row, for messages.

        Raises:
            ReadingsError: there are no rows, a row has another number of words, or a word is not a finite number; the
                message names the line.
        """
        if not rows:
            self.fail(f"at least one of {what}", "none", "Is this the whole file?")
        for row, line in zip(rows, lines, strict=True):
            if len(row) != len(rows[0]):
                self.fail(f"{len(rows[0])} numbers of {what}", str(len(row)), "Correct the line.", line)
        values = np.full((len(rows), len(rows[0])), np.nan)
        for k, row in enumerate(rows):
            values[k] = [number(word) for word in row]
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            k, i = bad[0]
            self.fail(f"finite numbers of {what}", f"'{rows[k][i][:30]}'", "Correct the line.", lines[k])
        return values


_STAMP = re.compile(
    r"^\s*\[?(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d(?:[.,]\d{1,6})?\]?\s*(?:->|\])?[ \t]*", re.MULTILINE
)


def without_stamps(text: str) -> str:
    """Return the text without the time that a serial monitor writes before each line: ``12:30:01.123 -> ``.

    Args:
        text: lines of a console.
    """
    return _STAMP.sub("", text)


def is_whole(word: str) -> bool:
    """Return whether a word is a whole number of at most 18 ASCII digits.

    Args:
        word: word to test.
    """
    return word.isascii() and word.isdigit() and len(word) <= _DIGITS


def lost_digits(words: Sequence[str]) -> bool:
    """Return whether the last word has fewer decimals than the words before it, which all have the same number.

    Args:
        words: words of one column from consecutive rows; at least three before the last are required.
    """
    matches = [match for word in words if (match := _DECIMALS.fullmatch(word.strip()))]
    counts = [len(match[1] or "") for match in matches]
    return _ROWS < len(counts) == len(words) and min(counts[:-1]) == max(counts[:-1]) > counts[-1]


def number(word: str) -> float:
    """Return the number of a word; NaN if it is none, or not plain, as ``1_000`` or digits of other scripts.

    Args:
        word: word to convert.
    """
    if not word.isascii() or "_" in word:
        return float("nan")
    try:
        return float(word)
    except ValueError:
        return float("nan")
