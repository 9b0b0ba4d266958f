"""Read frames of multi-zone ranging sensors in the output formats of their drivers' example programs.

ST's VL53L5CX, VL53L7CX and VL53L8CX print lines ``Zone : 0, Status : 5, Distance : 312 mm`` (ULD examples), cells
``| 312 : 5 |`` (X-NUCLEO and STM32duino examples, last column first), or grids of distances with or without
``(status)`` (SparkFun examples, last column first). Status 5 and 9 are valid, 255 means no target, all others are
unreliable (UM2884).

ams OSRAM's TMF882x print lines ``#Obj,address,number,..`` with alternating distances and confidences of 36 results
(Arduino driver), blocks of ``conf: 255 distance mm: 184 channel: 1 sub_capture: 0`` (SparkFun's examples), or two grids
(Adafruit's example). A zero distance means no target; a confidence below 20 is unreliable. The first 18 results are the
nearest objects. A device of 3 x 3 zones fills only the first nine; with 4 x 4 zones results 9 and 18 are not used, and
a TMF8828 makes 8 x 8 zones of four such captures. The assignment of results to 8 x 8 zones is that of
github.com/shabaz123/TMF8828, whose viewer was compared with the manufacturer's. Where a log fits several grids, the rig
selects one.

A reading is named by row and column of its zone, counted from 1 with zone 0 first: ``tof.1.1``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np

from tanteo.io.logs.contents import Contents, is_whole, without_stamps
from tanteo.io.logs.log import Log, counted

VALID, NO_TARGET = (5, 9), 255
LEAST_CONFIDENCE = 20
FARTHEST = 6_000
"""Largest plausible distance [mm]; no such device has a larger range."""

_ZONE = re.compile(r"\bZone\s*:\s*(\d{1,6})\s*,(.*)", re.IGNORECASE)
_OF_ZONE = {
    "status": re.compile(r"status\s*:\s*(\d{1,6})", re.IGNORECASE),
    "distance": re.compile(r"dist(?:ance|\.)?\s*:\s*(-?\d{1,6})\s*mm", re.IGNORECASE),
    "targets": re.compile(r"targets\s*:\s*(\d{1,3})", re.IGNORECASE),
}
"""Fields of a line of one zone, of which the first counts; the examples of ST print different sets of them."""
_CELL = re.compile(r"\|\s*(-?\d{1,6}|X)\s*:\s*(\d{1,6}|X)(?=\s*(?:\||$))")
_COLOUR = re.compile(r"\x1b\[[\d;]*[A-Za-z]")
_GRID = re.compile(r"\d{1,5}(?:\s*\(\s*\d{1,3}\s*\))?(?:[\s,]+\d{1,5}(?:\s*\(\s*\d{1,3}\s*\))?)*,?")
_WORD = re.compile(r"(\d+)(?:\s*\(\s*(\d+)\s*\))?")
_GRIDS = re.compile(r"^\s*Distance \(mm\):\s*$", re.MULTILINE)
_OBJECT = re.compile(r"^#Obj,\d+,(\d+),", re.MULTILINE)
_RESULT = re.compile(
    r"conf:\s*(\d{1,3})\s+distance[ _]mm:\s*(\d{1,6})\s+channel:\s*(\d{1,2})\s+sub_capture:\s*(\d)", re.IGNORECASE
)
_NEAREST, _UNUSED = 18, (8, 17)
"""Number of results of nearest objects, and those that 4 x 4 zones do not use."""
_NAMED = re.compile(r"[^,;\d|:]*[A-Za-z][^,;|:]*(?:[,;][^,;|:]+){2,}$")
_NUMERIC = re.compile(r"-?[\d.]+(?:[\s,;]+-?[\d.]+){15,}[,;]?")
_NUMBERS = re.compile(r"\s*[,;]\s*|\s+")
_CHECKED, _BEFORE = 20, 2
"""Number of lines that decide whether each is a frame, and largest number of other numbers before its zones."""
_RESULTS = np.array([6, 15, 7, 16, 4, 13, 5, 14, 2, 11, 3, 12, 0, 9, 1, 10])
_CORNERS = {0: 8, 1: 10, 2: 0, 3: 2}
"""First zone of each of the four captures."""


@dataclass(frozen=True, slots=True)
class _Seen:
    """Result of one zone.

    Its number in the frame, distance [mm], whether it hit nothing, whether it is reliable, frame side.
    """

    zone: int
    distance: float
    free: bool
    reliable: bool
    side: int


@dataclass(frozen=True, slots=True)
class _Results:
    """Nearest objects of one capture of a TMF882x.

    Number of the capture, and distances [mm] and confidences of 18 results ``(18, 2)``.
    """

    number: int
    pairs: np.ndarray


def _of_status(zone: int, distance: str, status: str, side: int) -> _Seen:
    free = status == "X" or int(status) == NO_TARGET
    reliable = free or (int(status) in VALID and int(distance) > 0)
    return _Seen(zone, float("nan") if free else float(distance), free, reliable, side)


def _of_line(zone: int, fields: str, side: int) -> _Seen:
    found = {name: None if (m := pattern.search(fields)) is None else m[1] for name, pattern in _OF_ZONE.items()}
    nothing = found["targets"] == "0" or found["distance"] is None
    return _of_status(zone, found["distance"] or "0", str(NO_TARGET) if nothing else found["status"] or "5", side)


def _of_confidence(zone: int, distance: int, confidence: int, side: int) -> _Seen:
    free = distance == 0
    return _Seen(zone, float("nan") if free else float(distance), free, free or confidence >= LEAST_CONFIDENCE, side)


def recognise(contents: Contents) -> bool:
    """Return whether the file contains a line, cell or grid of one of the example programs.

    Args:
        contents: file to test.
    """
    head = without_stamps(_COLOUR.sub("", contents.head))
    if (
        any(_OF_ZONE["distance"].search(m[2]) for m in _ZONE.finditer(head))
        or _OBJECT.search(head)
        or _RESULT.search(head)
        or _GRIDS.search(head)
    ):
        return True
    if "|" in head and len(_CELL.findall(head)) >= 4 and "Status" in head:
        return True
    lines = [line.strip() for line in head.splitlines() if line.strip()]
    if lines and _NAMED.match(lines[0]):  # the header of a table
        return False
    if _side_of_rows(lines[:_CHECKED]):
        return True
    blocks = _blocks(lines)
    whole = [block for block in blocks if len(block) == len(block[0]) and len(block) in (4, 8)]
    return bool(whole) and whole[0] is blocks[0] and (len(whole[0]) == 8 or len(whole) > 1)


def read(contents: Contents) -> Log:
    """Return all zones of all frames.

    Args:
        contents: file to read.

    Raises:
        ReadingsError: there is no complete frame or no reliable zone, or the frames differ in size.
    """
    text = without_stamps(_COLOUR.sub("", contents.text))
    notes: list[str] = []
    if _OBJECT.search(text) or _RESULT.search(text):
        results = _objects(contents, text, notes) if _OBJECT.search(text) else _printed(text)
        logs = [_log(contents, seen, [*notes]) for seen in _grids_of(contents, results)]
        return replace(logs[0], alternatives=tuple(logs[1:]))
    if _GRIDS.search(text):
        seen = _two_grids(contents, text)
    elif _ZONE.search(text):
        side = 8 if max(int(zone) for zone, _ in _ZONE.findall(text)) > 15 else 4
        seen = [_of_line(int(zone), fields, side) for zone, fields in _ZONE.findall(text)]
    elif _CELL.search(text):
        seen = _cells(text)
    elif side := _side_of_rows([line.strip() for line in text.splitlines() if line.strip()][:_CHECKED]):
        seen = _frames(contents, text, side)
        notes.append("The frames have no status codes: all distances above zero are taken as valid.")
    else:
        seen, stated = _grids(text)
        if not stated:
            notes.append("The frames have no status codes: all distances above zero are taken as valid.")
    return _log(contents, seen, notes)


def _log(contents: Contents, seen: list[_Seen], notes: list[str]) -> Log:
    if not seen:
        contents.fail("a whole frame of 8 x 8 or 4 x 4 zones", "none", "Log one frame to its end.")
    if len({one.side for one in seen}) > 1:
        contents.fail("frames of one size", "8 x 8 and 4 x 4", "Split the log.")
    side = seen[0].side
    strange = next((s for s in seen if s.zone >= side * side or s.distance > FARTHEST), None)
    if strange is not None:
        contents.fail(f"zones below {side * side} and distances up to {FARTHEST} mm",
                      f"zone {strange.zone} at {strange.distance:g} mm", "Is it a log of distances?")  # fmt: skip
    kept = [one for one in seen if one.reliable]
    free = sum(one.free for one in kept)
    if free < len(seen):
        notes.append(
            f"{counted(len(seen), 'zone')}: {len(kept) - free} with a target, {free} without, "
            f"{len(seen) - len(kept)} unreliable and excluded."
        )
    if not kept:
        contents.fail("at least one reliable zone", f"{len(seen)} unreliable ones", "Check the status codes.")
    zones = np.array([one.zone for one in kept])
    return Log(
        unit="mm", zones=(side, side), cells=np.stack([zones // side + 1, zones % side + 1], axis=-1),
        ranges=np.array([one.distance for one in kept]), free=np.array([one.free for one in kept]), notes=tuple(notes),
    )  # fmt: skip


def _cells(text: str) -> list[_Seen]:
    """Return zones from rows of cells, last column first; the first line of a row has distance and status."""
    rows: list[list[tuple[str, str]]] = []
    fresh = True
    for line in text.splitlines():
        cells = _CELL.findall(line)
        if cells and fresh:
            rows.append(cells)
        fresh = not cells and (fresh or "---" in line)
    rows = [row for row in rows if len(row) in (4, 8)]
    return [
        _of_status((k % len(row)) * len(row) + len(row) - 1 - i, distance, status, len(row))
        for k, row in enumerate(rows)
        for i, (distance, status) in enumerate(row)
    ]


def _blocks(lines: list[str]) -> list[list[list[tuple[str, str]]]]:
    """Return runs of lines that contain only whole numbers, with or without statuses, of equal count per line."""
    blocks: list[list[list[tuple[str, str]]]] = []
    width = 0
    for line in lines:
        bare = line.strip()
        words = _WORD.findall(bare) if _GRID.fullmatch(bare) else []
        if words and len(words) == width and len(blocks[-1]) < width:
            blocks[-1].append(words)
        elif words:
            blocks.append([words])
        width = len(words)
    return blocks


def _grids(text: str) -> tuple[list[_Seen], bool]:
    """Return zones from grids, last column first, and whether the grids state a status."""
    whole = [b for b in _blocks(text.splitlines()) if len(b) == len(b[0]) and len(b) in (4, 8)]
    stated = any(status for block in whole for row in block for _, status in row)
    seen = [
        _of_status(k * len(row) + len(row) - 1 - i, distance, status or str(VALID[0]), len(row))
        for block in whole
        for k, row in enumerate(block)
        for i, (distance, status) in enumerate(row)
    ]
    return seen, stated


def _side_of_rows(lines: list[str]) -> int:
    """Return the side of the frames of which each line is one, after up to two other numbers; 0 for other lines."""
    counts = {len(_NUMBERS.split(line.rstrip(",; "))) for line in lines if _NUMERIC.fullmatch(line)}
    if len(counts) != 1 or sum(_NUMERIC.fullmatch(line) is not None for line in lines) < len(lines):
        return 0
    count = counts.pop()
    return next((side for side in (8, 4) if 0 <= count - side * side <= _BEFORE), 0)


def _frames(contents: Contents, text: str, side: int) -> list[_Seen]:
    """Return zones from lines of which each is a frame, first zone first."""
    out: list[_Seen] = []
    for k, line in enumerate(map(str.strip, text.splitlines()), start=1):
        if not line:
            continue
        words = _NUMBERS.split(line.rstrip(",; "))[-side * side :]
        if len(words) < side * side or not all(is_whole(word) for word in words):
            contents.fail(f"{side * side} whole numbers of a frame", f"'{line[:40]}'", "Remove the line.", k)
        out += [_of_status(i, word, str(VALID[0]), side) for i, word in enumerate(words)]
    return out


def _two_grids(contents: Contents, text: str) -> list[_Seen]:
    """Return zones from alternating grids of distances and confidences."""
    blocks = [b for b in _blocks(text.splitlines()) if len(b) == len(b[0]) == 8]
    if not blocks or len(blocks) % 2:
        contents.fail(
            "a grid of confidences behind each of distances", f"{len(blocks)} grids of 8 x 8", "Log it whole."
        )
    return [
        _of_confidence(8 * k + i, int(distance), int(confidence), 8)
        for first, second in zip(blocks[::2], blocks[1::2], strict=True)
        for k in range(8)
        for i, ((distance, _), (confidence, _)) in enumerate(zip(first[k], second[k], strict=True))
    ]


def _objects(contents: Contents, text: str, notes: list[str]) -> list[_Results]:
    """Return the nearest objects of each line of the Arduino driver."""
    out: list[_Results] = []
    for k, line in enumerate(text.splitlines(), start=1):
        if not line.startswith("#Obj"):
            continue
        words = line.strip().split(",")
        if len(words) < 78 and contents.is_open and k == len(text.splitlines()) and out:
            notes.append("The last line is cut off and was excluded.")
            break
        if len(words) != 78 or not all(is_whole(word) for word in words[1:]):
            contents.fail("#Obj with 77 whole numbers", f"{len(words) - 1}", "Remove the line; was it cut off?", k)
        pairs = np.array([int(word) for word in words[6:]]).reshape(-1, 2)
        out.append(_Results(int(words[2]), pairs[:_NEAREST]))
    return out


def _printed(text: str) -> list[_Results]:
    """Return the nearest objects of each block of SparkFun's example; channels count from 1."""
    out: list[_Results] = []
    fresh = True
    for line in text.splitlines():
        match = _RESULT.search(line)
        if match is None:
            fresh = True
            continue
        if fresh:
            out.append(_Results(len(out), np.zeros((_NEAREST, 2), dtype=np.int64)))
        fresh = False
        confidence, distance, channel, capture = map(int, match.groups())
        k = channel - 1 + 9 * capture
        if 0 <= k < _NEAREST and not out[-1].pairs[k, 0]:  # the first result of a channel is its nearest object
            out[-1].pairs[k] = distance, confidence
    return out


def _grids_of(contents: Contents, results: list[_Results]) -> list[list[_Seen]]:
    """Return the zones in each grid that the used results allow: 3 x 3; 8 x 8 of four captures, and 4 x 4."""
    used = np.any([one.pairs[:, 0] > 0 for one in results], axis=0)
    three = not used[9:].any()
    four = not used[list(_UNUSED)].any()
    if not (three or four):
        contents.fail("3 x 3, 4 x 4 or 8 x 8 zones", "results of 18 zones", "Choose another map of zones (SPAD map).")
    nine = [_of_confidence(k, d, c, 3) for one in results for k, (d, c) in enumerate(one.pairs[:9].tolist()) if three]
    sixteen = [(one.number, j, *one.pairs[k].tolist()) for one in results for j, k in enumerate(_RESULTS) if four]
    square = [_of_confidence(j, d, c, 4) for _, j, d, c in sixteen]
    eight = [
        _of_confidence(_CORNERS[number % 4] + 16 * (j // 4) + (0, 1, 4, 5)[j % 4], d, c, 8)
        for number, j, d, c in sixteen
    ]
    return [grid for grid in (nine, eight, square) if grid]
