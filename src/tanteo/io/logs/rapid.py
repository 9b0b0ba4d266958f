"""Read robtargets of ABB's RAPID.

``p10:=[[x,y,z],[q1,q2,q3,q4],[..],[..]]`` in mm, scalar first, in their work object.
"""

from __future__ import annotations

import re

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import EndMark
from tanteo.io.logs.log import Log, unique

ENDS = (EndMark(r"^[ \t]*MODULE[ \t]", r"^[ \t]*ENDMODULE\b", "ENDMODULE"),)
"""Statements that end a file."""

_MARK = re.compile(
    r"\brobtarget\b|\bMODULE\s+\w+|\[\s*\[[^\[\]\n]{3,100}\]\s*,\s*\[[^\[\]\n]{3,120}\]\s*,\s*\[", re.IGNORECASE
)
_TARGET = re.compile(r"(?:\b(\w+)\s*:=\s*)?\[\s*\[([^\[\]\n]{3,200})\]\s*,\s*\[([^\[\]\n]{3,200})\]\s*,\s*\[")
_WORK = re.compile(r"\\WObj\s*:=\s*(\w+)", re.IGNORECASE)


def recognise(contents: Contents) -> bool:
    """Return whether the file contains a declaration or the brackets of a robtarget.

    Args:
        contents: file to test.
    """
    return "[" in contents.head and ":" in contents.head and _MARK.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Return all robtargets.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is none, or they use several work objects.
    """
    rows = []
    lines = []
    names = []
    frames = set()
    for k, line in enumerate(contents.lines, start=1):
        if line.startswith("!"):
            continue
        frames.update(_WORK.findall(line))
        for name, place, turn in _TARGET.findall(line):
            row = [word.strip() for word in f"{place},{turn}".split(",")]
            if len(row) == 7:
                rows.append(row)
                lines.append(k)
                names.append(name or str(k))
    if not rows:
        contents.fail("robtargets ([[x,y,z],[q1,q2,q3,q4],[..],[..]])", "none", "Export the module that declares them.")
    if len(frames) > 1:
        contents.fail("targets of one work object", ", ".join(sorted(frames)), "Store all of them in one.")
    poses = contents.numbers(rows, lines, "a robtarget")
    return Log(brand="abb", poses=poses, unit="mm", centres=True, ids=unique(names))
