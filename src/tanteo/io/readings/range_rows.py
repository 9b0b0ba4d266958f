"""Read tables with one range in each row whose columns have the names and codes of loggers and devices.

The sensor may be a zone number, a row and a column of the grid, or the only sensor of the rig; the range may be named
``distance``; the status may be the code or the text of the device; the hand's pose may be that of a ``tcp`` or
``flange``. Columns of ``sensor_msgs/Range`` are in metres.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tanteo.errors import ReadingsError
from tanteo.io.logs.rangefinder import NOTHING, VALID
from tanteo.io.logs.tof import NO_TARGET
from tanteo.io.logs.tof import VALID as VALID_ZONES
from tanteo.io.readings.headers import canonical
from tanteo.io.readings.units import LENGTH_UNITS

if TYPE_CHECKING:
    from tanteo.io.readings.stated import Stated

_RANGES = ("range", "distance", "dist", "measured_distance", "measurement", "reading", "value", "tof", "depth")
"""Names of the column of ranges, the most likely first."""
_CODES = ("status", "range_status", "target_status", "status_code", "range_status_code", "error_code")
_NUMBERS = ("zone",), ("zone_id",), ("zone_number",), ("row", "col"), ("row", "column")
"""Columns that number the zones."""
_WORDS = ("ok", "none", "invalid", "")
"""Statuses of tanteo's own tables."""
_HANDS = re.compile(r"(?:tcp|tool|tool0|flange|ee|eef|end_effector|robot|arm|pose|wrist|hand)_(?:pose_)?"
                    r"(x|y|z|rx|ry|rz|roll|pitch|yaw|q[wxyz]|w|p|r|a|b|c)(_(?:mm|m|um|in|deg|rad))?")  # fmt: skip
_RTDE = re.compile(r"(?:actual_)?tcp_pose_(\d)")
"""Pose of the tool in recordings of Universal Robots: metres, and a rotation vector in radians."""
_RTDE_FIELDS = ("hand_x_m", "hand_y_m", "hand_z_m", "hand_rx_rad", "hand_ry_rad", "hand_rz_rad")
_OF_MESSAGES = {"field_of_view", "radiation_type"}
"""Fields that only ``sensor_msgs/Range`` has."""
_MEASURED = ("measured", "measurement", "reading", "sensor_reading", "raw", "measured_distance", "sensor")
_KNOWN = ("actual", "actual_distance", "true", "real", "real_distance", "reference", "ground_truth", "known", "nominal")
"""Names of the reported and of the known distance beside each other."""


def range_header(header: Sequence[str], stated: Stated) -> list[str]:
    """Return the header of a table of ranges with tanteo's names for ranges and poses; other headers unchanged.

    Args:
        header: cells of the header.
        stated: options of the user.
    """
    names = [canonical(cell.lstrip("%")) for cell in header]
    if sum(name.startswith("field_") for name in names) >= len(names) - 1 > 0:
        names = [name.removeprefix("field_") for name in names]
    bases = [_bare(name) for name in names]
    if "range" not in bases and stated.rig is None and stated.sensor is None:
        return list(header)
    out = list(header)
    if "range" in bases and _OF_MESSAGES & set(bases):
        out = [{"range": "range_m", "max_range": "max_m"}.get(name, name) for name in names]
    hands = [_HANDS.fullmatch(name) for name in names]
    if {match[1] for match in hands if match} >= {"x", "y", "z"}:
        for k, match in enumerate(hands):
            out[k] = out[k] if match is None else f"hand_{match[1]}{match[2] or ''}"
    rtde = {int(match[1]): k for k, name in enumerate(names) if (match := _RTDE.fullmatch(name))}
    if sorted(rtde) == list(range(len(_RTDE_FIELDS))):
        for field, k in rtde.items():
            out[k] = _RTDE_FIELDS[field]
    return _beside(out) if "range" not in bases else out


def _beside(header: list[str]) -> list[str]:
    """Return the header with a measured and an actual distance named as range and true distance."""
    parts = [re.findall(r"[a-z]+", cell.lower()) for cell in header]
    units = [words[-1] if words and words[-1] in (*LENGTH_UNITS, "cm") else "" for words in parts]
    bases = ["_".join(words[: len(words) - bool(unit)]) for words, unit in zip(parts, units, strict=True)]
    found = [[k for k, base in enumerate(bases) if base in known] for known in (_MEASURED, _KNOWN)]
    if any(len(rows) != 1 for rows in found):
        return header
    out = list(header)
    for (k,), name in zip(found, ("range", "true_distance"), strict=True):
        out[k] = f"{name}_{units[k]}".rstrip("_")
    return out


