"""The rows of a readings file, converted a chunk at a time; every complaint names file, line, column and value."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import NoReturn

import numpy as np

from tanteo.errors import ReadingsError, UnitError
from tanteo.io.assembling import LARGEST, assemble
from tanteo.io.columns import ANGLES, DIRECTION, NORMAL, OUTWARD, POINT, QUATERNION, Column, groups
from tanteo.io.hand_columns import ABB, hand_poses, skewed_row, stated_brand, way_of
from tanteo.io.poses import FULL_TURN, MANY_TURNS, in_radians
from tanteo.io.stated import Stated
from tanteo.logs import Lines, TableText
from tanteo.sensors import Readings, reading_kinds
from tanteo.typing import BoolArray, FloatArray

_LARGEST_TIP = 1.0
"""No tip has a larger radius [m]."""

_SHORTEST, _LONGEST = 1e-9, 1e9
"""Lengths that a direction may have; their squares are numbers still."""

_POSITIVE = ("sd", "across_sd", "range", "max", "normal_sd", "hole_radius", "hole_diameter", "half_angle")
_QUATERNION_SLACK = 1e-3
_OF_HOLES = "centres of holes and bosses are of kind circle, with side hole or boss"
_MEANT = {
    **dict.fromkeys(("hole", "bore", "boss", "arc", "slot"), _OF_HOLES),
    **dict.fromkeys(("ball", "socket", "dome"), "balls and hollows are of kind sphere, with side boss or hole"),
    **dict.fromkeys(("countersink", "taper", "chamfer"), "countersinks are of kind cone, with side hole"),
}
"""What is written for kinds, and what it is called here."""
_STATUSES, _SIDES = ("ok", "none"), ("hole", "boss")


class Table:
    """Collects converted chunks; every complaint names file, line, column and value."""

    def __init__(self, path: Path, columns: tuple[Column, ...], text: TableText, above: int = 1) -> None:
        """A table without rows yet.

        Args:
            path: The file.
            columns: As its header names them.
            text: How it is written.
            above: Rows above the first reading.
        """
        self.path, self.columns, self.count = path, columns, 0
        self._text, self._above = text, above
        self._numbers: dict[str, list[FloatArray]] = {c.base: [] for c in columns if not c.is_text and not c.left_out}
        self._texts: dict[str, list[str]] = {c.base: [] for c in columns if c.is_text}
        self._pool: dict[str, str] = {}
        self._written = {c.base: c.written for c in columns}
        self._ids: set[str] = set()

    def add(self, rows: list[list[str]]) -> None:
        """Convert and check one chunk of rows."""
        width = len(self.columns)
        if self._text.delimiter != ",":
            rows = [row[:width] if len(row) > width and not any(row[width:]) else row for row in rows]
        if set(map(len, rows)) != {width}:
            k = next(i for i, row in enumerate(rows) if len(row) != width)
            line = self.line_of(self.count + k)
            raise ReadingsError(
                f"{self.path}, line {line}: expected {width} cells as in the header, got {len(rows[k])} "
                f"('{','.join(rows[k])[:60]}'). Mind decimal commas and missing cells."
            )
        chunk: dict[str, FloatArray] = {}
        for column, cells in zip(self.columns, zip(*rows, strict=True), strict=True):
            if column.left_out:
                continue
            if column.is_text:
                self._texts[column.base] += self._names(column, cells)
            else:
                chunk[column.base] = self._floats(column, cells)
                self._numbers[column.base].append(chunk[column.base])
        self._check(chunk)
        self.count += len(rows)

    def _names(self, column: Column, cells: Sequence[str]) -> list[str]:
        pool = self._pool
        names = [cell.strip() for cell in cells]
        if column.base == "id":
            self._check_ids(names)
            return names
        valid = {"kind": reading_kinds(), "status": _STATUSES, "side": _SIDES}.get(column.base)
        if valid is not None and (strange := set(names) - {*valid, ""}):
            k = next(i for i, name in enumerate(names) if name in strange)
            meant = _MEANT.get(names[k].lower(), "") if column.base == "kind" else ""
            meant = "in small letters" if names[k].lower() in valid else meant
            self.fail(k, column.base, names[k], f"one of {', '.join(valid)}{f' ({meant})' if meant else ''}")
        return [pool.setdefault(name, name) for name in names]

    def _check_ids(self, names: list[str]) -> None:
        if "" in names:
            self.fail(names.index(""), "id", "", "a name in every row, or no column id")
        before = len(self._ids)
        self._ids.update(names)
        if len(self._ids) < before + len(names):
            seen = set(self._texts["id"])
            for k, name in enumerate(names):
                if name in seen:
                    self.fail(k, "id", name, "every reading to have its own")
                seen.add(name)

    def _floats(self, column: Column, cells: Sequence[str]) -> FloatArray:
        """Numbers of a column, NaN for empty cells."""
        if self._text.decimal_comma:
            cells = [cell.replace(",", ".") for cell in cells]
        values = np.empty(0)
        joined = "".join(cells)
        # float() would read 1_000 and digits of other scripts
        if joined.isascii() and "_" not in joined:
            try:
                values = np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
            except ValueError:
                values = np.empty(0)
        if not len(values) or not np.isfinite(values).all():
            values = self._floats_with_gaps(column, cells)
        return values * column.factor

    def _floats_with_gaps(self, column: Column, cells: Sequence[str]) -> FloatArray:
        values = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            if not (bare := cell.strip()):
                continue
            try:
                number = float(bare) if bare.isascii() and "_" not in bare else math.nan
            except ValueError:
                number = math.nan
            if not math.isfinite(number):
                self.fail(k, column.base, bare, "a finite number")
            values[k] = number
        return values

    def _check(self, chunk: dict[str, FloatArray]) -> None:
        for name in _POSITIVE:
            if name in chunk:
                self._require(~(chunk[name] <= 0), name, chunk, "a positive number")
        if "radius" in chunk:
            self._require(~(chunk["radius"] < 0), "radius", chunk, "zero or more")
            expected = f"{_LARGEST_TIP:g} m or less (is the unit in the column's name right?)"
            self._require(~(chunk["radius"] > _LARGEST_TIP), "radius", chunk, expected)
        for name in (*POINT, "range", "max", "hand_x", "hand_y", "hand_z"):
            if name in chunk:
                expected = (
                    f"within {LARGEST:g} m of the origin (is the unit in the column's name right?{self._hint(name)})"
                )
                self._require(~(np.abs(chunk[name]) > LARGEST), name, chunk, expected)
        self._check_turns(chunk)
        for group in groups(chunk):
            if group[0] in chunk:
                filled = np.stack([~np.isnan(chunk[name]) for name in group])
                for name, column in zip(group, filled, strict=True):
                    self._require(column | ~filled.any(axis=0), name, chunk, f"all of {', '.join(group)} or none")
        for group in (DIRECTION, NORMAL, OUTWARD):
            if group[0] in chunk:
                self._check_directions(chunk, group)
        for four in (QUATERNION, ABB):
            if four[0] in chunk:
                lengths = _norms(chunk, four)
                good = ~(np.abs(lengths - 1) > _QUATERNION_SLACK)
                self._require(good, four[0], chunk, f"a unit quaternion {four[0]} .. {four[-1]}", lengths)

    def _hint(self, name: str) -> str:
        """What is probably meant by metres that are too many."""
        factor = next(c.factor for c in self.columns if c.base == name)
        return f" Millimetres are {name}_mm" if factor == 1 else ""

    def _check_turns(self, chunk: dict[str, FloatArray]) -> None:
        """Refuse degrees under the name of radians, nobody turns by more than a full turn; and the other way round."""
        for column in self.columns:
            if column.base not in ANGLES or not column.written.lower().rstrip(")]").endswith("rad"):
                continue
            far = np.abs(chunk[column.base]) > FULL_TURN
            if far.any():
                self._wrong_angle(
                    column, chunk, far, f"{column.base}_deg", "rad is more than a full turn: are these degrees"
                )
        for name in (c.base for c in self.columns if c.base in ANGLES):
            self._require(~(np.abs(chunk[name]) > MANY_TURNS), name, chunk, "an angle of up to 36000 degrees")
        turned = [c for c in self.columns if c.base in way_of(chunk).names and c.base in ANGLES]
        degrees = [c for c in turned if c.factor != 1]
        if degrees and in_radians(np.concatenate([chunk[c.base] / c.factor for c in degrees])):
            worst = max(degrees, key=lambda c: np.nanmax(np.abs(chunk[c.base]), initial=0))
            far = np.abs(chunk[worst.base]) == np.nanmax(np.abs(chunk[worst.base]))
            self._wrong_angle(
                worst,
                chunk,
                far,
                f"{worst.base}_rad",
                "deg, and no angle beyond half a turn of radians: are these radians",
            )
        if turned and turned[0].base == "hand_rx" and turned[0].factor == 1:
            length = np.sqrt(sum((chunk[c.base] ** 2 for c in turned), start=np.zeros(())))
            self._require(~(length > FULL_TURN), "hand_rx", chunk, "a rotation vector of at most a full turn", length)

    def _wrong_angle(
        self, column: Column, chunk: dict[str, FloatArray], which: BoolArray, name: str, why: str
    ) -> NoReturn:
        k = int(np.argmax(which))
        row = self.count + k
        reading = self._texts["id"][row] if "id" in self._texts else str(row + 1)
        raise UnitError(
            f"{self.path}, line {self.line_of(row)}, {column.written} of reading '{reading}': "
            f"{chunk[column.base][k] / column.factor:.12g} {why}? Name the column {name}."
        )

    def _check_directions(self, chunk: dict[str, FloatArray], group: tuple[str, ...]) -> None:
        """Complain about the largest component of a direction that has none, or one too large to be squared."""
        each = np.abs(np.stack([chunk[name] for name in group]))
        largest, which = each.max(axis=0), each.argmax(axis=0)
        for good, expected in (
            (~(largest < _SHORTEST), "a direction that is not zero"),
            (~(largest > _LONGEST), f"components of a direction, up to {_LONGEST:g}"),
        ):
            if not good.all():
                self._require(good, group[which[np.flatnonzero(~good)[0]]], chunk, expected)

    def _require(
        self, good: BoolArray, name: str, chunk: dict[str, FloatArray], expected: str, lengths: FloatArray | None = None
    ) -> None:
        if good.all():
            return
        k = int(np.flatnonzero(~good)[0])
        factor = next(c.factor for c in self.columns if c.base == name)
        value = f"{chunk[name][k] / factor:.12g}" if not np.isnan(chunk[name][k]) else ""
        if lengths is not None:
            value = f"length {lengths[k]:.6g}"
        self.fail(k, name, value, expected)

    def fail(self, row: int, name: str, value: str, expected: str) -> NoReturn:
        """Complain about a cell of the current chunk."""
        got = f"'{value}'" if value else "an empty cell"
        raise ReadingsError(
            f"{self.path}, line {self.line_of(self.count + row)}, column '{self._written[name]}': "
            f"expected {expected}, got {got}. Correct the file."
        )

    def _check_free(self, ranges: FloatArray | None) -> None:
        """Complain about rows that say both that nothing was met and what was."""
        if "status" not in self._texts:
            return
        status = np.array(self._texts["status"], dtype=object)
        kinds = np.array(self._texts.get("kind", [""] * len(status)), dtype=object)
        free = status == "none"
        self._contradicts((status == "ok") & (kinds == "free"), "status none of a beam of kind free, got 'ok'")
        self._contradicts(free & ~np.isin(kinds, ["", "free", "point"]), "kind free of a beam with status none")
        if ranges is not None:
            self._contradicts(free & ~np.isnan(ranges), "no range of a beam with status none, got one")

    def _contradicts(self, wrong: BoolArray, expected: str) -> None:
        if wrong.any():
            line = self.line_of(int(np.argmax(wrong)))
            advice = "Status none says that nothing was met: correct it, or what is said beside it."
            raise ReadingsError(f"{self.path}, line {line}: expected {expected}. {advice}")

    def line_of(self, row: int) -> int:
        """Line number of a row of the table, found by reading the file again: only complaints pay for it."""
        with self._text.open(self.path) as text:
            lines = Lines(text)
            rows = csv.reader(lines, strict=True, delimiter=self._text.delimiter)
            next(islice(rows, row + self._above, None), None)
            return lines.number

    def readings(self, stated: Stated) -> Readings:
        """The whole table as readings, once all rows are in.

        Raises:
            ReadingsError: What the rows say together is no set of readings, or not with what was stated.
        """
        numbers = {base: np.concatenate(chunks) for base, chunks in self._numbers.items()}

        def vectors(group: tuple[str, ...]) -> FloatArray | None:
            return np.stack([numbers[name] for name in group], axis=-1) if group[0] in numbers else None

        status = self._texts.get("status")
        self._check_free(numbers.get("range"))
        columns = {
            "points": vectors(POINT), "ids": self._texts.get("id"), "directions": vectors(DIRECTION),
            "normals": vectors(NORMAL), "normal_sds": numbers.get("normal_sd"), "sds": numbers.get("sd"),
            "across_sds": numbers.get("across_sd"), "radii": numbers.get("radius"),
            "features": self._texts.get("feature"), "kinds": self._texts.get("kind"),
            "Ts_world_hand": hand_poses(numbers, self._brand(numbers, stated)), "ranges": numbers.get("range"),
            "sensors": self._texts.get("sensor"), "max_ranges": numbers.get("max"),
            "is_free": None if status is None else np.array([s == "none" for s in status]),
            "hole_radii": self._hole_radii(numbers), "material_sides": self._texts.get("side"),
        }  # fmt: skip
        said = self._text.said()
        left = [c.written for c in self.columns if c.left_out]
        notes = [said] if said else []
        notes += [f"Columns left out: {', '.join(left)}."] if left else []
        return assemble(columns, self.count, stated, str(self.path), notes, outward=vectors(OUTWARD))

    def _hole_radii(self, numbers: dict[str, FloatArray]) -> FloatArray | None:
        """Sizes of holes and bosses, half angles of cones; two of one row are refused."""
        scales = {"hole_radius": 1.0, "hole_diameter": 0.5, "half_angle": 1.0}
        given = [numbers[name] * scale for name, scale in scales.items() if name in numbers]
        if not given:
            return None
        several = np.sum(~np.isnan(given), axis=0) > 1
        if several.any():
            raise ReadingsError(
                f"{self.path}, line {self.line_of(int(np.argmax(several)))}: expected the radius or the diameter of "
                "the hole, or the half angle of a cone, got two of them. Keep one."
            )
        return np.asarray(np.fmax.reduce(given))

    def _brand(self, numbers: dict[str, FloatArray], stated: Stated) -> str:
        """Who writes the hand's rotation so; a matrix that is none is refused."""
        if (row := skewed_row(numbers)) is not None:
            raise ReadingsError(
                f"{self.path}, line {self.line_of(row)}: expected a rotation matrix, got one that scales, shears or "
                "mirrors. Correct it."
            )
        return stated_brand(numbers, stated.brand, str(self.path))


def _norms(chunk: dict[str, FloatArray], group: tuple[str, ...]) -> FloatArray:
    return np.sqrt(sum((chunk[name] ** 2 for name in group), start=np.zeros(())))
