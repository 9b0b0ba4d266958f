"""Read ranges of a single beam in the output formats of drivers' example programs, one reading on each line.

ST's VL53L4CD example prints ``Status = 0, Distance = 312 mm, Signal = 20 kcps/spad``, Pololu's VL53L1X example
``range: 312 status: range valid``, SparkFun's ``Distance(mm): 312`` with or without ``Range Status: Good``, Adafruit's
VL53L0X example ``Reading a measurement... Distance (mm): 312`` or ``out of range``, Pololu's VL53L0X example and the
text mode of a TeraRanger one number, examples of ultrasonic sensors ``Ping: 31cm``, ``31.2 cm`` or ``12in, 31cm``,
those of Benewake's TFmini ``Dist:31 Flux:2343`` in centimetres. Status 0, Good and range valid are valid (UM2931); 4,
out of bounds and out of range mean that nothing was in range; all others are unreliable.
"""

from __future__ import annotations

import re

import numpy as np

from tanteo.io.logs.contents import Contents, without_stamps
from tanteo.io.logs.log import Log, counted

_LABELLED = re.compile(
    r"(?:\brange|\bdistance|\bdist\b\.?|\bping|\bD)\s*(?:\((?P<in>mm|cm|m)\)|_?(?P<of>mm|cm)\b)?\s*[:=]\s*"
    r"(?P<value>-?\d{1,10}(?:\.\d{1,20})?)\s*(?P<unit>mm|cm|m\b)?",
    re.IGNORECASE,
)
_STATUS = re.compile(r"status\s*[:=]\s*(\d{1,3}|[a-z][a-z ,-]*)", re.IGNORECASE)
_IMPERIAL = r"-?\d{1,10}(?:\.\d{1,20})?\s*(?:in|inch|inches|ft)"
_BARE = re.compile(
    rf"(?:{_IMPERIAL}\s*,?\s*)?(?P<value>-?\d{{1,10}}(?:\.\d{{1,20}})?)\s*(?P<unit>mm|cm|m)?(?P<late>\s*TIMEOUT)?"
    rf"(?:\s*mm)?(?:\s*,?\s*{_IMPERIAL})?",
    re.IGNORECASE,
)
_CENTIMETRES = re.compile(r"\b(?:flux|strength|amp)\b", re.IGNORECASE)
"""Words of Benewake's devices, which report centimetres unless a unit is written."""
_WHOLE = re.compile(r"-?\d{1,10}\s*(?:mm)?(?:\s*TIMEOUT)?(?:\s*mm)?", re.IGNORECASE)
_OUT = re.compile(r"\bout of range\b|\bout of bounds\b", re.IGNORECASE)
VALID = "0", "good", "range valid", "valid", "ok"
NOTHING = "4", "out of bounds fail", "out of bounds", "out of range"
"""Statuses of a valid range, and of a beam that met nothing, as codes and as text."""
_MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1e3}
_LINES = 3
"""Number of lines with one number each from which a file is a log of ranges."""


def recognise(contents: Contents) -> bool:
    """Return whether the file contains lines of one of the example programs, or nothing but one number on each line.

    Args:
        contents: file to test.
    """
    lines = [line.strip() for line in without_stamps(contents.head).splitlines() if line.strip()]
    if any("," in line and _LABELLED.search(line) is None and not _with_unit(line) for line in lines[:1]):
        return False
    labelled = [line for line in lines if _LABELLED.search(line) and "Zone" not in line]
    if labelled:
        return 2 * len(labelled) + 2 * sum(_OUT.search(line) is not None for line in lines) >= len(lines) - 3
    if sum(map(_with_unit, lines)) >= max(_LINES, len(lines) - 3):
        return True
    return len(lines) >= _LINES and all(_WHOLE.fullmatch(line) for line in lines[:-1])


def _with_unit(line: str) -> bool:
    """Return whether a line is one distance with its unit."""
    found = _BARE.fullmatch(line)
    return found is not None and found["unit"] is not None


def _begins(word: str, known: tuple[str, ...]) -> bool:
    """Return whether a status is a known one; words may follow a text, as on a line of several fields."""
    return word in known or any(not one.isdigit() and word.startswith(f"{one} ") for one in known)


def read(contents: Contents) -> Log:
    """Return the ranges of all lines.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: no line has a valid range.
    """
    ranges, free, lost, assumed = list[float](), list[bool](), 0, False
    lines = [line.strip() for line in without_stamps(contents.text).splitlines()]
    bare = not any(_LABELLED.search(line) for line in lines)
    with_units = bare and any(map(_with_unit, lines))
    for line in lines:
        found = _BARE.fullmatch(line) if bare else _LABELLED.search(line)
        if found is not None and with_units and not found["unit"]:
            found = None
        status = _STATUS.search(line)
        word = "" if status is None else " ".join(status[1].lower().split())
        nothing = _begins(word, NOTHING) or (found is None and _OUT.search(line) is not None)
        if nothing:
            ranges.append(float("nan"))
            free.append(True)
        elif found is not None and ((word and not _begins(word, VALID)) or (bare and found["late"])):
            lost += 1
        elif found is not None:
            groups = found.groupdict()
            unit = groups.get("in") or groups.get("of") or groups["unit"]
            if not unit and _CENTIMETRES.search(line):
                unit, assumed = "cm", True
            ranges.append(float(found["value"]) * _MILLIMETRES[(unit or "mm").lower()])
            free.append(False)
    if not ranges:
        contents.fail("at least one valid range", f"{lost} unreliable ones", "Check the status codes.")
    notes = ["The distances are taken as centimetres, as Benewake's devices report them."] if assumed else []
    if lost or any(free):
        notes.append(
            f"{counted(len(ranges) + lost, 'range')}: {len(ranges) - sum(free)} with a target, {sum(free)} without, "
            f"{lost} unreliable and excluded."
        )
    return Log(unit="mm", ranges=np.array(ranges), free=np.array(free), notes=tuple(notes))
