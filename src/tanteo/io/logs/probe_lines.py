"""Read what controllers and printers write after each probe, one report a line.

Each row of :data:`REPORTS` is a program. Sources: TinyG and g2core wiki, "Gcode Probes" (``{"prb":{"e":1,"x":..}}``,
machine coordinates in millimetres, ``e`` is 1 after contact); Klipper, ``klippy/extras/probe.py`` (``probe at X,Y is
z=Z``, where X, Y is the toolhead; later versions ``probe: at X,Y bed will contact at z=Z``, where it is the probe);
Marlin, ``gcode/probe/G30.cpp`` (``Bed X: .. Y: .. Z: ..``).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import AS_MILLIMETRES, Log, counted

_NUMBER = r"([-+]?[\w.+-]{1,40})"
_FIELD = re.compile(r"\"?\b(prb)?([exyz])\"?\s*:\s*\"?([-+\w.]{1,40})")


@dataclass(frozen=True, slots=True)
class Report:
    """Report of a probe in the output of a program.

    Attributes:
        mark: text that recognizes the program.
        pattern: pattern of a report: three groups X, Y, Z, or one group with named fields.
        centres: whether the position is the centre of the tip's ball.
        note: sentence on the position; empty if there is nothing to add.
    """

    mark: str
    pattern: re.Pattern[str]
    centres: bool
    note: str = ""


REPORTS = {
    "tinyg": Report("prb", re.compile(r"\"?prb\"?\s*:\s*\{([^{}]{0,400})\}"), True),
    "klipper": Report(
        "z=", re.compile(rf"\bprobe:? at {_NUMBER},{_NUMBER} (?:is|bed will contact at) z={_NUMBER}"), False,
        "In 'probe at X,Y is z=Z', X and Y are the toolhead's: add the probe's x_offset and y_offset.",
    ),
    "marlin": Report("Bed X:", re.compile(rf"\bBed X:\s*{_NUMBER}\s+Y:\s*{_NUMBER}\s+Z:\s*{_NUMBER}"), False),
}  # fmt: skip
"""Reports by name of the format."""


def recognises(name: str, contents: Contents) -> bool:
    """Return whether the file contains a report of a program.

    Args:
        name: key of :data:`REPORTS`.
        contents: file to test.
    """
    one = REPORTS[name]
    return one.mark in contents.head and one.pattern.search(contents.head) is not None


def read(name: str, contents: Contents) -> Log:
    """Return the positions of all probes with contact; notes count the others and repeated reports.

    Args:
        name: key of :data:`REPORTS`.
        contents: file to read.

    Raises:
        ReadingsError: there is no contact, or a report is malformed.
    """
    one = REPORTS[name]
    rows: list[list[str]] = []
    lines: list[int] = []
    missed = repeated = 0
    for k, line in enumerate(contents.lines, start=1):
        for match in one.pattern.finditer(line):
            row = list(match.groups())
            if len(row) == 1:
                fields = {key: value for _, key, value in _FIELD.findall(row[0])}
                missed += fields.get("e", "1") in ("0", "false")
                if fields.get("e", "1") in ("0", "false"):
                    continue
                if lacking := [axis for axis in "xyz" if axis not in fields]:
                    contents.fail(
                        "x, y and z of a probe report", f"none of {', '.join(lacking)}",
                        'Request all axes with {"prb":n} after each probe.', k,
                    )  # fmt: skip
                row = [fields[axis] for axis in "xyz"]
            if rows[-1:] == [row] and one.centres:
                repeated += 1
                continue
            rows.append(row)
            lines.append(k)
    if not rows:
        contents.fail("at least one probe with contact", f"{missed} without", "Probe again.")
    points = contents.numbers(rows, lines, "a probe report (x, y, z)")
    if lines[-1] == len(contents.lines):
        contents.check_last([row[-1] for row in rows], lines[-1])
    notes = [one.note] if one.note and "is z=" in contents.text else []
    notes += [f"{counted(missed, 'probe')} made no contact and is excluded."] if missed == 1 else []
    notes += [f"{missed} probes made no contact and are excluded."] if missed > 1 else []
    notes += [f"{counted(repeated, 'report')} equal to the one before excluded."] if repeated else []
    down = None if one.centres else np.broadcast_to([0.0, 0.0, -1.0], points.shape)
    return Log(
        points=points, unit="mm", assumed=True, centres=one.centres, moves=one.centres, directions=down,
        notes=tuple(notes), unit_note=AS_MILLIMETRES,
    )  # fmt: skip
