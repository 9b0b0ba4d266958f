"""Read height maps of RepRapFirmware (``heightmap.csv``): a grid of heights, probed downwards.

The format is that of ``GridDefinition`` and ``HeightMap`` in RepRapFirmware (``src/Movement/BedProbing/Grid.cpp``): a
line with the version, one with the names of the values, one with the limits, spacings and numbers of the grid, then a
row of heights for each step of the second axis. A ``0`` without decimals marks a point that was not probed.
"""

from __future__ import annotations

import re

import numpy as np

from tanteo.io.logs.contents import Contents, is_whole
from tanteo.io.logs.log import AS_MILLIMETRES, Log, counted

_MARK = "RepRapFirmware height map file v"
_ABOVE = 3
_NOT_PROBED = re.compile(r"\s*0\s*")


def recognise(contents: Contents) -> bool:
    """Return whether the first line is that of a height map.

    Args:
        contents: file to test.
    """
    return contents.head.lstrip().startswith(_MARK)


def read(contents: Contents) -> Log:
    """Return the probed points of the grid; a note counts the others.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed, or ends before its grid.
    """
    lines = [line.strip() for line in contents.lines]
    names = [word.strip() for word in (lines[1] if len(lines) > 1 else "").split(",")]
    cells = [word.strip() for word in (lines[2] if len(lines) > 2 else "").split(",")]
    limits = dict(zip(names, cells, strict=False))
    first = [limits.get("min0", limits.get("xmin", "")), limits.get("min1", limits.get("ymin", ""))]
    steps = [limits.get(f"spacing{k}", limits.get(f"{axis}spacing", limits.get("spacing", "")))
             for k, axis in enumerate("xy")]  # fmt: skip
    counts = [limits.get(f"num{k}", limits.get(f"{axis}num", "")) for k, axis in enumerate("xy")]
    axes = [limits.get("axis0", "X").upper(), limits.get("axis1", "Y").upper()]
    if axes != ["X", "Y"] or not all(map(is_whole, counts)):
        contents.fail("a grid along X and Y", f"'{(lines[2:3] or [''])[0][:60]}'", "Is it a whole height map?", 3)
    (x, y), (dx, dy) = contents.numbers([first, steps], [3, 3], "the grid")
    columns, rows = int(counts[0]), int(counts[1])
    heights = [line.split(",") for line in lines[_ABOVE:] if line]
    if len(heights) != rows or any(len(row) != columns for row in heights):
        got = f"{len(heights)} rows of {len(heights[-1]) if heights else 0}"
        contents.fail(f"{rows} rows of {columns} heights", got, "The file may be cut off: copy or export it again.")
    cells = [cell.strip() for row in heights for cell in row]
    contents.check_last([cell for cell in cells[:-1] if not _NOT_PROBED.fullmatch(cell)] + cells[-1:], len(lines))
    probed = np.array([[not _NOT_PROBED.fullmatch(cell) for cell in row] for row in heights])
    z = contents.numbers([[cell.strip() for cell in row] for row in heights],
                         list(range(_ABOVE + 1, _ABOVE + 1 + rows)), "heights")  # fmt: skip
    j, i = np.nonzero(probed)
    if not len(i):
        contents.fail("probed points", "none", "Probe the bed first (G29).")
    points = np.stack([x + dx * i, y + dy * j, z[j, i]], axis=1)
    left = rows * columns - len(i)
    notes = [f"{counted(left, 'point')} of the grid not probed."] if left else []
    down = np.broadcast_to([0.0, 0.0, -1.0], points.shape)
    return Log(points=points, unit="mm", assumed=True, directions=down, notes=tuple(notes), unit_note=AS_MILLIMETRES)
