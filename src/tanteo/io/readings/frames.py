"""Read tables with one row for each frame of a multi-zone sensor, or of several sensors, and one column for each zone.

Loggers write ``time, z0, z1, .. z63``, or one column for each sensor of a ring. Each row becomes one row for each zone,
with the hand's pose and the other columns of its frame.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tanteo.errors import ReadingsError, UnitError
from tanteo.io.logs.tof import LEAST_CONFIDENCE
from tanteo.io.readings.headers import canonical
from tanteo.io.readings.range_rows import RangeRows, find_rows, status_of
from tanteo.io.readings.units import LENGTH_UNITS

if TYPE_CHECKING:
    from tanteo.io.readings.stated import Stated
    from tanteo.sensors import Rig

_WORDS = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|\d{1,4}")
_AXES = {"x": 1, "c": 1, "col": 1, "column": 1, "y": 0, "r": 0, "row": 0}
"""Words before a number of a row (0) or column (1)."""
_STEMS = (
    "z", "zone", "d", "dist", "distance", "range", "r", "tof", "pixel", "px", "p", "ch", "channel", "depth", "target",
    "sensor", "row", "cell", "data", "field", "value", "raw", "ranging", "result", "results", "zones", "ranges",
    "distances", "pixels", "sonar", "ultrasonic", "us", "ir", "s",
)  # fmt: skip
"""Words in names of numbered columns that hold distances, the most likely first."""
_STATUSES = "status", "statuses", "stat", "st"
_CONFIDENCES = "confidence", "conf"
_COUNTERS = "id", "no", "nr", "num", "number", "index", "name", "frame", "frame_id", "count", "seq", "streamcount", ""
"""Names of columns that count frames."""
_UNITS = {*LENGTH_UNITS, "cm"}
_LEAST = 4
"""Smallest number of zones in a frame."""
_LONGEST = 60
"""Largest number of characters in the name of a zone's column."""


@dataclass(frozen=True, slots=True)
class Frames:
    """Columns of a table of frames.

    Attributes:
        header: header of the rows that a frame becomes: the kept columns, then sensor, range and status.
        kept: indices of the columns that all zones of a frame share.
        zones: index of the range column of each zone.
        statuses: index of the status column of each zone; empty if there are none.
        confidences: index of the confidence column of each zone; empty if there are none.
        sensors: sensor of each zone.
        shown: range columns as messages name them.
        notes: sentences about assumptions and ignored columns.
    """

    header: tuple[str, ...]
    kept: tuple[int, ...]
    zones: tuple[int, ...]
    statuses: tuple[int, ...]
    confidences: tuple[int, ...]
    sensors: tuple[str, ...]
    shown: str
    notes: tuple[str, ...]

    def rows(self, frames: Iterator[list[str]], width: int) -> Iterator[list[str]]:
        """Yield one row for each zone of each frame.

        Args:
            frames: rows of the file.
            width: number of columns of the file; other rows are passed on, so that the table refuses them.
        """
        for frame in frames:
            if len(frame) != width:
                yield frame
                continue
            shared = [frame[k] for k in self.kept]
            for i, k in enumerate(self.zones):
                status = self._status(frame, i)
                yield [*shared, self.sensors[i], "" if status else frame[k], status]

    def _status(self, frame: list[str], zone: int) -> str:
        """Return the status of a zone: none, invalid, or empty where its range decides."""
        if self.statuses:
            return status_of(frame[self.statuses[zone]] or "-", zones=True)
        if self.confidences and frame[zone_range := self.zones[zone]].strip().strip("0.") == "":
            return "none" if frame[zone_range].strip() else "invalid"
        if self.confidences:
            try:
                return "" if float(frame[self.confidences[zone]]) >= LEAST_CONFIDENCE else "invalid"
            except ValueError:
                return "invalid"
        return "" if frame[self.zones[zone]].strip() else "invalid"


