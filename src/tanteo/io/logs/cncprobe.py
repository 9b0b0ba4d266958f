"""Read probe logs of LinuxCNC.

``(PROBEOPEN file)`` writes one row of coordinates for each probe move that made contact.

A row has nine numbers, X Y Z A B C U V W, in the work frame and in the program's unit, which the log does not state
(LinuxCNC, G-code overview, "Probe Logging"). Machines with fewer axes write fewer numbers. The position is that of the
controlled point, which is the centre of a touch probe's ball.
"""

from __future__ import annotations

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log
from tanteo.io.logs.numbers import all_rows, are_unit, first_rows

_AXES = "XYZABCUVW"
_STILL = 1e-6
"""Largest difference of an axis position that counts as standing still [program units]."""


def recognise(contents: Contents) -> bool:
    """Return whether rows have four to nine numbers and the numbers after Z are not unit vectors.

    Args:
        contents: file to test.
    """
    rows = first_rows(contents)
    if rows is None or rows.names or rows.labels or rows.others or not 4 <= rows.values.shape[1] <= 9:
        return False
    rest = rows.values[:, 3:]
    if not np.ptp(rest, axis=0).any() and not rest[0].any():
        return True
    return rest.shape[1] == 6 and not are_unit(rest[:, 3:])


def read(contents: Contents) -> Log:
    """Return the probed points; the rotary and auxiliary axes must stand still.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file is malformed, or an axis other than X, Y, Z moved.
    """
    rows = all_rows(contents, "a probe log")
    count = rows.values.shape[1]
    if not 3 <= count <= 9:
        contents.fail("three to nine coordinates a row (X Y Z A B C U V W)", str(count), "Is it a probe log?")
    notes = []
    for k, axis in enumerate(_AXES[3:count], start=3):
        values = rows.values[:, k]
        if np.ptp(values) > _STILL:
            contents.fail(
                f"axis {axis} to stand still", f"{values.min():g} to {values.max():g}",
                "Points of one position of the rotary and auxiliary axes go together: split the log.",
            )  # fmt: skip
        if abs(values[0]) > _STILL:
            notes.append(f"Axis {axis} was at {values[0]:g} in all rows; the points are those of this position.")
    return Log(points=rows.values[:, :3], centres=True, moves=True, notes=tuple(notes))
