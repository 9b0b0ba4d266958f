"""Convert the rows of a readings file in chunks; error messages name file, line, column and value."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.geometry.typing import BoolArray, FloatArray
from tanteo.io.logs.log import counted
from tanteo.io.poses.transforms import Track
from tanteo.io.readings.assembling import TIME, assemble, rows_of, step_of
from tanteo.io.readings.cells import Numbers, Sheet
from tanteo.io.readings.columns import DIRECTION, LENGTHS, NORMAL, OUTWARD, POINT, Column
from tanteo.io.readings.hand_columns import PLACE, hand_poses, skewed_row, stated_brand
from tanteo.io.readings.profiles import Profiles
from tanteo.io.readings.range_codes import decode, is_code, note_on_codes, refuse_strange
from tanteo.io.readings.stated import Stated
from tanteo.io.readings.units import LENGTH_UNITS
from tanteo.sensors import Readings
from tanteo.sensors.kinds import reading_kinds

_OF_HOLES = "centres of holes and bosses are of kind circle, with side hole or boss"
_MEANT = {
    **dict.fromkeys(("hole", "bore", "boss", "arc", "slot"), _OF_HOLES),
    **dict.fromkeys(("ball", "socket", "dome"), "balls and hollows are of kind sphere, with side boss or hole"),
    **dict.fromkeys(("countersink", "taper", "chamfer"), "countersinks are of kind cone, with side hole"),
}
"""Advice for words that are written in place of a reading kind."""
_UNIT_SLACK = 0.02
"""Largest relative difference between lengths of directions that rounding explains."""
_SHORT = 0.5
"""Length below which equal vectors are no directions, which programs write with length one."""
_FEW = 3
"""Smallest number of vectors whose lengths are judged."""
_SHOWN = 20
"""Largest number of excluded columns that a note lists."""
_WITH_UNIT = re.compile(r"([-+]?(?:\d+(?:\.\d*)?|\.\d+))\s*(mm|cm|m|um|in|[\"″])")
_METRES = {**LENGTH_UNITS, "cm": 1e-2, '"': LENGTH_UNITS["in"], "″": LENGTH_UNITS["in"]}
INVALID = "invalid"
"""Status of a row without a measurement, which is excluded."""
_STATUSES, _SIDES = ("ok", "none", INVALID), ("hole", "boss")


def _are_deviations(vectors: FloatArray | None) -> bool:
    """Return whether vectors are short, as deviations ``dX dY dZ`` from the nominal points are, and no directions."""
    if vectors is None:
        return False
    lengths = np.linalg.norm(vectors, axis=1)
    lengths = lengths[np.isfinite(lengths)]
    if len(lengths) < _FEW:
        return False
    varied = bool(np.ptp(lengths) > _UNIT_SLACK * lengths.max())
    return bool(lengths.max() < (1 - _UNIT_SLACK if varied else _SHORT))


def _without_unit(cell: str, metre: float) -> str:
    """Return a cell such as ``142 mm`` as a number in the unit of its column."""
    match = _WITH_UNIT.fullmatch(cell.strip())
    return cell if match is None else f"{float(match[1]) * _METRES[match[2]] / metre:.12g}"


class Table:
    """Collector of converted rows of a readings file."""

    def __init__(self, sheet: Sheet, stated: Stated) -> None:
        """Create a table without rows.

        Args:
            sheet: file and its columns.
            stated: options for what the file does not contain.
        """
        self.sheet, self.stated, self.count = sheet, stated, 0
        self._marks: list[str] = []
        self._words: dict[tuple[str, str], None] = {}
        self._numbers: dict[str, list[FloatArray]] = {
            c.base: [] for c in sheet.columns if not c.is_text and not c.left_out
        }
        self._texts: dict[str, list[str]] = {c.base: [] for c in sheet.columns if c.is_text}
        self._pool: dict[str, str] = {}
        self._ids: set[str] = set()
        self._counts: dict[str, int] = {}

    def add(self, rows: list[list[str]]) -> None:
        """Convert and check one chunk of rows.

        Args:
            rows: cells by row.

        Raises:
            ReadingsError: a row or a cell is invalid.
            UnitError: an angle is probably in another unit than its column states.
        """
        columns = self.sheet.columns
        width = len(self.sheet.columns)
        if self.sheet.text.delimiter != ",":
            rows = [row[:width] if len(row) > width and not any(row[width:]) else row for row in rows]
        if set(map(len, rows)) != {width}:
            k = next(i for i, row in enumerate(rows) if len(row) != width)
            raise ReadingsError(
                f"{self.sheet.place(self.count + k)}: expected {width} cells as in the header, got {len(rows[k])} "
                f"('{','.join(rows[k])[:60]}'). Mind decimal commas and missing cells."
            )
        chunk: dict[str, FloatArray] = {}
        written = dict(zip([column.base for column in columns], zip(*rows, strict=True), strict=True))
        if "range" in written:
            written["range"] = tuple(self._distances(written))
        for column in columns:
            cells = written[column.base]
            if column.left_out:
                continue
            if column.is_text:
                self._texts[column.base] += self._names(column, cells)
            else:
                chunk[column.base] = self._floats(column, cells)
                self._numbers[column.base].append(chunk[column.base])
        Numbers(self.sheet, self.count, self._texts.get("id"), chunk).check()
        self.count += len(rows)

    def _distances(self, written: dict[str, tuple[str, ...]]) -> list[str]:
        """Return the range cells of a chunk without codes, whose meanings are kept as marks of the rows."""
        cells = list(written["range"])
        if self.sheet.text.decimal_comma:
            cells = [cell.replace(",", ".") for cell in cells]
        if any(cell.endswith("m") for cell in cells):
            cells = [_without_unit(cell, self.sheet.by_base["range"].factor) for cell in cells]
        status = [cell.strip() for cell in written.get("status", [""] * len(cells))]
        # a row that states to be invalid may have any range; a free beam has none, or a code
        cells = ["" if s == INVALID or (s == "none" and is_code(c)) else c for c, s in zip(cells, status, strict=True)]
        found = decode(cells, written.get("sensor"), self.sheet.by_base["range"].factor, self.stated)
        if found.strange is not None:
            row = self.count + found.strange
            refuse_strange(f"{self.sheet.place(row)}, column '{self.sheet.column('range', row)}'", found)
        self._words.update(dict.fromkeys(found.words))
        self._marks += found.marks
        return found.cells

    def _names(self, column: Column, cells: Sequence[str]) -> list[str]:
        pool = self._pool
        names = [cell.strip() for cell in cells]
        if column.base == "id":
            if column.written.strip().lower() != "id":  # a name of a feature may repeat, an id may not
                names = self._numbered(names)
            self._check_ids(names)
            return names
        valid = {"kind": reading_kinds(), "status": _STATUSES, "side": _SIDES}.get(column.base)
        if valid is not None and (strange := set(names) - {*valid, ""}):
            k = next(i for i, name in enumerate(names) if name in strange)
            meant = _MEANT.get(names[k].lower(), "") if column.base == "kind" else ""
            meant = "in small letters" if names[k].lower() in valid else meant
            self.sheet.refuse(
                self.count + k, column.base, names[k], f"one of {', '.join(valid)}{f' ({meant})' if meant else ''}"
            )
        return [pool.setdefault(name, name) for name in names]

    def _numbered(self, names: list[str]) -> list[str]:
        """Return names in which empty and repeated ones are numbered."""
        out = list[str]()
        for k, name in enumerate(names, start=self.count + 1):
            own = name or str(k)
            self._counts[own] = self._counts.get(own, 0) + 1
            out.append(own if self._counts[own] == 1 else f"{own}.{self._counts[own]}")
        return out

    def _check_ids(self, names: list[str]) -> None:
        if "" in names:
            self.sheet.refuse(self.count + names.index(""), "id", "", "a name in every row, or no column id")
        before = len(self._ids)
        self._ids.update(names)
        if len(self._ids) < before + len(names):
            seen = set(self._texts["id"])
            for k, name in enumerate(names):
                if name in seen:
                    self.sheet.refuse(self.count + k, "id", name, "every reading to have its own")
                seen.add(name)

    def _floats(self, column: Column, cells: Sequence[str]) -> FloatArray:
        """Return the numbers of a column in SI units, with NaN for empty cells."""
        if self.sheet.text.decimal_comma:
            cells = [cell.replace(",", ".") for cell in cells]
        values = np.empty(0)
        joined = "".join(cells)
        # float() also accepts 1_000 and digits of other scripts
        if joined.isascii() and "_" not in joined:
            with suppress(ValueError):
                values = np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
        if not len(values) or not np.isfinite(values).all():
            values = self._floats_with_gaps(column, cells)
        return values * column.factor

    def _floats_with_gaps(self, column: Column, cells: Sequence[str]) -> FloatArray:
        values = np.full(len(cells), np.nan)
        for k, cell in enumerate(cells):
            if not (bare := cell.strip().replace("−", "-")):
                continue
            match = _WITH_UNIT.fullmatch(bare) if column.base in LENGTHS else None
            bare = match[1] if match and _METRES[match[2]] == column.factor else bare
            try:
                number = float(bare) if bare.isascii() and "_" not in bare else math.nan
            except ValueError:
                number = math.nan
            if not math.isfinite(number):
                self.sheet.refuse(self.count + k, column.base, bare, "a finite number")
            values[k] = number
        return values

    def _check_free(self, ranges: FloatArray | None, statuses: list[str] | None) -> None:
        """Refuse rows that state both that nothing was hit and what was hit."""
        if statuses is None:
            return
        status = np.array(statuses, dtype=object)
        kinds = np.array(self._texts.get("kind", [""] * len(status)), dtype=object)
        free = status == "none"
        self._contradicts((status == "ok") & (kinds == "free"), "status none of a beam of kind free, got 'ok'")
        self._contradicts(free & ~np.isin(kinds, ["", "free", "point"]), "kind free of a beam with status none")
        if ranges is not None:
            self._contradicts(free & ~np.isnan(ranges), "no range of a beam with status none, got one")

    def _contradicts(self, wrong: BoolArray, expected: str) -> None:
        if wrong.any():
            advice = "Status none means that the beam hit nothing. Correct the status or the other columns."
            raise ReadingsError(f"{self.sheet.place(int(np.argmax(wrong)))}: expected {expected}. {advice}")

    def _statuses(self) -> list[str] | None:
        """Return the status of each row, from the column and from codes in the ranges; None if there are neither."""
        own = self._texts.get("status")
        if not any(self._marks):
            return own
        return [mark or word for mark, word in zip(self._marks, own or self._marks, strict=True)]

    def readings(self) -> Readings:
        """Return the whole table as readings, after all rows were added; rows without a measurement are excluded.

        Raises:
            ReadingsError: the rows contradict each other or the stated options.
        """
        numbers = {base: np.concatenate(chunks) for base, chunks in self._numbers.items()}

        def vectors(group: tuple[str, ...]) -> FloatArray | None:
            return np.stack([numbers[name] for name in group], axis=-1) if group[0] in numbers else None

        directions = vectors(DIRECTION)
        deviations = _are_deviations(directions)
        status = self._statuses()
        self._check_free(numbers.get("range"), status)
        columns = {
            "points": vectors(POINT), "ids": self._texts.get("id"), "directions": None if deviations else directions,
            "normals": vectors(NORMAL), "normal_sds": numbers.get("normal_sd"), "sds": numbers.get("sd"),
            "across_sds": numbers.get("across_sd"), "radii": numbers.get("radius"),
            "features": self._texts.get("feature"), "kinds": self._texts.get("kind"),
            "Ts_world_hand": hand_poses(numbers, self._brand(numbers, self.stated)), "ranges": numbers.get("range"),
            "true_distances": numbers.get("true_distance"), "sensors": self._texts.get("sensor"),
            "max_ranges": numbers.get("max"),
            "is_free": None if status is None else np.array([s == "none" for s in status]),
            "hole_radii": self._hole_radii(numbers), "half_angles": numbers.get("half_angle"),
            "material_sides": self._texts.get("side"), "groups": self._texts.get("group"),
            TIME: numbers.get(TIME),
        }  # fmt: skip
        note = self.sheet.text.note()
        left = [c.written or "(no name)" for c in self.sheet.columns if c.left_out and not c.advice]
        notes = [*([note] if note else []), *self.sheet.excluded.notes()]
        more = f" and {len(left) - _SHOWN} more" if len(left) > _SHOWN else ""
        notes += [f"Columns excluded: {', '.join(left[:_SHOWN])}{more}."] if left else []
        if deviations:
            written = ", ".join(self.sheet.by_base[name].written for name in DIRECTION)
            notes.append(f"Columns {written} are excluded as deviations: directions have one length, such as 1.")
        notes += [f"Column '{c.written}' was excluded.{c.advice}" for c in self.sheet.columns if c.advice]
        notes += [] if self.sheet.frames is None else self.sheet.frames.notes
        if words := note_on_codes(tuple(self._words), self._marks):
            notes.append(words)
        kept = [k for k, word in enumerate(status or ()) if word != INVALID]
        outward = vectors(OUTWARD)
        n = self.count
        if status is not None and len(kept) < n:
            if not kept:
                raise ReadingsError(f"{self.sheet.path}: expected at least one measurement, got {n} invalid rows.")
            columns = {name: rows_of(values, kept) for name, values in columns.items()}
            outward = None if outward is None else outward[kept]
            stated_invalid = (self._texts.get("status") or []).count(INVALID)
            if stated_invalid:
                notes.append(f"Excluded: {counted(stated_invalid, 'row')} of status invalid.")
            n = len(kept)
        return assemble(
            columns, n, self.stated, str(self.sheet.path), notes, outward=outward, step=self._step(numbers),
            profiled=isinstance(self.sheet.frames, Profiles),
        )  # fmt: skip

    def _step(self, numbers: dict[str, FloatArray]) -> float:
        """Return the step to which coordinates are rounded [m]; 0 if unknown."""
        names = next((group for group in (POINT, PLACE) if group[0] in numbers), ())
        if not names:
            return 0.0
        unit = self.sheet.by_base[names[0]].factor
        return step_of(np.stack([numbers[name] / unit for name in names]), unit)

    def track(self) -> Track:
        """Return the poses of the hand over time.

        Raises:
            ReadingsError: there are no rows, or a row lacks its time or pose.
        """
        numbers = {base: np.concatenate(chunks) for base, chunks in self._numbers.items() if chunks}
        Ts = hand_poses(numbers, self._brand(numbers, self.stated))
        if Ts is None or not np.isfinite(numbers[TIME]).all() or not np.isfinite(Ts).all():
            raise ReadingsError(
                f"{self.sheet.path}: expected rows with a time and a pose of the hand, got none or empty cells. "
                "Correct the file."
            )
        return Track.of(list(zip(numbers[TIME].tolist(), Ts, strict=True)))

    def _hole_radii(self, numbers: dict[str, FloatArray]) -> FloatArray | None:
        """Return the radii of holes and bosses; a row with two sizes is refused."""
        scales = {"hole_radius": 1.0, "hole_diameter": 0.5}
        radii = [numbers[name] * scale for name, scale in scales.items() if name in numbers]
        several = np.sum([~np.isnan(numbers[name]) for name in (*scales, "half_angle") if name in numbers], axis=0) > 1
        if np.any(several):
            raise ReadingsError(
                f"{self.sheet.place(int(np.argmax(several)))}: expected the radius or the diameter of "
                "the hole, or the half angle of a cone, got two of them. Keep one."
            )
        return np.asarray(np.fmax.reduce(radii)) if radii else None

    def _brand(self, numbers: dict[str, FloatArray], stated: Stated) -> str:
        """Return the brand whose notation the hand's rotation follows; refuse matrices that are not rotations."""
        if (row := skewed_row(numbers)) is not None:
            raise ReadingsError(
                f"{self.sheet.place(row)}: expected a rotation matrix, got one that scales, shears or mirrors. "
                "Correct it."
            )
        return stated_brand(numbers, stated.brand, str(self.sheet.path))
