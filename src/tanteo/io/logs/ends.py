"""Detect logs that break off: a format with a start statement must contain the end statement that belongs to it.

A copy that was interrupted, or a full disk, cuts a file at any byte. Its complete rows are still valid, so they are
read and a note states that others may be missing. A number at the cut may have lost digits, so it is refused.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from tanteo.io.logs.contents import Contents

_LONGEST = 2_000
"""Number of characters at the end of a file that are searched for an open bracket."""


@dataclass(frozen=True)
class EndMark:
    """Statement that ends a file of a format.

    Attributes:
        start: pattern of the statement that starts such a file; a file without it may be an excerpt and is not checked.
        end: pattern of the statement that ends it.
        words: end statement, for messages.
    """

    start: str
    end: str
    words: str


def note_on_end(contents: Contents, marks: tuple[EndMark, ...]) -> str:
    """Return a note if a file lacks the end statement of its format or ends in an open bracket; else an empty text.

    Args:
        contents: file, already read without an error.
        marks: end statements of the format.

    Raises:
        ReadingsError: the end statement is missing, and the file ends within a number.
    """
    flags = re.MULTILINE | re.IGNORECASE
    for mark in marks:
        if re.search(mark.start, contents.text, flags) and not re.search(mark.end, contents.text, flags):
            last = len(contents.lines)
            if contents.text[-1:].isalnum() or contents.text[-1:] in ".-+":
                contents.fail(
                    f"{mark.words} at the end", f"a file that breaks off in '{contents.lines[-1][-40:]}'",
                    "Its last number may be incomplete. Copy or export it again.", last,
                )  # fmt: skip
            return f"{mark.words} is missing at the end: the file may be cut off after line {last}."
    last_line = "" if contents.encoding is None else contents.text[-_LONGEST:].rpartition("\n")[2]
    if sum(map(last_line.count, "[{(<")) > sum(map(last_line.count, "]})>")):
        return f"The last line '{last_line.strip()[:40]}' is not complete: the file may be cut off."
    return ""
