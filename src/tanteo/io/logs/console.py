"""Read console logs of GRBL and FluidNC: ``[PRB:x,y,z:1]`` after each probe move, ``:0`` where it made no contact.

GRBL 0.8 and early 0.9 report ``[PRB:x,y,z]`` after contacts only. Coordinates are machine coordinates in millimetres,
or in inches if ``$13=1`` (GRBL wiki, "Interface": probe parameters).
"""

from __future__ import annotations

import re

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, counted

_REPORT = re.compile(r"\[PRB:([^\]:\n]{0,200})(?::([01]))?\]")
_INCHES = re.compile(r"^[ \t>]*\$(?:13|Report/Inches)=(\w+)", re.MULTILINE)

_AS_MILLIMETRES = "Coordinates are taken as millimetres, which GRBL reports unless $13=1. For inches use --units in."


def recognise(contents: Contents) -> bool:
    """Return whether the file contains a probe report; sessions may start with long listings.

    Args:
        contents: file to test.
    """
    if "[PRB:" in contents.head:
        return True
    return contents.encoding is not None and b"[PRB:" in contents.data[:2_000_000]


def read(contents: Contents) -> Log:
    """Return the positions of probe moves that made contact; a note counts the others.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is no contact, a report is malformed, or all reports are equal.
    """
    rows = []
    lines = []
    missed = 0
    for k, line in enumerate(contents.lines, start=1):
        for place, contact in _REPORT.findall(line):
            missed += contact == "0"
            if contact != "0":
                rows.append(place.split(",")[:3])
                lines.append(k)
    if not rows:
        contents.fail("at least one probe move with contact ([PRB:...:1])", f"{missed} without", "Probe again.")
    points = contents.numbers(rows, lines, "a probe report")
    if points.shape[1] != 3:
        contents.fail("three coordinates or more of a probe report", str(points.shape[1]), "Correct it.", lines[0])
    stated = list(_INCHES.findall(contents.text))
    inches = bool(stated) and stated[-1].lower() in ("1", "true", "on", "yes")
    notes = []
    if missed:
        notes.append(f"{counted(missed, 'probe')} made no contact ([PRB:...:0]) and was excluded." if missed == 1 else
                     f"{missed} probes made no contact ([PRB:...:0]) and were excluded.")  # fmt: skip
    if len(np.unique(points, axis=0)) == 1 and len(points) > 1:
        contents.fail(
            "probes in different places", f"the same place {len(points)} times", "Is it one report, repeated?"
        )
    return Log(
        points=points, unit="in" if inches else "mm", assumed=not stated, centres=True, moves=True, notes=tuple(notes),
        unit_note="" if stated else _AS_MILLIMETRES,
    )  # fmt: skip
