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
from tanteo.io.columns import (
    ANGLES,
    DIRECTION,
    NORMAL,
    POINT,
    QUATERNION,
    ROLL_PITCH_YAW,
    VECTOR,
    Column,
    Lines,
    groups,
    hand_group,
)
from tanteo.io.poses import pose_from_brand
from tanteo.lie import SE3, SO3
from tanteo.sensors import Readings, check_features, reading_kinds
from tanteo.typing import BoolArray, FloatArray

LARGEST = 100.0
"""Coordinates and ranges beyond this [m] are a wrong unit, not a robot cell."""

_LARGEST_TIP = 1.0
"""No tip has a larger radius [m]."""

_SHORTEST, _LONGEST = 1e-9, 1e9
"""Lengths that a direction may have; their squares are numbers still."""

_POSITIVE = ("sd", "across_sd", "range", "max", "normal_sd")
_QUATERNION_SLACK = 1e-3
_FULL_TURN = 2.02 * np.pi
"""No angle in radians is larger: a full turn, and a little beyond it."""

_WRITTEN_AS: dict[tuple[str, ...], str] = {VECTOR: "ur", ROLL_PITCH_YAW: "paper"}
"""Who writes rotations so, in radians behind metres."""

_STATUSES = ("ok", "none")


class Table:
    """Collects converted chunks; every complaint names file, line, column and value."""

    def __init__(self, path: Path, columns: tuple[Column, ...]) -> None:
        self.path, self.columns, self.count = path, columns, 0
        self._numbers: dict[str, list[FloatArray]] = {c.base: [] for c in columns if not c.is_text}
        self._texts: dict[str, list[str]] = {c.base: [] for c in columns if c.is_text}
        self._pool: dict[str, str] = {}
        self._written = {c.base: c.written for c in columns}
        self._ids: set[str] = set()

    def add(self, rows: list[list[str]]) -> None:
        """Convert and check one chunk of rows."""
        width = len(self.columns)
        if set(map(len, rows)) != {width}:
            k = next(i for i, row in enumerate(rows) if len(row) != width)
            line = self.line_of(self.count + k)
            raise ReadingsError(
                f"{self.path}, line {line}: expected {width} cells as in the header, got {len(rows[k])} "
                f"('{','.join(rows[k])[:60]}'). Mind decimal commas and missing cells."
            )
        chunk: dict[str, FloatArray] = {}
        for column, cells in zip(self.columns, zip(*rows, strict=True), strict=True):
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
        valid = {"kind": reading_kinds(), "status": _STATUSES}.get(column.base)
        if valid is not None and (strange := set(names) - {*valid, ""}):
            k = next(i for i, name in enumerate(names) if name in strange)
            self.fail(k, column.base, names[k], f"one of {', '.join(valid)}")
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
                expected = f"within {LARGEST:g} m of the origin (is the unit in the column's name right?)"
                self._require(~(np.abs(chunk[name]) > LARGEST), name, chunk, expected)
        self._check_turns(chunk)
        for group in groups(chunk):
            if group[0] in chunk:
                filled = np.stack([~np.isnan(chunk[name]) for name in group])
                for name, column in zip(group, filled, strict=True):
                    self._require(column | ~filled.any(axis=0), name, chunk, f"all of {', '.join(group)} or none")
        for group in (DIRECTION, NORMAL):
            if group[0] in chunk:
                self._check_directions(chunk, group)
        if "hand_qw" in chunk:
            lengths = _norms(chunk, QUATERNION)
            good = ~(np.abs(lengths - 1) > _QUATERNION_SLACK)
            self._require(good, "hand_qw", chunk, "a unit quaternion hand_qw .. hand_qz", lengths)

    def _check_turns(self, chunk: dict[str, FloatArray]) -> None:
        """Refuse degrees under the name of radians: nobody turns by more than a full turn."""
        for column in self.columns:
            if column.base not in ANGLES or not column.written.endswith("_rad"):
                continue
            far = np.abs(chunk[column.base]) > _FULL_TURN
            if far.any():
                k = int(np.argmax(far))
                row = self.count + k
                reading = self._texts["id"][row] if "id" in self._texts else str(row + 1)
                raise UnitError(
                    f"{self.path}, line {self.line_of(row)}, {column.written} of reading '{reading}': "
                    f"{chunk[column.base][k]:.12g} rad is more than a full turn: are these degrees? Name the column "
                    f"{column.base}_deg."
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
        with self.path.open(encoding="utf-8-sig", newline="") as text:
            lines = Lines(text)
            rows = csv.reader(lines, strict=True)
            next(islice(rows, row + 1, None), None)
            return lines.number

    def readings(self) -> Readings:
        """The whole table as readings, once all rows are in."""
        numbers = {base: np.concatenate(chunks) for base, chunks in self._numbers.items()}

        def vectors(group: tuple[str, ...]) -> FloatArray | None:
            return np.stack([numbers[name] for name in group], axis=-1) if group[0] in numbers else None

        hand = hand_group(numbers)
        status = self._texts.get("status")
        self._check_free(numbers.get("range"))
        radii = numbers.get("radius")
        try:
            readings = Readings.from_columns(
                vectors(POINT),
                n=self.count,
                ids=self._texts.get("id"),
                directions=vectors(DIRECTION),
                normals=vectors(NORMAL),
                normal_sds=numbers.get("normal_sd"),
                sds=numbers.get("sd"),
                across_sds=numbers.get("across_sd"),
                radii=None if radii is None else np.nan_to_num(radii),
                features=self._texts.get("feature"),
                kinds=self._texts.get("kind"),
                Ts_world_hand=_poses(vectors(hand), hand[3:]),
                ranges=numbers.get("range"),
                sensors=self._texts.get("sensor"),
                is_free=None if status is None else np.array([s == "none" for s in status]),
                max_ranges=numbers.get("max"),
                source=str(self.path),
            )
            check_features(readings)
        except ReadingsError as error:
            raise ReadingsError(f"{self.path}: {error}") from None
        return readings


def _norms(chunk: dict[str, FloatArray], group: tuple[str, ...]) -> FloatArray:
    return np.sqrt(sum((chunk[name] ** 2 for name in group), start=np.zeros(())))


def _poses(hands: FloatArray | None, way: tuple[str, ...]) -> FloatArray | None:
    """Poses of rows of a place and a rotation, which is written in one of the ways."""
    if hands is None:
        return None
    Ts = np.full((len(hands), 4, 4), np.nan)
    given = ~np.isnan(hands[:, 0])
    if way == QUATERNION:
        Ts[given] = SE3.from_parts(SO3.from_quaternion(hands[given, 3:]), hands[given, :3])
    else:
        Ts[given] = pose_from_brand(_WRITTEN_AS[way], hands[given])
    return Ts
