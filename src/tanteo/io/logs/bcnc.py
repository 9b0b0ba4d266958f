"""Read height maps of bCNC (``.probe``): three lines for the grid (from, to, count; feed for z), then rows ``x y z``.

The format is that of ``Probe.save`` in bCNC (github.com/vlachoudis/bCNC, ``CNC.py``). The probe moves straight down.
bCNC's ``.xyz`` file lacks the three lines and is read as a list of points.
"""

from __future__ import annotations

import numpy as np

from tanteo.io.logs.contents import Contents, is_whole
from tanteo.io.logs.log import Log

_GRID = 3


def _kept(contents: Contents) -> list[tuple[int, list[str]]]:
    return [(k, line.split()) for k, line in enumerate(contents.lines, start=1) if line]


def recognise(contents: Contents) -> bool:
    """Return whether the file has three grid lines and as many points as the grid.

    Args:
        contents: file to test.
    """
    head = [line.split() for line in contents.head.splitlines()[:10] if line.strip()][:_GRID]
    if len(head) < _GRID or any(len(row) != 3 for row in head):
        return False
    if not all(is_whole(row[2]) and int(row[2]) > 1 for row in head[:2]):
        return False
    return len(_kept(contents)) == _GRID + int(head[0][2]) * int(head[1][2])


def read(contents: Contents) -> Log:
    """Return the points of the grid, each probed downwards.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed.
    """
    rows = _kept(contents)[_GRID:]
    points = contents.numbers([row for _, row in rows], [k for k, _ in rows], "a point")
    if points.shape[1] != 3:
        contents.fail("x y z of each point", f"{points.shape[1]} numbers", "Is it a bCNC probe file?", rows[0][0])
    return Log(points=points, directions=np.broadcast_to([0.0, 0.0, -1.0], points.shape))
