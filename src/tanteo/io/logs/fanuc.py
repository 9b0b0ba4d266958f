"""Read positions of FANUC programs (``.LS``, section ``/POS``) and registers (``.VA``).

X Y Z W P R in mm and degrees.
"""

from __future__ import annotations

import re
from bisect import bisect_left

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import EndMark
from tanteo.io.logs.log import Log, counted, unique

ENDS = (EndMark(r"^/PROG\b", r"^/END\b", "/END"),)
"""Statements that end a file."""

_MARK = re.compile(r"^/PROG\b|^/POS\b|^[ \t]*P\[\d+[^\]\n]*\]\s*\{|\bPOSREG\b", re.MULTILINE)
_BLOCK = re.compile(r"P\[\s*(\d+)\s*(?::\s*\"([^\"\n]{0,80})\")?\s*\]\s*\{([^{}]{0,4000})\}")
_REGISTER = re.compile(r"\[\d+,\s*(\d+)\]\s*=\s*'([^'\n]{0,80})'([^\[]{0,2000})")
_FIELD = re.compile(r"\b([XYZWPR])\s*[=:]\s*([-+*.\dEe]+)")
_FRAME = re.compile(r"\bUF\s*:\s*(\w+)")
_FIELDS = "XYZWPR"


def recognise(contents: Contents) -> bool:
    """Return whether the file contains the sections or a position of a FANUC program.

    Args:
        contents: file to test.
    """
    return _MARK.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Return the Cartesian positions; a note counts the others.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is no Cartesian position, or positions use several user frames.
    """
    rows = []
    lines = []
    names = []
    frames = set()
    left = 0
    text = contents.text
    blocks = list(_BLOCK.finditer(text)) or list(_REGISTER.finditer(text))
    ends = [match.start() for match in re.finditer("\n", text)]
    for match in blocks:
        fields = dict(_FIELD.findall(match[3]))
        if not set(_FIELDS) <= fields.keys() or any("*" in value for value in fields.values()):
            left += 1
            continue
        rows.append([fields[name] for name in _FIELDS])
        lines.append(bisect_left(ends, match.start()) + 1)
        names.append(match[2] or match[1])
        frames.update(_FRAME.findall(match[3]))
    if not rows:
        got = f"{counted(left, 'position')} in joints or not taught" if left else "none"
        contents.fail("Cartesian positions (X, Y, Z, W, P, R)", got, "Store the positions in Cartesian representation.")
    if len(frames) > 1:
        contents.fail(
            "positions in one user frame", f"UF {', '.join(sorted(frames))}", "Store all of them in one frame."
        )
    note = f"{counted(left, 'position')} in joints or not taught excluded."
    poses = contents.numbers(rows, lines, "a position")
    return Log(brand="fanuc", poses=poses, unit="mm", centres=True, ids=unique(names), notes=(note,) if left else ())
