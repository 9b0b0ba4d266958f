"""Read ranges of a single beam in the output formats of drivers' example programs, one reading on each line.

ST's VL53L4CD example prints ``Status = 0, Distance = 312 mm, Signal = 20 kcps/spad``, Pololu's VL53L1X example
``range: 312 status: range valid``, SparkFun's ``Distance(mm): 312`` with or without ``Range Status: Good``, Adafruit's
VL53L0X example ``Reading a measurement... Distance (mm): 312`` or ``out of range``, Pololu's VL53L0X example and the
text mode of a TeraRanger one number. Status 0, Good and range valid are valid (UM2931); 4, out of bounds and out of
range mean that nothing was in range; all others are unreliable.
"""

from __future__ import annotations

import re

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, counted

_LABELLED = re.compile(
    r"(?:\brange|\bdistance)\s*(?:\((?P<in>mm|cm)\)|_?(?P<of>mm|cm)\b)?\s*[:=]\s*(?P<value>-?\d{1,10}(?:\.\d{1,6})?)\s*"
    r"(?P<unit>mm|cm|m\b)?",
    re.IGNORECASE,
)
_STATUS = re.compile(r"status\s*[:=]\s*(\d{1,3}|[a-z][a-z ,-]*)", re.IGNORECASE)
_BARE = re.compile(r"(?P<value>-?\d{1,10})\s*(?P<unit>mm)?(?P<late>\s*TIMEOUT)?(?:\s*mm)?", re.IGNORECASE)
_OUT = re.compile(r"\bout of range\b|\bout of bounds\b", re.IGNORECASE)
_VALID = "0", "good", "range valid", "valid", "ok"
_NOTHING = "4", "out of bounds fail", "out of bounds", "out of range"
_MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1e3}
_LINES = 3
"""Number of lines with one number each from which a file is a log of ranges."""


def recognise(contents: Contents) -> bool:
    """Return whether the file contains lines of one of the example programs, or nothing but one number on each line.

    Args:
        contents: file to test.
    """
    lines = [line.strip() for line in contents.head.splitlines() if line.strip()]
    if any("," in line and _LABELLED.search(line) is None for line in lines[:1]):
        return False
    labelled = [line for line in lines if _LABELLED.search(line) and "Zone" not in line]
    if labelled:
        return 2 * len(labelled) + 2 * sum(_OUT.search(line) is not None for line in lines) >= len(lines) - 3
    return len(lines) >= _LINES and all(_BARE.fullmatch(line) for line in lines[:-1])


def read(contents: Contents) -> Log:
    """Return the ranges of all lines.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: no line has a valid range.
    """
    ranges, free, lost = list[float](), list[bool](), 0
    bare = not any(_LABELLED.search(line) for line in contents.lines)
    for line in contents.lines:
        found = _BARE.fullmatch(line) if bare else _LABELLED.search(line)
        status = _STATUS.search(line)
        word = "" if status is None else status[1].strip().lower()
        nothing = word in _NOTHING or (found is None and _OUT.search(line) is not None)
        if nothing:
            ranges.append(float("nan"))
            free.append(True)
        elif found is not None and ((word and word not in _VALID) or (bare and found["late"])):
            lost += 1
        elif found is not None:
            groups = found.groupdict()
            unit = (groups.get("in") or groups.get("of") or groups["unit"] or "mm").lower()
            ranges.append(float(found["value"]) * _MILLIMETRES[unit])
            free.append(False)
    if not ranges:
        contents.fail("at least one valid range", f"{lost} unreliable ones", "Check the status codes.")
    notes = []
    if lost or any(free):
        notes.append(
            f"{counted(len(ranges) + lost, 'range')}: {len(ranges) - sum(free)} with a target, {sum(free)} without, "
            f"{lost} unreliable and excluded."
        )
    return Log(unit="mm", ranges=np.array(ranges), free=np.array(free), notes=tuple(notes))
