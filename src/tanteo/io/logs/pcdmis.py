"""Read listings of PC-DMIS's edit window.

A feature of the listing is ``PNT1 =FEAT/CONTACT/VECTOR POINT/DEFAULT,CARTESIAN``, ``THEO/<x,y,z>,<i,j,k>``, then
``ACTL/<x,y,z>,<i,j,k>``, the measured values (docs.hexagonmi.com, PC-DMIS core, "Understanding the General Command
Format", "Creating a ReadPoint from the Probe's Position"); circles, cylinders and spheres have the diameter behind.
Older versions write no angle brackets. A listing without measured features has the hits of others:
``HIT/BASIC,NORMAL,<x,y,z>,<i,j,k>,<x,y,z>,USE THEO=YES``, the nominal point, its vector and the measured point. Points
are those of the surface: the program has compensated the ball.
"""

from __future__ import annotations

import re

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, counted
from tanteo.io.logs.round_features import Feature, log_of

_FEATURE = re.compile(r"^\s*([^\s=]{1,60})\s*=\s*FEAT\s*/\s*([^\n]{1,300})", re.IGNORECASE)
_VALUES = re.compile(r"^\s*(ACTL|THEO)\s*/\s*(.{1,300})", re.IGNORECASE)
_HIT = re.compile(r"^\s*HIT\s*/\s*[A-Z]+\s*,\s*(?:[A-Z]+\s*,)?\s*([-+<\d.].{1,300})", re.IGNORECASE)
_OF_HIT = 9
"""Number of values of a hit: nominal point, vector, measured point."""
_UNITS = re.compile(r"\bUNITS\s*=\s*(MM|IN(?:CH)?)\b", re.IGNORECASE)
_SHAPES = {"POINT": None, "CIRCLE": "circle", "CYLINDER": "cylinder", "SPHERE": "sphere"}
_POLAR = ("POLAR", "POLR")
_SIDES = {"IN": "hole", "OUT": "boss"}


def recognise(contents: Contents) -> bool:
    """Return whether the file has measured values of the listing.

    Args:
        contents: file to test.
    """
    listed = re.search(r"^\s*(?:ACTL|THEO)\s*/", contents.head, re.MULTILINE)
    if listed is not None and "FEAT/" in contents.head.replace(" ", ""):
        return True
    return any(map(_HIT.match, contents.head.splitlines()))


def read(contents: Contents) -> Log:
    """Return the measured points and round features; notes count the others.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is none, or values are malformed.
    """
    lines = contents.lines[:-1] if contents.is_open else contents.lines
    features, left, notes = _of_listing(lines)
    features = features or _of_hits(lines)
    if contents.is_open and lines:
        notes.append("The last line has no line break and is excluded: the file may be cut off.")
    if not features:
        got = f"{counted(left, 'feature')} of other kinds" if left else "none"
        contents.fail("measured points (ACTL/ of a point or circle)", got, "Export the points.")
    if left:
        notes.append(f"{counted(left, 'feature')} of other kinds, in polar coordinates or incomplete excluded.")
    unit = {"mm": "mm", "in": "in", "inch": "in"}.get((_UNITS.findall(contents.text) or [""])[0].lower())
    return log_of(contents, features, unit, notes)


def _of_hits(lines: list[str]) -> list[Feature]:
    """Return the measured points of hits."""
    hits = [(k, match[1]) for k, line in enumerate(lines, start=1) if (match := _HIT.match(line))]
    cells = [(k, [cell for cell in re.split(r"[<>,\s]+", values) if cell]) for k, values in hits]
    found = [(k, words[:_OF_HIT]) for k, words in cells if len(words) >= _OF_HIT]
    return [Feature(k, f"HIT{n}", None, "", one[6:], one[3:6], "") for n, (k, one) in enumerate(found, start=1)]


def _of_listing(lines: list[str]) -> tuple[list[Feature], int, list[str]]:
    features: list[Feature] = []
    left = equal = 0
    name, side, shape, theo = "", "", None, list[str]()
    begun = known = False
    for k, line in enumerate(lines, start=1):
        if match := _FEATURE.match(line):
            left += begun  # the feature before has no measured values
            words = set(re.split(r"[/,\s]+", match[2].upper()))
            found = [shape for word, shape in _SHAPES.items() if word in words]
            begun, known = True, bool(found) and words.isdisjoint(_POLAR)
            shape = found[0] if found else None
            side = next((side for word, side in _SIDES.items() if word in words), "")
            name, theo = match[1], []
        elif match := _VALUES.match(line):
            cells = [cell for cell in re.split(r"[<>,\s]+", match[2]) if cell]
            if match[1].upper() == "THEO":
                theo = cells
            elif begun:
                if known:
                    diameter = cells[6] if shape and len(cells) > 6 else ""
                    features.append(Feature(k, name, shape, side, cells[:3], cells[3:6], diameter))
                    equal += cells == theo
                left += not known
                begun = False
    notes = ["All measured values equal the nominal ones: was the program run?"] if equal == len(features) > 0 else []
    return features, left + begun, notes
