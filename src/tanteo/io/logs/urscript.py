"""Read poses of URScript, ``p[x, y, z, rx, ry, rz]`` with a rotation vector in radians, optionally named.

Positions are in metres; other programs that write ``p[...]`` in millimetres need ``--units mm``.
"""

from __future__ import annotations

import re

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import EndMark
from tanteo.io.logs.log import Log, unique

ENDS = (EndMark(r"^[ \t]*def[ \t]+\w+[ \t]*\(", r"^[ \t]*end[ \t]*(?:#.*)?$", "end"),)
"""Statements that end a file."""

_POSE = re.compile(r"(?:\b(\w+)\s*[:=]\s*)?\bp\[([^\[\]\n]{5,300})\]")


def recognise(contents: Contents) -> bool:
    """Return whether the file contains a pose with six numbers.

    Args:
        contents: file to test.
    """
    return any(body.count(",") == 5 for _, body in _POSE.findall(contents.head))


def read(contents: Contents) -> Log:
    """Return all poses written as numbers.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: a pose does not have six numbers.
    """
    rows = []
    lines = []
    names = []
    for k, line in enumerate(contents.lines, start=1):
        for name, body in _POSE.findall(line.split("#")[0]):
            rows.append([word.strip() for word in body.split(",")])
            lines.append(k)
            names.append(name or str(k))
    poses = contents.numbers(rows, lines, "a pose p[x, y, z, rx, ry, rz]")
    if poses.shape[1] != 6:
        contents.fail("six numbers of a pose p[...]", str(poses.shape[1]), "Correct it.", lines[0])
    return Log(brand="ur", poses=poses, unit="m", assumed=True, centres=True, ids=unique(names))
