"""Probe logs of LinuxCNC: ``(PROBEOPEN file)`` writes one row of coordinates for each probe that met something.

Nine numbers a row, X Y Z A B C U V W in the work frame and in the program's unit, of which the log does not tell
(LinuxCNC, G-code overview, "Probe Logging"); machines with fewer axes write fewer. The point is where the controlled
point was, the centre of the ball of a touch probe.
"""

from __future__ import annotations

import numpy as np

from tanteo.logs.contents import Contents
from tanteo.logs.log import Log
from tanteo.logs.numbers import all_rows, are_unit, first_rows

_AXES = "XYZABCUVW"
_STILL = 1e-6
"""Axes that differ by less have not moved."""


def recognise(contents: Contents) -> bool:
    """Four to nine numbers a row, of which those behind Z do not look like vectors."""
    rows = first_rows(contents)
    if rows is None or rows.names or not 4 <= rows.values.shape[1] <= 9:
        return False
    rest = rows.values[:, 3:]
    if not np.ptp(rest, axis=0).any() and not rest[0].any():
        return True
    return rest.shape[1] == 6 and not are_unit(rest[:, 3:])


def read(contents: Contents) -> Log:
    """The points, if the other axes stood still."""
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
    return Log(points=rows.values[:, :3], centres=True, notes=tuple(notes))