def find_frames(header: Sequence[str], place: str, stated: Stated) -> Frames | RangeRows | None:
    """Return the columns of a table of frames; None if the header names no numbered zones and no sensors of the rig.

    Args:
        header: cells of the header.
        place: file and line for messages.
        stated: options of the user, with the rig.

    Raises:
        ReadingsError: no device of the rig has this number of zones, or several have, or there is no rig.
        UnitError: the columns have different units.
    """
    names = [canonical(cell) for cell in header]
    bases = [_bare(name) for name in names]
    if (listed := find_rows(header, place, stated, {} if stated.rig is None else zones_of(stated.rig))) is not None:
        return listed
    if {"range", "sensor"} & set(bases):
        return None
    singles = 0 if stated.rig is None else sum(not sensor.unit for sensor in stated.rig.sensors)
    groups = numbered_columns(header, singles if 1 < singles < _LEAST else _LEAST)
    own = _of_sensors(names, stated.rig)
    ranks = {stem: rank for stem in groups if (rank := _stem_rank(stem, stated.rig)) is not None}
    likely = {stem: groups[stem] for stem in ranks}
    if (own is None and not likely) or {"x", "y"} <= groups.keys():
        return None
    if own is not None and len(own[0]) >= max(len(runs) for runs in (*likely.values(), ())):
        zones, sensors = own
        used = set(zones)
        statuses: tuple[int, ...] = ()
        confidences: tuple[int, ...] = ()
        shown = ", ".join(header[k] for k in zones[:3]) + (" .." if len(zones) > 3 else "")
    else:
        stem = min(likely, key=lambda stem: (ranks[stem], -len(likely[stem])))
        zones = likely[stem]
        shown = f"{header[zones[0]]} .. {header[zones[-1]]}"
        sensors = _zone_names(len(zones), stem, shown, place, stated)
        beside = {tuple(s.split()): runs for s, runs in groups.items() if len(runs) == len(zones) and s != stem}
        statuses = next((runs for words, runs in beside.items() if set(words) & set(_STATUSES)), ())
        confidences = next((runs for words, runs in beside.items() if set(words) & set(_CONFIDENCES)), ())
        used = set(zones) | set(statuses) | set(confidences)
    kept = [k for k, name in enumerate(names) if k not in used and name not in _COUNTERS]
    ignored = [(s, runs) for s, runs in groups.items() if len(runs) == len(zones) and not set(runs) & used]
    for _, runs in ignored:
        kept = [k for k in kept if k not in runs]
    notes = [f"Columns {header[runs[0]]} .. {header[runs[-1]]} are not used." for _, runs in ignored]
    unit = _unit([header[k] for k in zones], place, stated, shown, notes)
    return Frames(
        (*(header[k] for k in kept), "sensor", f"range_{unit}", "status"), tuple(kept),
        tuple(zones), tuple(statuses), tuple(confidences), tuple(sensors), shown,
        tuple(notes),
    )  # fmt: skip


def _numbered(cell: str) -> tuple[str, tuple[int, int]] | None:
    """Return the words of a numbered column and its numbers of row and column, -1 if it has one number only."""
    words = [word.lower() for word in _WORDS.findall(cell)] if len(cell) < _LONGEST else []
    numbers = [k for k, word in enumerate(words) if word.isdigit()]
    if not numbers:
        return None
    last = numbers.pop()
    first = numbers[-1] if numbers and all(word in _AXES for word in words[numbers[-1] + 1 : last]) else last
    axes = [words[k - 1] if k and words[k - 1] in _AXES else "" for k in (first, last)]
    used = {first, last, *(k - 1 for k, axis in zip((first, last), axes, strict=True) if axis and first < last)}
    stem = " ".join(
        w for k, w in enumerate(words) if k not in used and (w not in _UNITS or (k == 0 and w in ("m", "in")))
    )
    pair = (int(words[first]), int(words[last]) if first < last else -1)
    turned = first < last and _AXES.get(axes[0]) == 1 and _AXES.get(axes[1]) == 0
    return stem, pair[::-1] if turned else pair


def numbered_columns(header: Sequence[str], least: int = _LEAST) -> dict[str, tuple[int, ...]]:
    """Return the columns of complete runs of numbers from 0 or 1 by the words beside the numbers.

    Args:
        header: cells of the header.
        least: smallest number of columns of a run.
    """
    found: dict[str, dict[tuple[int, int], int]] = {}
    for k, cell in enumerate(header):
        if (own := _numbered(cell)) is not None:
            found.setdefault(own[0], {})[own[1]] = k
    letters = sorted(stem for stem in found if len(stem) == 1)
    if len(letters) > 1 and "".join(letters) in "abcdefghijklmnop":  # A1 .. H8
        found = {"": {(ord(stem) - ord("a"), b): k for stem in letters for (b, _), k in found[stem].items()}}
    out = {}
    for stem, columns in found.items():
        numbers = [a for a, b in columns if b < 0]
        if numbers and max(numbers) > len(numbers):  # d00 .. d77: row and column
            columns = {divmod(a, 10) if b < 0 else (a, b): k for (a, b), k in columns.items()}
        keys = sorted(columns)
        rows, cols = sorted({a for a, _ in keys}), sorted({b for _, b in keys})
        whole = len(keys) == len(rows) * len(cols) and len(keys) >= least
        if whole and rows[0] in (0, 1) and rows == list(range(rows[0], rows[0] + len(rows))):
            out[stem] = tuple(columns[key] for key in keys)
    return out


