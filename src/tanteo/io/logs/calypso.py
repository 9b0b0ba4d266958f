"""Read tables of characteristics of Zeiss Calypso (``.._chr.txt``): positions as one row for each of x, y, z.

The table has a header ``planid partnb id type idsymbol actual nominal ..``, separated by tabs; ``featureid`` names the
feature, ``idsymbol`` is ``xValue``, ``yValue``, ``zValue`` or ``diameter`` of it, ``unit`` the length unit. The source
is a sample of the table in a public converter ("zeiss converter"). Values are in the base alignment of the plan.
"""

from __future__ import annotations

import csv

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, counted
from tanteo.io.logs.round_features import Feature, log_of

_SYMBOLS = {"xvalue": "x", "yvalue": "y", "zvalue": "z", "diameter": "d"}
_NEEDED = ("idsymbol", "actual", "featureid")
_UNITS = {"mm": "mm", "in": "in", "inch": "in"}


def recognise(contents: Contents) -> bool:
    """Return whether the first line has the columns of the table.

    Args:
        contents: file to test.
    """
    header = contents.head.lstrip().partition("\n")[0].lower().split("\t")
    return set(_NEEDED) <= {cell.strip() for cell in header}


def read(contents: Contents) -> Log:
    """Return the features that have x, y and z, as points or, with a diameter, as circles; a note counts the others.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: no feature has x, y and z, or a value is malformed.
    """
    rows = list(csv.reader(contents.lines, delimiter="\t", quoting=csv.QUOTE_NONE))
    header = [cell.strip().lower() for cell in rows[0]]
    found: dict[str, dict[str, str]] = {}
    lines: dict[str, int] = {}
    units = set()
    others = 0
    for k, row in enumerate(rows[1:], start=2):
        cells = dict(zip(header, row, strict=False))
        axis = _SYMBOLS.get(cells.get("idsymbol", "").strip().lower())
        if axis is None:
            others += bool(cells.get("actual", "").strip())
            continue
        name = cells.get("featureid", "").strip()
        found.setdefault(name, {})[axis] = cells.get("actual", "").strip()
        lines[name] = k
        units.add(cells.get("unit", "").strip().lower())
    features = [
        Feature(lines[name], name, "circle" if "d" in axes else None, "", [axes[a] for a in "xyz"], [],
                axes.get("d", ""))
        for name, axes in found.items() if set("xyz") <= axes.keys()
    ]  # fmt: skip
    left = len(found) - len(features)
    if not features:
        got = f"{counted(left, 'feature')} without all of them" if left else "none"
        contents.fail("xValue, yValue and zValue of a feature", got,
                      "Add these characteristics to the plan, or export the measured points as text.")  # fmt: skip
    notes = ["Positions are in the base alignment of the plan, which Calypso has fitted to the part."]
    notes += [f"{counted(left, 'feature')} without all of x, y and z excluded."] if left else []
    notes += [f"{counted(others, 'characteristic')} of other kinds excluded."] if others else []
    return log_of(contents, features, _UNITS.get(units.pop()) if len(units) == 1 else None, notes)
