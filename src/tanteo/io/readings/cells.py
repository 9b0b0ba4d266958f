"""Check the numbers of a readings file, and locate each cell for error messages."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import NoReturn

import numpy as np

from tanteo.errors import ReadingsError, UnitError
from tanteo.geometry.typing import BoolArray, FloatArray
from tanteo.io.documents.schema import show
from tanteo.io.logs.table_text import TableText
from tanteo.io.poses.poses import FULL_TURN, MANY_TURNS, in_radians
from tanteo.io.readings.assembling import LARGEST
from tanteo.io.readings.columns import ANGLES, DIRECTION, NORMAL, OUTWARD, POINT, QUATERNION, Column, groups
from tanteo.io.readings.frames import Frames
from tanteo.io.readings.hand_columns import ABB, notation_of
from tanteo.io.readings.profiles import Profiles
from tanteo.io.readings.range_rows import RangeRows
from tanteo.io.readings.row_checks import Excluded

_LARGEST_TIP = 1.0
"""Largest accepted tip radius [m]."""

_SHORTEST, _LONGEST = 1e-9, 1e9
"""Smallest and largest accepted length of a direction vector; its square must stay in range."""

_POSITIVE = (
    "sd",
    "across_sd",
    "range",
    "true_distance",
    "max",
    "normal_sd",
    "hole_radius",
    "hole_diameter",
    "half_angle",
)
_QUATERNION_SLACK = 1e-3
_UNIT_RIGHT = "is the unit in the column's name right?"


@dataclass(frozen=True, eq=False)
class Sheet:
    """Table file as error messages refer to it.

    Attributes:
        path: path of the file.
        columns: columns as named in the header.
        text: encoding, delimiter and decimal sign of the file.
        above: number of rows above the first reading.
        frames: columns of a table of frames, of which each row holds one reading of each zone; None for other tables.
        excluded: rows that are no readings.
    """

    path: Path
    columns: tuple[Column, ...]
    text: TableText
    above: int
    frames: Frames | RangeRows | Profiles | None = None
    excluded: Excluded = field(default_factory=lambda: Excluded(0))

    @cached_property
    def by_base(self) -> Mapping[str, Column]:
        """Columns by name without unit."""
        return {column.base: column for column in self.columns}

    def place(self, row: int) -> str:
        """Return file name and line number of a table row for an error message, by reading the file again.

        Args:
            row: index of the row below the header.
        """
        row = row if self.frames is None else row // len(self.frames.zones)  # for profiles: not before this row
        with self.text.open(self.path) as text:
            lines = self.text.lines(text)
            rows = csv.reader(lines, strict=True, delimiter=self.text.delimiter)
            next(islice(Excluded(len(self.columns)).rows(rows), row + self.above, None), None)
            return self.text.place(self.path, lines.number)

    def refuse(self, row: int, name: str, value: str, expected: str) -> NoReturn:
        """Raise an error about one cell.

        Args:
            row: index of the row below the header.
            name: name of the column without unit.
            value: text of the cell; empty for an empty cell.
            expected: accepted values, as text.

        Raises:
            ReadingsError: always.
        """
        got = f"'{show(value)}'" if value else "an empty cell"
        raise ReadingsError(
            f"{self.place(row)}, column '{self.column(name, row)}': expected {expected}, got {got}. Correct the file."
        )

    def column(self, name: str, row: int) -> str:
        """Return the name of a column as written in the file.

        Args:
            name: name of the column without unit.
            row: index of the row below the header.
        """
        if self.frames is not None and name == "range":
            return self.frames.shown
        return self.by_base[name].written


@dataclass(frozen=True, slots=True, eq=False)
class Numbers:
    """Numeric columns of consecutive table rows.

    Attributes:
        sheet: file that contains the rows.
        first: table index of the first row.
        ids: identifiers of all table rows up to the last of these; None if the table has none.
        values: numbers by column name, NaN for empty cells.
    """

    sheet: Sheet
    first: int
    ids: Sequence[str] | None
    values: Mapping[str, FloatArray]

    def check(self) -> None:
        """Check that numbers are in range, groups of columns are complete, and units are plausible.

        Raises:
            ReadingsError: a number is invalid; the message names file, line, column and value.
            UnitError: an angle is probably in another unit than its column states.
        """
        for name in _POSITIVE:
            if name in self.values:
                self._require(~(self.values[name] <= 0), name, "a positive number")
        if "radius" in self.values:
            radii = self.values["radius"]
            self._require(~(radii < 0), "radius", "zero or more")
            self._require(~(radii > _LARGEST_TIP), "radius", f"{_LARGEST_TIP:g} m or less ({_UNIT_RIGHT})")
        for name in (*POINT, "range", "max", "hand_x", "hand_y", "hand_z"):
            if name in self.values:
                meant = f" Millimetres are {name}_mm" if self.sheet.by_base[name].factor == 1 else ""
                expected = f"within {LARGEST:g} m of the origin ({_UNIT_RIGHT}{meant})"
                self._require(~(np.abs(self.values[name]) > LARGEST), name, expected)
        self._check_turns()
        self._check_groups()

    def _check_groups(self) -> None:
        """Refuse rows with incomplete groups, directions without length, and quaternions that are not unit."""
        for group in groups(self.values):
            if group[0] in self.values:
                filled = np.stack([~np.isnan(self.values[name]) for name in group])
                for name, column in zip(group, filled, strict=True):
                    self._require(column | ~filled.any(axis=0), name, f"all of {', '.join(group)} or none")
        for group in (DIRECTION, NORMAL, OUTWARD):
            if group[0] in self.values:
                self._check_directions(group)
        for four in (QUATERNION, ABB):
            if four[0] in self.values:
                lengths = self._lengths(four)
                good = ~(np.abs(lengths - 1) > _QUATERNION_SLACK)
                self._require(good, four[0], f"a unit quaternion {four[0]} .. {four[-1]}", lengths)

    def _check_directions(self, group: tuple[str, ...]) -> None:
        """Refuse directions that are zero, or too large to be squared, naming the largest component."""
        each = np.abs(np.stack([self.values[name] for name in group]))
        largest = each.max(axis=0)
        which = each.argmax(axis=0)
        for good, expected in (
            (~(largest < _SHORTEST), "a direction that is not zero"),
            (~(largest > _LONGEST), f"components of a direction, up to {_LONGEST:g}"),
        ):
            if not good.all():
                self._require(good, group[which[np.flatnonzero(~good)[0]]], expected)

    def _check_turns(self) -> None:
        """Refuse degrees in columns of radians, and radians in columns of degrees."""
        angles = [column for column in self.sheet.columns if column.base in ANGLES]
        for column in angles:
            if column.written.lower().rstrip(")]").endswith("rad"):
                far = np.abs(self.values[column.base]) > FULL_TURN
                self._require_unit(~far, column, "deg", "rad is more than a full turn: are these degrees")
        for column in angles:
            few = ~(np.abs(self.values[column.base]) > MANY_TURNS)
            self._require(few, column.base, "an angle of up to 36000 degrees")
        turned = [column for column in angles if column.base in notation_of(self.values).names]
        degrees = [column for column in turned if column.factor != 1]
        if degrees and in_radians(np.concatenate([self.values[c.base] / c.factor for c in degrees])):
            sizes = [np.nanmax(np.abs(self.values[c.base]), initial=0) for c in degrees]
            worst = degrees[int(np.argmax(sizes))]
            nearer = np.abs(self.values[worst.base]) != max(sizes)
            why = "deg, and no angle beyond half a turn of radians: are these radians"
            self._require_unit(nearer, worst, "rad", why)
        if turned and turned[0].base == "hand_rx" and turned[0].factor == 1:
            lengths = self._lengths([column.base for column in turned])
            self._require(~(lengths > FULL_TURN), "hand_rx", "a rotation vector of at most a full turn", lengths)

    def _lengths(self, group: Sequence[str]) -> FloatArray:
        return np.sqrt(sum((self.values[name] ** 2 for name in group), start=np.zeros(())))

    def _require(self, good: BoolArray, name: str, expected: str, lengths: FloatArray | None = None) -> None:
        if good.all():
            return
        k = int(np.flatnonzero(~good)[0])
        number = self.values[name][k]
        value = f"{number / self.sheet.by_base[name].factor:.12g}" if not np.isnan(number) else ""
        value = value if lengths is None else f"length {lengths[k]:.6g}"
        self.sheet.refuse(self.first + k, name, value, expected)

    def _require_unit(self, good: BoolArray, column: Column, unit: str, why: str) -> None:
        if good.all():
            return
        k = int(np.argmin(good))
        row = self.first + k
        raise UnitError(
            f"{self.sheet.place(row)}, {column.written} of reading '{self.ids[row] if self.ids else row + 1}': "
            f"{self.values[column.base][k] / column.factor:.12g} {why}? Name the column {column.base}_{unit}."
        )
