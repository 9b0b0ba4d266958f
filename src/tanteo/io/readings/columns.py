"""Interpret the header of a readings file: column names, units in the names, and groups of columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tanteo.errors import InputError, ReadingsError, UnitError, did_you_mean
from tanteo.io.documents.schema import show
from tanteo.io.readings.assembling import TIME
from tanteo.io.readings.brands import BRANDS
from tanteo.io.readings.hand_columns import ANGLES as HAND_ANGLES
from tanteo.io.readings.hand_columns import NOTATIONS, PLACE, Notation, as_hand, notation_of
from tanteo.io.readings.hand_columns import PLAIN as HAND_PLAIN
from tanteo.io.readings.headers import (
    advice,
    advice_on_size,
    canonical,
    is_unrelated,
    with_coordinates,
    with_group,
    with_id,
    with_true_distance,
    with_unit,
    without_nominal,
)
from tanteo.io.readings.units import ANGLE_UNITS, LENGTH_UNITS

LENGTHS = (
    "x", "y", "z", "radius", "sd", "across_sd", "range", "true_distance", "max", "hand_x", "hand_y", "hand_z",
    "hole_radius", "hole_diameter",
)  # fmt: skip
_RANGES = ("range", "true_distance", "max")
"""Lengths that may be in centimetres, as ultrasonic sensors report them."""
PLAIN = ("dx", "dy", "dz", "nx", "ny", "nz", "i", "j", "k", *HAND_PLAIN)
TEXTS = ("id", "feature", "kind", "sensor", "status", "side", "group")

TIMES = {
    f"{name}{unit}": factor
    for name in ("time", "t", "timestamp", "time_stamp", "stamp")
    for unit, factor in (("", 1.0), ("_s", 1.0), ("_sec", 1.0), ("_ms", 1e-3), ("_us", 1e-6), ("_ns", 1e-9))
}
"""Names of the column of times, with seconds per unit."""
POINT = ("x", "y", "z")
DIRECTION = ("dx", "dy", "dz")
NORMAL = ("nx", "ny", "nz")
OUTWARD = ("i", "j", "k")
QUATERNION = NOTATIONS[0].names
HAND = (*PLACE, *QUATERNION)
ANGLES = ("normal_sd", "half_angle", *HAND_ANGLES)
_DEVIATIONS = {f"{name}_{unit}" for name in DIRECTION for unit in LENGTH_UNITS}
"""Columns ``dX [mm]`` of GOM and others: a direction has no unit, a deviation has."""
_MOST = 10_000
"""Largest accepted number of columns."""
_TYPING_ERROR = 0.8
"""Similarity of names above which an unknown column is a misspelt known one: one letter of five."""
_SHORT = 4
"""Largest number of letters of a name for which a similar name is another word."""
_OF_BRANDS = tuple(name for notation in NOTATIONS[3:] for name in notation.names)


def hand_group(names: Iterable[str]) -> tuple[str, ...]:
    """Return the columns of the hand's pose: position, and rotation in the notation that the names use.

    Args:
        names: column names without units.
    """
    return (*PLACE, *notation_of(names).names)


def groups(names: Iterable[str]) -> tuple[tuple[str, ...], ...]:
    """Return the groups of columns in which a row fills all cells or none.

    Args:
        names: column names without units.
    """
    return (POINT, DIRECTION, NORMAL, OUTWARD, hand_group(names))


@dataclass(frozen=True, slots=True)
class Column:
    """Column of a readings file.

    Attributes:
        base: name without the unit.
        written: name as written in the file.
        factor: factor to metres or radians; NaN for text.
        left_out: whether the column is ignored because it does not describe readings.
        advice: advice for a column that may have been meant to be read; empty if there is none.
    """

    base: str
    written: str
    factor: float
    left_out: bool = False
    advice: str = ""

    @property
    def is_text(self) -> bool:
        """Whether the column holds text, not numbers."""
        return self.base in TEXTS


def known_columns() -> str:
    """Return all known column names as a list as text, for messages."""
    lengths = [f"{name}_mm" for name in LENGTHS]
    return ", ".join([*TEXTS, *lengths, *(f"{name}_deg" for name in ANGLES if name not in _OF_BRANDS), *PLAIN[:13]])


def read_header(
    cells: Sequence[str], place: str, *, units: str | None = None, brand: str | None = None, below: Sequence[str] = (),
    placed: bool = False, timed: bool = False,
) -> tuple[Column, ...]:  # fmt: skip
    """Return the columns that a header names.

    Args:
        cells: cells of the header row.
        place: file name and line for messages.
        units: unit of lengths whose column name has none; None to require one.
        brand: robot brand whose pose convention the ``hand_`` columns follow, including its units where the name has
            none; None if not stated.
        below: units in the row below the header; empty if there is no such row.
        placed: whether the hand's pose is stated beside the file.
        timed: whether the time of each row is needed.

    Raises:
        ReadingsError: a column is unknown (the message names the nearest) or repeated, or a group is incomplete.
        UnitError: a unit is missing, unknown, or contradicts another column.
    """
    if len(cells) > _MOST:
        raise ReadingsError(f"{place}: expected up to {_MOST} columns, got {len(cells)}. Export fewer.")
    written = [cell.strip() for cell in cells]
    if any(_is_number(name) for name in written):
        raise ReadingsError(
            f"{place}: expected a header that names the columns, got '{show(','.join(written))}'. Add one."
        )
    if any("|" in name for name in written):
        shown = show(" ".join(written))
        raise ReadingsError(f"{place}: expected commas between columns, got '{shown}'. Write it comma-separated.")
    canonicals = without_nominal([canonical(name) for name in written], written)
    canonicals = canonicals if _are_clear(canonicals) else with_coordinates(canonicals, written)
    names = as_hand(with_true_distance(with_group(with_id(canonicals))))
    names = [with_unit(name, unit) for name, unit in zip(names, below, strict=True)] if below else names
    notation = notation_of(names)
    own = {name: _brand_unit(name, brand, notation) for name in names}
    clear = _are_clear(names) or _are_ranges(names, placed=placed)
    columns = tuple(
        _time_column(name, shown)
        if timed and name in TIMES
        else _read_name(name, shown, f"{place}, column {k + 1}", own[name] or units, clear=clear)
        for k, (name, shown) in enumerate(zip(names, written, strict=True))
    )
    if timed and not any(column.base == TIME for column in columns):
        raise ReadingsError(f"{place}: expected a column time_s, as the poses of --hand have, got none. Add it.")
    seen: dict[str, Column] = {}
    for column in columns:
        twin = seen.setdefault(column.base, column)
        if twin is not column:
            error: type[InputError] = ReadingsError if twin.written == column.written else UnitError
            raise error(
                f"{place}, column '{column.written}': expected '{column.base}' once, got it also as "
                f"'{twin.written}'. Keep one."
            )
    _check_groups(seen, place, placed=placed)
    return columns


def _time_column(name: str, written: str) -> Column:
    return Column(TIME, written, TIMES[name])


def _brand_unit(name: str, brand: str | None, notation: Notation) -> str | None:
    """Return the unit of a ``hand_`` column without one: that of the stated brand, or degrees in brand notations."""
    if name in notation.names and name in ANGLES:
        if brand in notation.brands:
            return "rad" if BRANDS[str(brand)].radian == 1 else "deg"
        return "deg" if name in _OF_BRANDS else None
    if name in PLACE and brand in notation.brands:
        return "m" if BRANDS[str(brand)].metre == 1 else "mm"
    return None


def _are_clear(names: Sequence[str]) -> bool:
    """Return whether the names contain the coordinates of a point, so that unknown columns can be excluded."""
    return all(
        any(name == axis or name in {f"{axis}_{unit}" for unit in LENGTH_UNITS} for name in names) for axis in POINT
    )


def _are_ranges(names: Sequence[str], *, placed: bool) -> bool:
    """Return whether the names contain a range and the whole pose of the hand, so that others can be excluded."""
    bases = {
        name.rpartition("_")[0] if name.rpartition("_")[2] in (*LENGTH_UNITS, *ANGLE_UNITS) else name for name in names
    }
    return "range" in bases and (placed or set(hand_group(bases)) <= bases)


def _read_name(name: str, written: str, place: str, unit: str | None, *, clear: bool) -> Column:
    if name in TEXTS:
        return Column(name, written, float("nan"))
    if is_unrelated(name) or name in _DEVIATIONS:
        return Column(f"excluded: {place}", written, float("nan"), left_out=True, advice=advice(written))
    if name in PLAIN:
        return Column(name, written, 1.0)
    written, (base, _, own) = written[:60], name.rpartition("_")
    if base in _RANGES and own == "cm":
        return Column(base, written, 1e-2)
    for bases, units in ((LENGTHS, LENGTH_UNITS), (ANGLES, ANGLE_UNITS)):
        if base in bases and own in units:
            return Column(base, written, units[own])
        if name in bases and unit in units:
            return Column(name, written, units[unit])
        if name in bases:
            listed = ", ".join(f"{name}_{u}" for u in units)
            how = "Add it, or use --units mm." if bases is LENGTHS else "Add it."
            raise UnitError(f"{place}: expected a unit in the name ({listed}), got '{show(written)}'. {how}")
        if base in bases:
            listed = ", ".join(f"{base}_{u}" for u in units)
            raise UnitError(f"{place}: expected one of the units {listed}, got '{show(written)}'. Convert the values.")
    if not name and not clear:
        raise ReadingsError(f"{place}: expected a name, got nothing. Remove the comma or name the column.")
    if words := advice_on_size(written):
        raise ReadingsError(f"{place}: expected a known column, got '{show(written)}'.{words}")
    common = len(name) <= _SHORT or advice(written)  # a word with a meaning of its own is no misspelt column
    near = "" if common else did_you_mean(name, known_columns().split(", "), _TYPING_ERROR)
    if clear and not near:
        return Column(f"excluded: {place}", written, float("nan"), left_out=True, advice=advice(written))
    if words := advice(written):
        raise ReadingsError(f"{place}: expected a known column, got '{show(written)}'.{words}")
    suggestion = did_you_mean(name, known_columns().split(", ")) if len(name) > 2 else ""
    suggestion = suggestion or " Name the columns of the points so, or use a format of docs/formats_logs.md."
    raise ReadingsError(
        f"{place}: expected columns x_mm, y_mm, z_mm or others of docs/formats_readings.md, "
        f"got '{show(written)}'.{suggestion}"
    )


def _check_groups(columns: dict[str, Column], place: str, *, placed: bool) -> None:
    notation = notation_of(columns)
    others = [name for one in NOTATIONS for name in one.names if name in columns and name not in notation.names]
    if others:
        have = ", ".join(dict.fromkeys(columns[n].written for one in NOTATIONS for n in one.names if n in columns))
        listed = ", ".join(one.words for one in NOTATIONS[:3])
        raise ReadingsError(
            f"{place}: expected the hand's rotation in one way, got {have}. Keep one of {listed}, or of a brand."
        )
    for group in groups(columns):
        missing = [name for name in group if name not in columns]
        if missing and len(missing) < len(group):
            have = ", ".join(columns[name].written for name in group if name in columns)
            turned = any(name in columns for name in notation.names)
            notations = ", ".join(one.words for one in NOTATIONS[:2]) + f" or {NOTATIONS[2].words}, or that of a brand"
            instead = "" if group[0] != PLACE[0] or turned else f" The rotation may be {notations}."
            raise ReadingsError(
                f"{place}: expected {', '.join(group)} together, got only {have}. Add {', '.join(missing)} (with unit "
                f"where it is a length or an angle).{instead}"
            )
    needed = (
        {"range"} if "true_distance" in columns else {"range", "sensor"} if placed else {"range", "sensor", "hand_x"}
    )
    if "x" not in columns and not needed <= columns.keys() and _lacks_points(columns):
        raise ReadingsError(
            f"{place}: expected x_mm, y_mm, z_mm (or range_mm, sensor and the hand_ columns), got "
            f"{show(', '.join(c.written for c in columns.values()))}. Add where the points are."
        )


def _lacks_points(columns: dict[str, Column]) -> bool:
    """Return whether the columns determine no contact points: no hand pose, or a hand pose with ranges."""
    return PLACE[0] not in columns or not columns.keys().isdisjoint(("range", "sensor", "status"))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
