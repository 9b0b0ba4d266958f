"""Read and write tables of readings with a header, one reading per row (``docs/formats_readings.md``)."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from tanteo.errors import ReadingsError, UnitError
from tanteo.geometry import SO3
from tanteo.io.logs.contents import lost_digits
from tanteo.io.logs.json_table import is_json_of_ranges, table_of_json
from tanteo.io.logs.table_text import HEAD_BYTES, TableText, sniff
from tanteo.io.poses.transforms import Track
from tanteo.io.readings import units
from tanteo.io.readings.analog import find_analog
from tanteo.io.readings.cells import Sheet
from tanteo.io.readings.columns import DIRECTION, HAND, NORMAL, POINT, read_header
from tanteo.io.readings.frames import find_frames
from tanteo.io.readings.headers import canonical, units_row, with_height
from tanteo.io.readings.list_cells import find_lists
from tanteo.io.readings.profiles import find_profiles
from tanteo.io.readings.range_rows import range_header
from tanteo.io.readings.row_checks import Excluded, units_of_cells
from tanteo.io.readings.stated import Stated
from tanteo.io.readings.table import Table
from tanteo.replaced import replaced
from tanteo.sensors import Column, Readings, reading_kind

CHUNK = 50_000
"""Number of rows converted at a time, which limits the text in memory."""

_LARGEST_JSON = 200_000_000
"""Largest number of characters of a JSON document that is read."""

_LAST = 50
"""Number of rows whose decimals are compared with those of the last cell."""

_UNIT_LETTERS = ' minu"″'
"""Letters and marks of the length units that may stand in cells."""

_UNITS = (*units.LENGTH_UNITS, *units.ANGLE_UNITS)


def read_table(path: Path, start: bytes, stated: Stated, progress: Callable[[int], None] | None) -> Readings:
    """Read a table with a header.

    Args:
        path: file to read.
        start: first bytes of the file.
        stated: options for what the file does not contain.
        progress: function called repeatedly with the number of rows read so far; None for none.

    Raises:
        ReadingsError: the file is not such a table, or an entry is invalid; the message names file, line, column and
            value.
        UnitError: a unit is missing, unknown or contradictory.
    """
    how = sniff(start[:HEAD_BYTES], whole=len(start) <= HEAD_BYTES)
    if how is not None and is_json_of_ranges(start[:HEAD_BYTES].decode(how.encoding, errors="replace")):
        with how.open(path) as text:
            how = TableText(converted=table_of_json(text.read(_LARGEST_JSON)))
    if how is None:
        raise ReadingsError(
            f"{path}: expected a text file (UTF-8, commas) or a format of docs/formats_logs.md, got a binary one. "
            "Export it as CSV."
        )
    with how.open(path) as text:
        return _read_rows(path, text, how, stated, progress)


def read_track(path: Path, *, units: str | None = None, brand: str | None = None) -> Track:
    """Read the poses of the hand over time from a table with the columns ``time_s`` and of the hand's pose.

    Args:
        path: file to read.
        units: length unit of columns without one.
        brand: robot brand whose convention the rotation follows, where the names do not state it.

    Raises:
        ReadingsError: the file is not such a table, or an entry is invalid.
    """
    with path.open("rb") as binary:
        start = binary.read(HEAD_BYTES)
    how = sniff(start, whole=len(start) < HEAD_BYTES)
    if how is None:
        raise ReadingsError(f"{path}: expected a table of hand poses as text, got a binary file. Export it as CSV.")
    with how.open(path) as text:
        lines = how.lines(text)
        rows = csv.reader(lines, strict=True, delimiter=how.delimiter, skipinitialspace=how.delimiter == " ")
        header = next(rows, None) or []
        place = f"{path}, line {lines.number}"
        columns = read_header(header, place, units=units, brand=brand, timed=True)
        table = Table(Sheet(path, columns, how, above=1), Stated(brand=brand))
        while chunk := list(islice(rows, CHUNK)):
            table.add(chunk)
        return table.track()


def _read_rows(
    path: Path, text: TextIO, how: TableText, stated: Stated, progress: Callable[[int], None] | None
) -> Readings:
    lines = how.lines(text)
    rows = csv.reader(lines, strict=True, delimiter=how.delimiter, skipinitialspace=how.delimiter == " ")
    try:
        header = next(rows, None)
        if header is None:
            raise ReadingsError(f"{path}: expected a header line, got an empty file. Name the columns in it.")
        while how.delimiter != "," and len(header) > 1 and not header[-1].strip():
            header.pop()
        header = how.with_groups(header)
        place = f"{path}, line {lines.number}"
        if how.unit is not None and stated.units not in (None, how.unit):
            raise UnitError(f"{path}: expected lengths in {how.unit}, as the file states, got --units {stated.units}.")
        second = next(rows, None)
        below = units_row(second, _UNITS) if second and len(second) >= len(header) else None
        rest: Iterator[list[str]] = rows if below is not None or second is None else chain([second], rows)
        above = 1 if below is None else 2
        below = below or units_of_cells(header, second or ())
        left = Excluded(len(header))
        rest = left.rows(rest)
        flat = with_height(header)
        if flat is not None:
            rest = (_with_height(row, len(flat)) for row in rest)
            below = None if below is None else [*below[: len(header)], below[_named_x(header)], ""]
            header = flat
        lists = find_lists(header, second)
        if lists is not None:
            rest, header = (lists.row(row) for row in rest), list(lists.header)
        analog = find_analog(header, place, stated.analog)
        if analog is not None:
            rest = analog.rows(rest)
            header[analog.index] = "range_mm"
        header = range_header(header, stated)
        frames = find_profiles(header, place, stated) or find_frames(header, place, stated) if above == 1 else None
        if frames is not None:
            rest, header, below = frames.rows(rest, len(header)), list(frames.header), None
        columns = read_header(
            header, place, units=stated.units or how.unit, brand=stated.brand, below=(below or ())[: len(header)],
            placed=stated.hand is not None, timed=isinstance(stated.hand, Track),
        )  # fmt: skip
        table = Table(Sheet(path, columns, how, above=above, frames=frames, excluded=left), stated)
        last: list[str] = []
        while chunk := list(islice(rest, CHUNK)):
            table.add(chunk)
            last = [row[len(columns) - 1].rstrip(_UNIT_LETTERS) for row in chunk[-_LAST:]]
            if progress is not None:
                progress(table.count)
    except csv.Error as error:
        raise _no_table(path, lines.number, how, error) from None
    if not lines.ended and lost_digits(last):
        raise ReadingsError(
            f"{path}, line {lines.number}: expected a complete last line, got a file that breaks off in "
            f"'{last[-1][:40]}', with fewer decimals than the cells above it. Copy or export it again; if the number "
            "is complete, end the line with a line break."
        )
    if not table.count:
        raise ReadingsError(f"{path}: expected at least one reading below the header, got none. Add rows.")
    return table.readings()


def _with_height(row: list[str], width: int) -> list[str]:
    """Return a row of a table of holes with the height 0, which is not used, and the kind of its rows."""
    while len(row) > width - 2 and not row[-1].strip():
        row = row[:-1]
    return [*row, "0", "circle"] if len(row) == width - 2 else row


def _named_x(header: Sequence[str]) -> int:
    """Return the index of the column x."""
    return next(k for k, name in enumerate(header) if canonical(name).split("_")[0] == "x")


def _no_table(path: Path, number: int, how: TableText, error: csv.Error) -> ReadingsError:
    """Return the error for a malformed CSV line; for an open quotation mark it names the line where it starts."""
    if "unexpected end" not in str(error):
        return ReadingsError(f"{path}, line {number}: expected comma-separated cells, got: {error}. Correct the line.")
    first = number
    with how.open(path) as text:
        lines = how.lines(text)
        rows = csv.reader(lines, strict=True, delimiter=how.delimiter)
        try:
            for _ in rows:
                first = lines.number + 1
        except csv.Error:
            pass
    return ReadingsError(
        f"{path}, line {first}: expected comma-separated cells, got a quotation mark that is never closed, from this "
        "line on. Close it or leave it out."
    )


def write_readings(readings: Readings, path: str | Path, *, unit: str = "mm", angle_unit: str = "deg") -> None:
    """Write a readings file without its empty columns.

    Args:
        readings: readings to write.
        path: file to write; replaced if it exists.
        unit: unit of all lengths: mm, m, um or in.
        angle_unit: unit of all angles: deg or rad.

    Raises:
        UnitError: a unit is unknown.
        OSError: the file cannot be written.
    """
    metres = units.length_unit(unit, "unit")
    radians = units.angle_unit(angle_unit, "angle_unit")
    columns: dict[str, list[Any]] = {"id": list(readings.ids)}
    for group, vectors, scale in (
        (POINT, readings.points, metres),
        (DIRECTION, readings.directions, 1.0),
        (NORMAL, readings.normals, 1.0),
    ):
        suffix = f"_{unit}" if group is POINT else ""
        columns |= _vector_cells([name + suffix for name in group], vectors, scale)
    columns[f"normal_sd_{angle_unit}"] = _cells(readings.normal_sds, radians)
    radii = Column.from_rows(readings.radii, readings.radii > 0)
    lengths = {"radius": radii, "sd": readings.sds, "across_sd": readings.across_sds}
    lengths |= {
        "range": readings.ranges,
        "true_distance": readings.true_distances,
        "max": readings.max_ranges,
        "hole_radius": readings.hole_radii,
    }
    columns |= {f"{name}_{unit}": _cells(values, metres) for name, values in lengths.items()}
    columns[f"half_angle_{angle_unit}"] = _cells(readings.half_angles, radians)
    hands = readings.Ts_world_hand.map(
        lambda Ts: np.concatenate([Ts[:, :3, 3] / metres, SO3.as_quaternion(Ts[:, :3, :3])], axis=1)
    )
    columns |= _vector_cells([name + (f"_{unit}" if i < 3 else "") for i, name in enumerate(HAND)], hands)
    columns |= {"feature": list(readings.features), "sensor": list(readings.sensors)}
    columns["kind"] = [kind if reading_kind(kind).is_stated else "" for kind in readings.kinds]
    columns |= {"side": list(readings.material_sides), "group": list(readings.groups)}
    columns["status"] = ["none" if free else "" for free in readings.is_free]
    columns = {name: cells for name, cells in columns.items() if any(cell != "" for cell in cells)}
    # without quotes an identifier that starts with # would be read as a comment
    marked = any(name.startswith("#") for name in readings.ids)
    with replaced(path) as file, file.open("w", encoding="utf-8", newline="") as text:
        writer = csv.writer(text, quoting=csv.QUOTE_ALL if marked else csv.QUOTE_MINIMAL, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def _cells(column: Column, scale: float = 1.0) -> list[Any]:
    """Return one cell for each reading, in units of the scale; empty for readings without the quantity."""
    values = iter((column.values / scale).tolist())
    return [next(values) if given else "" for given in column.given.tolist()]


def _vector_cells(names: Sequence[str], column: Column, scale: float = 1.0) -> dict[str, list[Any]]:
    """Return the cells of each component of a vector by its name."""
    return {name: _cells(Column(column.given, column.values[:, i]), scale) for i, name in enumerate(names)}
