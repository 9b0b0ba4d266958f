"""The lines of a text file that count."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TextIO


class Lines:
    """The lines of a file without comments and blank ones; knows the number of the last."""

    def __init__(self, text: TextIO) -> None:
        self._text = text
        self.number = 0

    def __iter__(self) -> Iterator[str]:
        for self.number, line in enumerate(self._text, start=1):  # noqa: B020
            # letters, digits and signs come after '#': most lines need no second look
            if line[0] > "#" or ((bare := line.lstrip()) and bare[0] != "#"):
                yield line
