"""The columns of a readings file: names, units in the names, groups that come together; and its lines that count."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TextIO

from tanteo.errors import InputError, ReadingsError, UnitError, did_you_mean
from tanteo.io.units import ANGLE_UNITS, LENGTH_UNITS

LENGTHS = ("x", "y", "z", "radius", "sd", "across_sd", "range", "max", "hand_x", "hand_y", "hand_z")
PLAIN = ("dx", "dy", "dz", "nx", "ny", "nz", "hand_qw", "hand_qx", "hand_qy", "hand_qz")
TEXTS = ("id", "feature", "kind", "sensor", "status")

POINT = ("x", "y", "z")
DIRECTION = ("dx", "dy", "dz")
NORMAL = ("nx", "ny", "nz")
HAND = ("hand_x", "hand_y", "hand_z", "hand_qw", "hand_qx", "hand_qy", "hand_qz")
QUATERNION = HAND[3:]
VECTOR = ("hand_rx", "hand_ry", "hand_rz")
ROLL_PITCH_YAW = ("hand_roll", "hand_pitch", "hand_yaw")
ANGLES = ("normal_sd", *VECTOR, *ROLL_PITCH_YAW)

_WAYS = (
    "hand_qw .. hand_qz (a unit quaternion), hand_rx_rad .. hand_rz_rad (a rotation vector) or hand_roll_deg, "
    "hand_pitch_deg, hand_yaw_deg"
)


def hand_group(names: Iterable[str]) -> tuple[str, ...]:
    """The columns of the hand's pose: its place, and its rotation in the way that the names have, or as quaternion."""
    given = set(names)
    way = next((way for way in (QUATERNION, VECTOR, ROLL_PITCH_YAW) if given.intersection(way)), QUATERNION)
    return (*HAND[:3], *way)


def groups(names: Iterable[str]) -> tuple[tuple[str, ...], ...]:
    """Columns that are filled together or not at all."""
    return (POINT, DIRECTION, NORMAL, hand_group(names))


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a file.

    Attributes:
        base: Name without the unit.
        written: Name in the file.
        factor: To metres or radians; NaN for text.
    """

    base: str
    written: str
    factor: float

    @property
    def is_text(self) -> bool:
        """It holds names, not numbers."""
        return self.base in TEXTS


def known_columns() -> str:
    """All column names, for messages."""
    lengths = [f"{name}_mm" for name in LENGTHS]
    return ", ".join([*TEXTS, *lengths, *(f"{name}_deg" for name in ANGLES), *PLAIN])


def read_header(cells: Sequence[str], place: str) -> tuple[Column, ...]:
    """The columns that a header names.

    Args:
        cells: The header's cells.
        place: File and line, for messages.

    Raises:
        ReadingsError: An unknown column (with the nearest name), one that comes twice, or a group that is incomplete.
        UnitError: A unit that is missing, unknown, or contradicts another column.
    """
    names = [cell.strip() for cell in cells]
    if any(_is_number(name) for name in names):
        raise ReadingsError(f"{place}: expected a header that names the columns, got '{','.join(names)}'. Add one.")
    if len(names) == 1 and any(mark in names[0] for mark in ";\t|"):
        raise ReadingsError(f"{place}: expected commas between columns, got '{names[0]}'. Write it comma-separated.")
    columns = tuple(_read_name(name, f"{place}, column {i + 1}") for i, name in enumerate(names))
    seen: dict[str, Column] = {}
    for column in columns:
        twin = seen.setdefault(column.base, column)
        if twin is not column:
            error: type[InputError] = ReadingsError if twin.written == column.written else UnitError
            raise error(
                f"{place}, column '{column.written}': expected '{column.base}' once, got it also as "
                f"'{twin.written}'. Keep one."
            )
    _check_groups(seen, place)
    return columns


def _read_name(name: str, place: str) -> Column:
    if name in TEXTS:
        return Column(name, name, float("nan"))
    if name in PLAIN:
        return Column(name, name, 1.0)
    base, _, unit = name.rpartition("_")
    for bases, units in ((LENGTHS, LENGTH_UNITS), (ANGLES, ANGLE_UNITS)):
        if base in bases and unit in units:
            return Column(base, name, units[unit])
        if name in bases:
            listed = ", ".join(f"{name}_{u}" for u in units)
            raise UnitError(f"{place}: expected a unit in the name ({listed}), got '{name}'. Add it.")
        if base in bases:
            listed = ", ".join(f"{base}_{u}" for u in units)
            raise UnitError(f"{place}: expected one of the units {listed}, got '{name}'. Convert the values.")
    if not name:
        raise ReadingsError(f"{place}: expected a name, got nothing. Remove the comma or name the column.")
    hint = did_you_mean(name, known_columns().split(", "))
    raise ReadingsError(f"{place}: expected one of {known_columns()}, got '{name}'.{hint}")


def _check_groups(columns: dict[str, Column], place: str) -> None:
    ways = [[name for name in way if name in columns] for way in (QUATERNION, VECTOR, ROLL_PITCH_YAW)]
    if sum(map(bool, ways)) > 1:
        have = ", ".join(columns[name].written for way in ways for name in way)
        raise ReadingsError(f"{place}: expected the hand's rotation in one way, got {have}. Keep one of {_WAYS}.")
    for group in groups(columns):
        missing = [name for name in group if name not in columns]
        if missing and len(missing) < len(group):
            have = ", ".join(columns[name].written for name in group if name in columns)
            instead = "" if group[0] != HAND[0] or any(ways) else f" The rotation may be {_WAYS}."
            raise ReadingsError(
                f"{place}: expected {', '.join(group)} together, got only {have}. Add {', '.join(missing)} (with unit "
                f"where it is a length or an angle).{instead}"
            )
    if "x" not in columns and not {"range", "sensor", "hand_x"} <= columns.keys():
        raise ReadingsError(
            f"{place}: expected x_mm, y_mm, z_mm (or range_mm, sensor and the hand_ columns), got "
            f"{', '.join(c.written for c in columns.values())}. Add where the points are."
        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


class Lines:
    """The lines of a file without comments and blank ones; knows the number of the last."""

    def __init__(self, text: TextIO) -> None:
        self._text = text
        self.number = 0

    def __iter__(self) -> Iterator[str]:
        for self.number, line in enumerate(self._text, start=1):  # noqa: B020
            # letters, digits and signs come after '#': most lines need no second look
            if line[0] > "#" or ((bare := line.lstrip()) and bare[0] != "#"):
                yield line
