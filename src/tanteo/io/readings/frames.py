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
from tanteo.io.logs.tof import LEAST_CONFIDENCE, NO_TARGET, VALID
from tanteo.io.readings.headers import canonical
from tanteo.io.readings.units import LENGTH_UNITS

if TYPE_CHECKING:
    from tanteo.io.readings.stated import Stated
    from tanteo.sensors import Rig

_NUMBERED = re.compile(
    r"(?P<stem>(?:\w*?[a-z_])??)_?(?P<first>\d{1,4})(?:(?:_?(?:x|c|col)_?|_)(?P<second>\d{1,3}))?(?:_(?P<unit>mm|m|um|in))?"
)
_STEMS = (
    "z", "zone", "d", "dist", "distance", "distance_mm", "range", "range_mm", "r", "tof", "mm", "pixel", "px", "p",
    "ch", "channel", "depth", "target", "sensor", "row", "",
)  # fmt: skip
"""Names of numbered columns that hold distances, the most likely first."""
_STATUSES = "status", "target_status", "range_status", "stat", "st"
_CONFIDENCES = "confidence", "conf"
_COUNTERS = "id", "no", "nr", "num", "number", "index", "name", "frame", "frame_id", "count", "seq", "streamcount", ""
"""Names of columns that count frames."""
_LEAST = 4
"""Smallest number of zones in a frame."""


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
                own = [self._status(frame, i)] if self.header[-1] == "status" else []
                yield [*shared, self.sensors[i], frame[k] if own in ([], [""]) else "", *own]

    def _status(self, frame: list[str], zone: int) -> str:
        """Return the status of a zone: none, invalid, or empty where its range decides."""
        if self.statuses:
            cell = frame[self.statuses[zone]].strip().removesuffix(".0")
            if not cell.isdigit():
                return "invalid"
            return "none" if int(cell) == NO_TARGET else "" if int(cell) in VALID else "invalid"
        if self.confidences and frame[zone_range := self.zones[zone]].strip().strip("0.") == "":
            return "none" if frame[zone_range].strip() else "invalid"
        if self.confidences:
            try:
                return "" if float(frame[self.confidences[zone]]) >= LEAST_CONFIDENCE else "invalid"
            except ValueError:
                return "invalid"
        return ""


def find_frames(header: Sequence[str], place: str, stated: Stated) -> Frames | None:
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
    if {"range", "sensor"} & set(bases):
        return _of_one(header, names, bases, stated)
    groups = _groups(names)
    own = _of_sensors(names, stated.rig)
    likely = {stem: runs for stem, runs in groups.items() if _stem_rank(stem, stated.rig) < len(_STEMS)}
    if (own is None and not likely) or {"x", "y"} <= groups.keys():
        return None
    if own is not None and len(own[0]) >= max(len(runs) for runs in (*likely.values(), ())):
        zones, sensors = own
        used = set(zones)
        statuses: tuple[int, ...] = ()
        confidences: tuple[int, ...] = ()
        shown = ", ".join(header[k] for k in zones[:3]) + (" .." if len(zones) > 3 else "")
    else:
        stem = min(likely, key=lambda stem: (_stem_rank(stem, stated.rig), -len(likely[stem])))
        zones = likely[stem]
        sensors = _zone_names(len(zones), stem, place, stated)
        beside = {s: runs for s, runs in groups.items() if len(runs) == len(zones) and s != stem}
        statuses = next((runs for s, runs in beside.items() if s.strip("_z") in _STATUSES), ())
        confidences = next((runs for s, runs in beside.items() if s.strip("_z") in _CONFIDENCES), ())
        used = set(zones) | set(statuses) | set(confidences)
        shown = f"{header[zones[0]]} .. {header[zones[-1]]}"
    kept = [k for k, name in enumerate(names) if k not in used and name not in _COUNTERS]
    ignored = [(s, runs) for s, runs in groups.items() if len(runs) == len(zones) and not set(runs) & used]
    for _, runs in ignored:
        kept = [k for k in kept if k not in runs]
    notes = [f"Columns {header[runs[0]]} .. {header[runs[-1]]} are not used." for _, runs in ignored]
    unit = _unit([names[k] for k in zones], place, stated, shown, notes)
    return Frames(
        (*(header[k] for k in kept), "sensor", f"range_{unit}", "status"), tuple(kept), tuple(zones), tuple(statuses),
        tuple(confidences), tuple(sensors), shown, tuple(notes),
    )  # fmt: skip


def _of_one(header: Sequence[str], names: Sequence[str], bases: Sequence[str], stated: Stated) -> Frames | None:
    """Return the range column of the only sensor of the rig, whose name the file does not repeat; None otherwise."""
    if "sensor" in bases or "x" in bases or stated.rig is None or len(stated.rig.sensors) != 1:
        return None
    k = bases.index("range")
    kept = tuple(i for i in range(len(names)) if i != k)
    return Frames(
        (*(header[i] for i in kept), "sensor", header[k]), kept, (k,), (), (), (stated.rig.sensors[0].name,), header[k],
        (),
    )  # fmt: skip


def _groups(names: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Return the columns of complete runs of numbers from 0 or 1 by the text before the number."""
    found: dict[str, dict[tuple[int, int], int]] = {}
    for k, name in enumerate(names):
        match = _NUMBERED.fullmatch(name) if len(name) < 60 else None
        if match is not None:
            key = (int(match["first"]), -1 if match["second"] is None else int(match["second"]))
            found.setdefault(match["stem"].rstrip("_"), {})[key] = k
    out = {}
    for stem, columns in found.items():
        numbers = [a for a, b in columns if b < 0]
        if numbers and max(numbers) > len(numbers):  # d00 .. d77: row and column
            columns = {divmod(a, 10) if b < 0 else (a, b): k for (a, b), k in columns.items()}
        keys = sorted(columns)
        rows, cols = sorted({a for a, _ in keys}), sorted({b for _, b in keys})
        whole = len(keys) == len(rows) * len(cols) and len(keys) >= _LEAST
        if whole and rows[0] in (0, 1) and rows == list(range(rows[0], rows[0] + len(rows))):
            out[stem] = tuple(columns[key] for key in keys)
    return out


def _stem_rank(stem: str, rig: Rig | None) -> int:
    devices = () if rig is None else {s.device for s in rig.sensors}
    for device in devices:
        if stem != device.lower() and stem.startswith(f"{device.lower()}_"):
            stem = stem[len(device) + 1 :]
        elif stem == device.lower():
            return 0
    return _STEMS.index(stem) if stem in _STEMS else len(_STEMS)


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


def _zone_names(count: int, stem: str, place: str, stated: Stated) -> tuple[str, ...]:
    """Return the sensor of each zone, by the device of the rig with this number of zones."""
    if stated.rig is None:
        raise ReadingsError(
            f"{place}: expected --rig with frames of {count} zones (columns {stem}0 ..), got none. Use --rig FILE, "
            "with the pose of the sensor on the hand, zones and field_deg."
        )
    devices = zones_of(stated.rig)
    fitting = [name for name, (rows, columns) in devices.items() if rows * columns == count]
    named = [name for name in fitting if stem.startswith(f"{name.lower()}_") or stem == name.lower()]
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
            f"{place}: expected a device of the rig with {count} zones, as the columns {stem}0 .. have, got {have}. "
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


def _unit(names: Sequence[str], place: str, stated: Stated, shown: str, notes: list[str]) -> str:
    units = {name.rpartition("_")[2] if name.rpartition("_")[2] in LENGTH_UNITS else "" for name in names}
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
    return head if head and unit in LENGTH_UNITS else name
