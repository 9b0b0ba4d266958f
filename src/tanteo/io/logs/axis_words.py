"""Read positions written as words, ``X 264.158 Y 137.184 Z -34.492``, on one line or one axis a line.

Programs on controllers write their probe results so: DPRNT of FANUC and Haas (``DPRNT[X#5061[44]Y#5062[44]..]`` writes
a blank for each leading zero; industryarena.com, "Discussion on HAAS DPRNT"), F-PRINT (FN 16) of Heidenhain and
WRITE of Siemens (also ``X1=`` and ``$AA_MW[X]=``), whose texts their author chooses, answers of I++ DME servers, and
exports such as ``P1, X=1.0, Y=2.0, Z=3.0, I=0, J=0, K=1``. A unit behind Z, also ``"``, is that of the position.
A line with G or M codes is a program, not a result, and is not read.
"""

from __future__ import annotations

import re

import numpy as np

from tanteo.io.logs.contents import Contents
from tanteo.io.logs.log import Log, counted, unique
from tanteo.io.logs.table_text import find_header
from tanteo.io.logs.value_words import LENGTH_UNITS, plain

_VALUE = r"([-+]?) *(\d+(?:\.\d*|,\d+)?|\.\d+)(?![\d.]|[eE][-+]?\d)"
_AXIS = r"(?:[ _-]?(?:axis|achse|act(?:ual)?|ist|meas(?:ured)?|pos(?:ition)?|wert|value))?"
_UNIT = r"(?:[ \t]*(mm(?![A-Za-z])|(?:inch|in|um|m)(?=[ \t]*(?:[,;)\]]|[XYZ]\b|$))|[\"″]))?"
_WORD = re.compile(
    rf"(?<![A-Za-z_])([XYZIJK])(?:\d[ \t]*[:=]|\][ \t]*=|{_AXIS}[ \t]*[:=]?)[ \t]*{_VALUE}{_UNIT}(?![ \t]+[-+.]?\d)",
    re.IGNORECASE,
)
_CODE = re.compile(r"(?<![A-Za-z])[GM]\d|\bFMAX\b|^\s*\d+ L [XYZ]|BEGIN PGM", re.IGNORECASE)
_CALL = re.compile(r"(?<![A-Za-z])([XYZ])\(([^()]*)\)|IJK\(([^(),]*),([^(),]*),([^(),]*)\)")
"""Words of I++ DME, ``X(1.5), Y(2), Z(3), IJK(0,0,1)``; only answers (``#``) are measured."""
_COMMAND = re.compile(r"^\d{5} (?![#])")
"""Lines of an I++ DME session that are no data: commands, acknowledgements and errors."""
_POSITION_REPORT = re.compile(r"\bE:\s*[-\d]|\bCount\b")
_NOMINAL = re.compile(r"\b([XYZ])([ \t]*)[-+\d.,]+[ \t]+ACTUAL\b", re.IGNORECASE)
"""A nominal position before the measured one, as Renishaw's Inspection Plus prints: ``POSN X 10. ACTUAL 10.002``."""
_MACRO = re.compile(r"(?:(?:#|\b)506([123])|\bQ11([567]))[ \t]*(?==)")
"""Variables with the position of the touch: ``#5061`` of FANUC, Haas and LinuxCNC, ``Q115`` of Heidenhain (TNC 640
user's manual, "Coordinates after probing")."""
_NAME = re.compile(r"\s*(?![XYZ][-+ ]*[\d.])([A-Za-z][\w.-]{0,40}|\d{1,9})\s*[,;:]?\s+(?=[XYZ])", re.IGNORECASE)
_ROWS = 40
"""Number of lines in which the header of a table is searched: names such as x1 in its cells are no words."""
_ENOUGH = 3
"""Smallest number of complete positions by which the format is recognized."""


def recognise(contents: Contents) -> bool:
    """Return whether the start of the file contains three positions or more as words, and no program codes.

    Args:
        contents: file to test.
    """
    lines = contents.head.splitlines()
    if any(_CODE.search(line) and (_WORD.search(line) or "PGM" in line) for line in lines):
        return False
    if find_header(lines[:_ROWS], "\t;,|"):
        return False
    found, _ = _positions(lines)
    return len(found) >= _ENOUGH


def read(contents: Contents) -> Log:
    """Return all positions with X, Y and Z; a note counts incomplete ones.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is no position.
    """
    found, lost = _positions(contents.lines)
    if not found:
        contents.fail("positions (X .. Y .. Z ..)", "none", "Write X, Y and Z of each touch.")
    most = max(len(words) for _, _, words in found)
    if contents.is_open and found[-1][0] == len(contents.lines) and len(found) > 1 and len(found[-1][2]) < most:
        found, lost = found[:-1], lost + 1
    lines = [k for k, _, _ in found]
    points = contents.numbers([[words[axis] for axis in "XYZ"] for _, _, words in found], lines, "a position")
    if lines[-1] == len(contents.lines):
        contents.check_last([list(words.values())[-1] for _, _, words in found], lines[-1])
    outward = None
    if all(set("IJK") <= words.keys() for _, _, words in found):
        outward = contents.numbers([[words[axis] for axis in "IJK"] for _, _, words in found], lines, "a vector")
        outward[np.linalg.norm(outward, axis=1) < 0.5] = np.nan
        outward = None if np.isnan(outward).all() else outward
    notes = [f"{counted(lost, 'position')} without all of their words excluded."] if lost else []
    names = [name for _, name, _ in found]
    units = [(axis.upper(), plain(unit)) for line in contents.lines for axis, *_, unit in _WORD.findall(line)]
    last = {unit for axis, unit in units if axis == "Z"}  # the last one holds for all words of a position
    same = len(last) == 1 and {unit for _, unit in units} <= {"", *last}
    return Log(
        points=points,
        unit=LENGTH_UNITS.get(last.pop()) if same else None,
        outward=outward,
        ids=unique(names) if all(names) and len(set(names)) > 1 else None,
        notes=tuple(notes),
    )


def _positions(lines: list[str]) -> tuple[list[tuple[int, str, dict[str, str]]], int]:
    """Return line number, name and words of each complete position, and the number of incomplete ones."""
    found: list[tuple[int, str, dict[str, str]]] = []
    words: dict[str, str] = {}
    lost = 0
    for k, line in enumerate(lines, start=1):
        if _POSITION_REPORT.search(line):
            continue
        if _COMMAND.match(line):
            continue
        line = _CALL.sub(lambda m: f"{m[1]}{m[2]}" if m[1] else f"I{m[3]} J{m[4]} K{m[5]}", line)
        line = _MACRO.sub(lambda match: "XYZ"[int(match[1] or int(match[2]) - 4) - 1], line)
        line = _NOMINAL.sub(r"\1\2", line)
        here = [(axis.upper(), sign + number.replace(",", ".")) for axis, sign, number, _ in _WORD.findall(line)]
        for axis, value in here:
            if axis in words:
                lost += not set("XYZ") <= words.keys()
                words = {}
            words[axis] = value
            if set("XYZ") <= words.keys() and axis in "XYZ":
                name = _NAME.match(line)
                found.append((k, name[1] if name else "", words))
        if here and set("XYZ") <= words.keys() and len(lines) > k and not re.match(r"\s*[IJK]\b", lines[k]):
            words = {}
    return found, lost + bool(words and not set("XYZ") <= words.keys())
