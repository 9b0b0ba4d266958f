"""The contents of a file: its bytes, and its text in whatever encoding it was written."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NoReturn

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.typing import FloatArray

HEAD = 16_384
"""Bytes that recognition looks at."""

_DIGITS = 18
"""Of the longest whole number."""

_MARKS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


def encoding_of(data: bytes, *, whole: bool = True) -> str | None:
    """The encoding of a text: by its mark, else UTF-8, else UTF-16 without mark, else Windows-1252; None if binary.

    Args:
        data: The bytes.
        whole: They are all; else the last character may be cut.
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
            return "cp1252"
    return "utf-8"


@dataclass(frozen=True)
class Contents:
    """A file that was read.

    Attributes:
        data: Its bytes.
        name: What it is called in messages.
    """

    data: bytes = field(repr=False)
    name: str = "log"

    @cached_property
    def encoding(self) -> str | None:
        """Encoding of its text; None if it is binary."""
        return encoding_of(self.data)

    @cached_property
    def head(self) -> str:
        """The beginning as text; empty if it is binary."""
        start = self.data[:HEAD]
        encoding = encoding_of(start, whole=len(start) == len(self.data))
        return "" if encoding is None else start.decode(encoding, errors="replace").lstrip("\ufeff")

    @cached_property
    def text(self) -> str:
        """All of it as text."""
        if self.encoding is None:
            self.fail("text", "a binary file", "Export it as text, or say its format with --format.")
        return self.data.decode(self.encoding, errors="replace").lstrip("\ufeff")

    @cached_property
    def lines(self) -> list[str]:
        """Its lines without the blanks around them; the first is line 1 at index 0."""
        return [line.strip() for line in self.text.splitlines()]

    def fail(self, expected: str, got: str, advice: str, line: int | None = None) -> NoReturn:
        """Refuse the file.

        Raises:
            ReadingsError: with file, line, what was expected, what was got and what to do.
        """
        place = self.name if line is None else f"{self.name}, line {line}"
        raise ReadingsError(f"{place}: expected {expected}, got {got}. {advice}")

    def numbers(self, rows: list[list[str]], lines: list[int], what: str) -> FloatArray:
        """Rows of words as finite numbers ``(n, k)``.

        Args:
            rows: As many words each.
            lines: Where each row stands.
            what: They are, for messages.

        Raises:
            ReadingsError: A word is no finite number; the message names the line.
        """
        if not rows:
            self.fail(f"at least one of {what}", "none", "Is this the whole file?")
        for row, line in zip(rows, lines, strict=True):
            if len(row) != len(rows[0]):
                self.fail(f"{len(rows[0])} numbers of {what}", str(len(row)), "Correct the line.", line)
        values = np.full((len(rows), len(rows[0])), np.nan)
        for k, row in enumerate(rows):
            values[k] = [_number(word) for word in row]
        bad = np.argwhere(~np.isfinite(values))
        if len(bad):
            k, i = bad[0]
            self.fail(f"finite numbers of {what}", f"'{rows[k][i][:30]}'", "Correct the line.", lines[k])
        return values


def is_whole(word: str) -> bool:
    """Whether it is a whole number in plain digits, and no longer than any count."""
    return word.isascii() and word.isdigit() and len(word) <= _DIGITS


def _number(word: str) -> float:
    """NaN for what is no plain number: ``1_000`` and digits of other scripts, which Python would read, are none."""
    if not word.isascii() or "_" in word:
        return float("nan")
    try:
        return float(word)
    except ValueError:
        return float("nan")