@dataclass(frozen=True, slots=True)
class RangeRows:
    """Columns of a table with one range in each row.

    Attributes:
        header: header of the rows: the kept columns, then sensor, range and status.
        kept: indices of the columns that are passed on.
        zones: index of the range column.
        status: index of the column of the device's status; None if there is none.
        place: indices of the columns of the zone number, or of its row and column; empty if there are none.
        grid: numbers of rows and columns of the device; (0, 0) without zones.
        sensor: only sensor of the rig, or name of the device with zones; empty where a column names the sensor.
        named: index of the column of the sensor; None if there is none.
        shown: range column as messages name it.
        notes: sentences about assumptions.
    """

    header: tuple[str, ...]
    kept: tuple[int, ...]
    zones: tuple[int, ...]
    status: int | None
    place: tuple[int, ...]
    grid: tuple[int, int]
    sensor: str
    named: int | None
    shown: str
    notes: tuple[str, ...]

    def rows(self, rows: Iterator[list[str]], width: int) -> Iterator[list[str]]:
        """Yield each row with its sensor, range and status.

        Args:
            rows: rows of the file.
            width: number of columns of the file; other rows are passed on, so that the table refuses them.
        """
        first: int | None = None
        if self.place:
            every = list(rows)
            numbers = [row[k] for row in every if len(row) == width for k in self.place]
            first = min((int(word) for word in numbers if word.strip().isdigit()), default=0)
            rows = iter(every)
        for row in rows:
            if len(row) != width:
                yield row
                continue
            cell = row[self.zones[0]]
            status = "" if self.status is None else status_of(row[self.status], zones=bool(self.place))
            if not cell.strip() and not status:
                status = "invalid"
            own = cell if status in ("", "ok") else ""
            yield [*(row[k] for k in self.kept), self._sensor(row, first), own, status]

    def _sensor(self, row: list[str], first: int | None) -> str:
        if first is None:
            return self.sensor if self.named is None else row[self.named]
        words = [row[k].strip() for k in self.place]
        if not all(word.isdigit() for word in words):
            return f"{self.sensor}.{'.'.join(words)}"
        numbers = [int(word) - min(first, 1) for word in words]
        i, j = numbers if len(numbers) > 1 else divmod(numbers[0], self.grid[1])
        return f"{self.sensor}.{i + 1}.{j + 1}"


def find_rows(header: Sequence[str], place: str, stated: Stated, grids: dict[str, tuple[int, int]]) -> RangeRows | None:
    """Return the columns of a table with one range in each row; None if the header needs no interpretation.

    Args:
        header: cells of the header.
        place: file and line for messages.
        stated: options of the user, with the rig.
        grids: numbers of rows and columns of each multi-zone device of the rig.

    Raises:
        ReadingsError: zones are numbered and the rig has no or several devices with zones.
    """
    names = [canonical(cell) for cell in header]
    bases = [_bare(name) for name in names]
    if {"x", "y", "z"} <= set(bases) and not _turned(bases):
        return None
    k = next((bases.index(name) for name in _RANGES if name in bases), None)
    if k is None or (bases[k] != "range" and stated.rig is None and stated.sensor is None):
        return None
    if "kind" in bases:  # a table of tanteo, whose beams of kind free have no range
        return None
    numbered = next((tuple(map(bases.index, words)) for words in _NUMBERS if set(words) <= set(bases)), ())
    named = bases.index("sensor") if "sensor" in bases else None
    status = next((bases.index(name) for name in _CODES if name in bases), None)
    singles = [] if stated.rig is None else list(stated.rig.sensors)
    sensor, grid = "", (0, 0)
    if named is None and numbered:
        sensor, grid = _device(header[numbered[0]], place, stated, grids)
    elif named is None and len(singles) == 1:
        sensor = singles[0].name
    elif named is None and stated.sensor is not None and not singles:
        sensor = stated.sensor
    elif named is None:
        return None
    unit = names[k][len(bases[k]) + 1 :]
    if unit == "" and stated.units is None and bases[k] == "range":
        return None  # the table refuses it with the unit to write
    notes = []
    if unit == "" and stated.units is None:
        notes.append(f"Column {header[k]} is taken as mm; use --units m if it is metres.")
    used = {k, *numbered} | ({status} if status is not None else set()) | ({named} if named is not None else set())
    written = unit or stated.units or "mm"
    kept = tuple(i for i in range(len(names)) if i not in used)
    named_so = (*(header[i] for i in kept), "sensor", f"range_{written}", "status")
    return RangeRows(
        named_so, kept, (k,), status, numbered, grid, sensor, named, header[k], tuple(notes),
    )  # fmt: skip


def _device(cell: str, place: str, stated: Stated, grids: dict[str, tuple[int, int]]) -> tuple[str, tuple[int, int]]:
    """Return the device of numbered zones and its grid."""
    name = stated.device if stated.device in grids else next(iter(grids), None)
    if name is None or (len(grids) > 1 and stated.device not in grids):
        have = ", ".join(f"'{one}'" for one in grids) or "none"
        advice = "Name it with --device." if grids else "Use --rig FILE with zones and field_deg."
        raise ReadingsError(f"{place}: expected one device with zones for the column '{cell}', got {have}. {advice}")
    return name, grids[name]


def status_of(cell: str, *, zones: bool) -> str:
    """Return the status of a row: empty where its range counts, ``none``, or ``invalid``.

    Args:
        cell: word of tanteo's tables, or code or text of the device.
        zones: whether the device has zones, whose codes are those of ST's VL53L5CX; others are of single beams.
    """
    word = cell.strip().lower().removesuffix(".0")
    if word in _WORDS:
        return word
    if zones:
        return "none" if word == str(NO_TARGET) else "" if word in map(str, VALID_ZONES) else "invalid"
    return "" if word in VALID else "none" if word in NOTHING else "invalid"


def _turned(bases: Sequence[str]) -> bool:
    """Return whether the columns have a rotation, so that x, y and z are those of the hand."""
    own = set(bases)
    return any(set(words) <= own for words in (("qw", "qx", "qy", "qz"), ("rx", "ry", "rz"), ("roll", "pitch", "yaw")))


def _bare(name: str) -> str:
    head, _, unit = name.rpartition("_")
    return head if head and (unit in LENGTH_UNITS or unit == "cm") else name
