"""Read positions of KUKA data lists (``.dat``) and programs (``.src``).

``{X 1,Y 2,Z 3,A 0,B 90,C 0}``, mm and degrees.
"""

from __future__ import annotations

import re

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import EndMark
from tanteo.io.logs.log import Log, counted, unique

ENDS = (
    EndMark(r"^[ \t]*DEFDAT\b", r"^[ \t]*ENDDAT\b", "ENDDAT"),
    EndMark(r"^[ \t]*(?:GLOBAL[ \t]+)?DEF[ \t]", r"^[ \t]*END[ \t]*(?:;.*)?$", "END"),
)
"""Statements that end a file."""

_MARK = re.compile(r"^[ \t]*(?:DEFDAT|DEF|&ACCESS)\b|\bDECL\s+(?:GLOBAL\s+)?(?:E6POS|POS|FRAME|E6AXIS)\b|\{\s*X\s+-?\d",
                   re.MULTILINE | re.IGNORECASE)  # fmt: skip
_FRAME = re.compile(
    r"(?:(\w+)(?:\[\d+\])?\s*=\s*|(\b(?:PTP|LIN|CIRC|SPTP|SLIN)(?:_REL)?)\s*)?\{([^{}\n]{0,1000})\}", re.IGNORECASE
)
_FIELD = re.compile(r"\b([A-Z]+\d*)\s+([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)", re.IGNORECASE)
_BASE = re.compile(r"\bBASE_NO\s+(\d+)", re.IGNORECASE)
_FIELDS = "XYZABC"


def recognise(contents: Contents) -> bool:
    """Return whether the file contains a declaration or a position of a KUKA program.

    Args:
        contents: file to test.
    """
    return "{" in contents.head and _MARK.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Return the Cartesian positions; a note counts home positions, axis positions and relative motions.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is no Cartesian position, or positions use several bases.
    """
    rows = []
    lines = []
    names = []
    bases = set()
    left = 0
    for k, line in enumerate(contents.lines, start=1):
        if line.startswith(";"):
            continue
        bases.update(_BASE.findall(line))
        for name, motion, body in _FRAME.findall(line):
            fields = {key.upper(): value for key, value in _FIELD.findall(body)}
            is_place = set("XYZ") <= fields.keys()
            if not is_place and "A1" not in fields:
                continue  # some other structure
            if not set(_FIELDS) <= fields.keys() or motion.upper().endswith("_REL") or "HOME" in name.upper():
                left += 1
                continue
            rows.append([fields[key] for key in _FIELDS])
            lines.append(k)
            names.append(name.upper().removeprefix("X") or str(k) if name else str(k))
    if not rows:
        got = f"{counted(left, 'other')}" if left else "none"
        contents.fail("Cartesian positions ({X .., Y .., Z .., A .., B .., C ..})", got, "Is it the .dat file?")
    if len(bases) > 1:
        contents.fail("positions in one base", f"BASE_NO {', '.join(sorted(bases))}", "Store all of them in one base.")
    note = f"{counted(left, 'position')} in axes, relative or of home excluded."
    poses = contents.numbers(rows, lines, "a position")
    return Log(brand="kuka", poses=poses, unit="mm", centres=True, ids=unique(names), notes=(note,) if left else ())