def _without_device(stem: str, rig: Rig | None) -> str:
    """Return the words of a column without the name of a device of the rig."""
    for device in {s.device for s in rig.sensors} if rig is not None else ():
        name = " ".join(_WORDS.findall(device)).lower()
        if f"{stem} ".startswith(f"{name} "):
            return stem[len(name) + 1 :]
    return stem


def _stem_rank(stem: str, rig: Rig | None) -> int | None:
    """Return the rank of a column's words among those of distances; None if another quantity is named."""
    words = _without_device(stem, rig).split()
    if not all(word in _STEMS for word in words):
        return None
    return min((_STEMS.index(word) for word in words), default=0 if words != stem.split() else len(_STEMS))


def _of_sensors(names: Sequence[str], rig: Rig | None) -> tuple[tuple[int, ...], tuple[str, ...]] | None:
    """Return the columns that are named as sensors of the rig, and these sensors; None if there are none."""
    known = {} if rig is None else {canonical(sensor.name): sensor.name for sensor in rig.sensors}
    found = [
        (k, known[bare]) for k, name in enumerate(names) if (bare := name if name in known else _bare(name)) in known
    ]
    if not found or {"x", "y", "z"} & {names[k] for k, _ in found}:
        return None
    columns, sensors = zip(*found, strict=True)
    return tuple(columns), tuple(sensors)


def _zone_names(count: int, stem: str, shown: str, place: str, stated: Stated) -> tuple[str, ...]:
    """Return the sensor of each zone, by the device of the rig with this number of zones."""
    if stated.rig is None:
        raise ReadingsError(
            f"{place}: expected --rig with frames of {count} zones (columns {shown}), got none. Use --rig FILE, "
            "with the pose of the sensor on the hand, zones and field_deg."
        )
    devices = zones_of(stated.rig)
    fitting = [name for name, (rows, columns) in devices.items() if rows * columns == count]
    named = [name for name in fitting if f"{stem} ".startswith(" ".join(_WORDS.findall(name)).lower() + " ")]
    if stated.device in fitting:
        fitting = [str(stated.device)]
    elif len(named) == 1:
        fitting = named
    single = [s.name for s in stated.rig.sensors if not s.unit]
    if not fitting and len(single) == count and count > 1:
        return tuple(single)
    if len(fitting) != 1:
        have = ", ".join(f"'{name}' ({r} x {c})" for name, (r, c) in devices.items()) or f"{len(single)} single beams"
        raise ReadingsError(
            f"{place}: expected a device of the rig with {count} zones, as the columns {shown} have, got {have}. "
            + ("Name it with --device." if fitting else "Correct zones in the rig.")
        )
    rows, columns = devices[fitting[0]]
    return tuple(f"{fitting[0]}.{k // columns + 1}.{k % columns + 1}" for k in range(rows * columns))


def zones_of(rig: Rig) -> dict[str, tuple[int, int]]:
    """Return the numbers of rows and columns of each multi-zone device of a rig.

    Args:
        rig: rig to examine.
    """
    out: dict[str, tuple[int, int]] = {}
    for sensor in rig.sensors:
        match = re.fullmatch(r"(.+)\.(\d+)\.(\d+)", sensor.name)
        if match is not None and sensor.unit == match[1]:
            before = out.get(sensor.unit, (0, 0))
            out[sensor.unit] = max(before[0], int(match[2])), max(before[1], int(match[3]))
    return out


def _unit(cells: Sequence[str], place: str, stated: Stated, shown: str, notes: list[str]) -> str:
    words = [[word.lower() for word in _WORDS.findall(cell)] for cell in cells]
    units = {next((word for word in reversed(each) if word in _UNITS), "") for each in words}
    if len(units) > 1:
        raise UnitError(
            f"{place}: expected one unit in the columns {shown}, got {', '.join(sorted(units))}. Correct it."
        )
    unit = units.pop()
    if unit:
        return unit
    if stated.units is None:
        notes.append(f"The columns {shown} are taken as mm; use --units m if they are metres.")
    return stated.units or "mm"


def _bare(name: str) -> str:
    head, _, unit = name.rpartition("_")
    return head if head and unit in _UNITS else name
