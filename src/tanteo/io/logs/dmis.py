"""Read DMIS output of coordinate measuring machines (ISO 22093).

Actual points ``FA(name)=FEAT/POINT,CART,x,y,z,i,j,k``.

Actual circles and cylinders, ``FA(name)=FEAT/CIRCLE,INNER,CART,x,y,z,i,j,k,diameter`` (``CYLNDR``; ``OUTER`` for
bosses), are read as centres of holes and bosses; this is the form of the QIF community's converters. Spheres are
``FA(name)=FEAT/SPHERE,OUTER,CART,x,y,z,diameter``. Cones are ignored: no file was found that shows the sense of their
axis, and whether the angle is the half angle. A file without actual features contributes the points of ``PTDATA``, or
else of ``PTMEAS`` and ``F(name)=FEAT/POINT``, which are nominal in a program; a note states which were used. ``$``
continues a line, ``$$`` starts a comment.
"""

from __future__ import annotations

import re

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.ends import EndMark
from tanteo.io.logs.log import Log, counted
from tanteo.io.logs.round_features import Feature, log_of

ENDS = (EndMark(r"^[ \t]*DMISM[ND][ \t]*/", r"^[ \t]*ENDFIL\b", "ENDFIL"),)
"""Statements that end a file."""

_UNITS = {"MM": ("mm", 1.0), "CM": ("mm", 10.0), "M": ("m", 1.0), "INCH": ("in", 1.0), "FEET": ("in", 12.0)}
"""Unit and number of units by the word of DMIS."""
_ROUND = {"CIRCLE": "circle", "CYLNDR": "cylinder", "SPHERE": "sphere"}
_SIDES = {"INNER": "hole", "OUTER": "boss"}
_FEATURE = re.compile(r"^(FA?)\(([^()]{1,80})\)\s*=\s*FEAT\s*/\s*(\w+)\s*,(.{0,500})", re.IGNORECASE)
_POINT = re.compile(r"^(PTMEAS|PTDATA)\s*/\s*CART\s*,(.{0,500})", re.IGNORECASE)
_MARK = re.compile(
    r"^[ \t]*(?:DMISMN\s*/|DMISMD\s*/|FILNAM\s*/|FA?\([^()\n]{1,80}\)\s*=\s*FEAT\s*/|PTMEAS\s*/|PTDATA\s*/)",
    re.MULTILINE | re.IGNORECASE,
)
_CALLED = {
    "FA": "",
    "PTDATA": "Points of PTDATA are taken: the file has no actual points (FA).",
    "PTMEAS": "Points of PTMEAS are taken as measured: there are no actual ones (FA). In a program they are nominal.",
    "F": "Nominal points F(...) are taken as measured: the file has no actual ones, FA(...).",
}


def recognise(contents: Contents) -> bool:
    """Return whether the file contains a statement that only DMIS has.

    Args:
        contents: file to test.
    """
    return _MARK.search(contents.head) is not None


def read(contents: Contents) -> Log:
    """Return the actual points and round features, or else the points of the best available statement.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: the file has no measured points, or is malformed.
    """
    rows: dict[str, list[Feature]] = {name: [] for name in _CALLED}
    stated = ""
    others = 0
    for k, line in _statements(contents):
        if line.upper().startswith("UNITS/"):
            stated = line[6:].split(",")[0].strip().upper()
        elif match := _FEATURE.match(line):
            kind = match[1].upper()
            name = match[2]
            shape = match[3].upper()
            rest = [cell.upper() for cell in _cells(match[4])]
            if shape == "POINT" and rest[:1] == ["CART"]:
                rows[kind].append(Feature(k, name, None, "", rest[1:4], rest[4:7]))
            elif kind == "FA" and (one := _round(k, name, shape, rest)):
                rows[kind].append(one)
            else:
                others += kind == "FA" and shape != "POINT"
        elif match := _POINT.match(line):
            cells = _cells(match[2])
            rows[match[1].upper()].append(Feature(k, "", None, "", cells[:3], cells[3:6]))
    taken = next((name for name in _CALLED if rows[name]), None)
    if taken is None:
        left = f"{counted(others, 'feature')} of other kinds" if others else "none"
        contents.fail("measured points (FA(...)=FEAT/POINT, PTDATA or PTMEAS)", left, "Output the points as well.")
    notes = [_CALLED[taken]] if _CALLED[taken] else []
    if others:
        notes.append(f"{counted(others, 'feature')} of other kinds than POINT, CIRCLE, CYLNDR and SPHERE excluded.")
    unit, scale = _UNITS.get(stated, (None, 1.0))
    return log_of(contents, rows[taken], unit, notes, scale)


def _round(k: int, name: str, shape: str, rest: list[str]) -> Feature | None:
    """Return a round feature; None for other features."""
    if shape not in _ROUND or rest[0] not in _SIDES or rest[1:2] != ["CART"]:
        return None
    axis = ["0"] * 3 if shape == "SPHERE" else rest[5:8]
    diameter = rest[5:6] if shape == "SPHERE" else rest[8:9]
    return Feature(k, name, _ROUND[shape], _SIDES[rest[0]], rest[2:5], axis, diameter[0]) if diameter else None


def _statements(contents: Contents) -> list[tuple[int, str]]:
    """Return the statements with the lines where they start."""
    out: list[tuple[int, str]] = []
    begun = ""
    first = 0
    for k, line in enumerate(contents.lines, start=1):
        if line.startswith("$$"):
            continue
        line = line.split("$$")[0].rstrip()
        first = first if begun else k
        if line.endswith("$"):
            begun += line[:-1]
            continue
        if begun or line:
            out.append((first, begun + line))
        begun = ""
    return out + ([(first, begun)] if begun else [])


def _cells(text: str) -> list[str]:
    return [cell.strip() for cell in text.split(",")]
