"""Read height maps of bCNC (``.probe``): three lines for the grid (from, to, count; feed for z), then rows ``x y z``.

The format is that of ``Probe.save`` in bCNC (github.com/vlachoudis/bCNC, ``CNC.py``). The probe moves straight down.
bCNC's ``.xyz`` file lacks the three lines and is read as a list of points.
"""

from __future__ import annotations

import numpy as np

from tanteo.io.logs.contents import Contents, is_whole, number
from tanteo.io.logs.log import Log, counted

_GRID = 3
_SAME = 1e-3
"""Largest distance of a point outside of the grid's limits, which bCNC writes with fewer digits [file units]."""


def _kept(contents: Contents) -> list[tuple[int, list[str]]]:
    return [(k, line.split()) for k, line in enumerate(contents.lines, start=1) if line]


def _grid(rows: list[list[str]]) -> tuple[int, int] | None:
    """Return the numbers of points along x and y that the first lines state; None if they state none."""
    head = rows[:_GRID]
    if len(head) < _GRID or any(len(row) != 3 for row in head):
        return None
    if not all(is_whole(row[2]) and int(row[2]) > 1 for row in head[:2]):
        return None
    return int(head[0][2]), int(head[1][2])


def recognise(contents: Contents) -> bool:
    """Return whether the file starts with the three grid lines, and continues with a point of the grid.

    The lower limit of each grid line comes first, and the first point must lie within the grid. The number of points is
    not compared here, because an interrupted run has fewer.

    Args:
        contents: file to test.
    """
    if _grid([line.split() for line in contents.head.splitlines()[:10] if line.strip()]) is None:
        return False
    rows = [[number(word) for word in row] for _, row in _kept(contents)[: _GRID + 1]]
    first = rows[_GRID][:2] if len(rows) > _GRID else []
    inside = all(low - _SAME <= x <= high + _SAME for x, (low, high, _) in zip(first, rows, strict=False))
    return inside and all(low < high for low, high, _ in rows[:_GRID])


def read(contents: Contents) -> Log:
    """Return the points of the grid, each probed downwards; a note counts missing ones.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed, or has more points than its grid.
    """
    kept = _kept(contents)
    count = _grid([row for _, row in kept])
    if count is None:
        contents.fail("three lines of the grid (from, to, count)", "others", "Is it a bCNC probe file?", 1)
    rows = kept[_GRID:]
    points = contents.numbers([row for _, row in rows], [k for k, _ in rows], "a point")
    contents.check_last([row[-1] for _, row in rows], rows[-1][0])
    if points.shape[1] != 3:
        contents.fail("x y z of each point", f"{points.shape[1]} numbers", "Is it a bCNC probe file?", rows[0][0])
    missing = count[0] * count[1] - len(points)
    if missing < 0:
        contents.fail(f"{count[0]} x {count[1]} points", str(len(points)), "Correct the lines of the grid.", 1)
    note = f"{counted(missing, 'point')} of the grid of {count[0]} x {count[1]} missing: the run or the copy broke off."
    notes = (note,) if missing else ()
    return Log(points=points, directions=np.broadcast_to([0.0, 0.0, -1.0], points.shape), notes=notes)
