"""Write JSON documents of ranges, and messages that ROS prints, as tables that the reader of tables reads.

Loggers print one object for each reading or frame, ``{"time": 0.1, "distance_mm": [312, ..], "status": [5, ..]}``,
or a list of objects with zone, distance and status; text before the object, as of a console, is ignored. Nested names
are joined: ``pose.position.x``; elements of a list get a number: ``distance_mm_0``, those of a list of lists two.
``rostopic echo`` and ``ros2 topic echo`` print one YAML document for each message.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tanteo.io.logs.contents import HEAD
from tanteo.io.poses.camera_layouts import load_yaml

_START = re.compile(r"[{\[]")
_ECHO = re.compile(r"\A\s*(?:header:\s*\n[ \t]+(?:.*\n)*?)?(?:radiation_type:\s*\d|layout:\s*\n)", re.MULTILINE)
"""Start of a printed message of ``sensor_msgs/Range``, or of an array such as ``std_msgs/UInt16MultiArray``."""
_BETWEEN = re.compile(r"^---\s*$", re.MULTILINE)
_ZONES = ("zone", "id", "index", "zone_id", "z")
"""Keys of the number of a zone in a list of objects."""
_DISTANCE = re.compile(r"(?:^|.*[^a-z])(?:range|ranges|distance|distances|dist|depth|zones)(?:[^a-z].*|$)")
_FRAMES = (9, 16, 64)
"""Numbers of zones of a list without a name."""
_MOST = 10_000
"""Largest number of columns."""


def table_of_json(text: str) -> str | None:
    """Return a table with a header from a JSON document, or from one JSON document on each line; None for another text.

    Args:
        text: text of the file.
    """
    rows = [row for row in (_flat(one) for one in _objects(text)) if row is not None]
    names = list(dict.fromkeys(name for row in rows for name in row))
    if not rows or len(names) > _MOST or not _has_ranges(names):
        return None
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([row.get(name, "") for name in names] for row in rows)
    return out.getvalue()


def is_json_of_ranges(head: str) -> bool:
    """Return whether the start of a file has a JSON document with ranges on its first lines, or is one.

    Args:
        head: start of the file.
    """
    if _ECHO.search(head):
        return True
    lines = [line for line in head.splitlines() if _START.search(line)][:3]
    if not lines or head.lstrip()[:1] == "<":
        return False
    rows = [row for line in lines for one in _objects(line) if (row := _flat(one)) is not None]
    if rows:
        return any(map(_has_ranges, rows)) and not any(map(_is_point, rows))
    keys = [key.lower() for key in re.findall(r"\"([^\"]{1,60})\"\s*:", head)]
    return head.lstrip()[:1] in ("{", "[") and any(map(_is_distance, keys)) and not {"x", "y", "z"} <= set(keys)


def _has_ranges(names: Iterable[str]) -> bool:
    """Return whether a column is named as a distance, or columns of one name are as many as the zones of a frame."""
    names = list(names)
    counts = Counter(re.sub(r"[\d_]+$", "", name) for name in names if name[-1:].isdigit())
    return any(map(_is_distance, names)) or any(count in _FRAMES for count in counts.values())


def _is_distance(name: str) -> bool:
    return _DISTANCE.fullmatch(name.lower()) is not None


def _is_point(row: dict[str, str]) -> bool:
    return {"x", "y", "z"} <= {name.lower().rpartition(".")[2] for name in row} and not any(
        "position" in name.lower() or name.lower().startswith("hand") for name in row
    )


def _objects(text: str) -> list[Any]:
    """Return the rows of a document: its list of objects, or the document on each line."""
    if _ECHO.search(text[:HEAD]):
        documents = [load_yaml(part, Path("message")) for part in _BETWEEN.split(text) if part.strip()]
        return [one for one in documents if isinstance(one, dict)]
    start = text.lstrip()[:1]
    documents = [_loaded(text)] if start in ("{", "[") else [None]
    if documents == [None]:
        documents = [_loaded(line[at.start() :]) for line in text.splitlines() if (at := _START.search(line))]
    return [row for document in documents if document is not None for row in _rows(document)]


def _loaded(text: str) -> Any:
    """Return a JSON document with numbers as words; None for other text."""
    try:
        return json.loads(text.strip().rstrip(","), parse_int=str, parse_float=str)
    except (ValueError, RecursionError):
        return None


def _rows(document: Any) -> list[Any]:
    """Return the frames of a document, or the document itself."""
    if isinstance(document, dict):
        lists = [
            value for value in document.values() if isinstance(value, list) and value and isinstance(value[0], dict)
        ]
        frames = max(lists, key=len, default=[])
        return [document] if not frames or _is_zones(frames) else frames
    if not isinstance(document, list) or not document:
        return [document]
    square = isinstance(document[0], list) and len(document) == len(document[0])
    return document if isinstance(document[0], dict) or (isinstance(document[0], list) and not square) else [document]


def _is_zones(objects: list[Any]) -> bool:
    """Return whether objects are the zones of one frame: each has a number of its own."""
    if not all(isinstance(one, dict) for one in objects):
        return False
    numbers = [next((one[key] for key in _ZONES if key in one), None) for one in objects]
    return None not in numbers and len(set(map(str, numbers))) == len(numbers)


def _flat(value: Any, name: str = "") -> dict[str, str] | None:
    """Return the cells of a row by column name; None for a row that is no table of ranges."""
    if not name and isinstance(value, list):
        flat = [cell for row in value for cell in (row if isinstance(row, list) else [row])]
        return _numbered("range", value) if len(flat) in _FRAMES else None
    if not isinstance(value, dict):
        return None if not name else {name: "" if value is None else str(value)}
    out: dict[str, str] = {}
    for key, inner in value.items():
        own = f"{name}.{key}" if name else str(key)
        if isinstance(inner, list):
            if inner and _is_zones(inner):
                for one in inner:
                    number = next(one[k] for k in _ZONES if k in one)
                    out |= {f"{k}_{number}": str(v) for k, v in one.items() if k not in _ZONES}
            else:
                out |= _numbered(own, inner)
        else:
            out |= _flat(inner, own) or {}
    return out


def _numbered(name: str, values: list[Any]) -> dict[str, str]:
    out: dict[str, str] = {}
    for k, value in enumerate(values):
        if isinstance(value, list):
            out |= {f"{name}_{k}_{j}": "" if v is None else str(v) for j, v in enumerate(value)}
        elif not isinstance(value, dict):
            out[f"{name}_{k}"] = "" if value is None else str(value)
    return out
