"""Read tables of laser line scanners: points ``x``, ``z`` of profiles in the frame of the sensor, moved by the hand.

A row is one point, with the number of its profile, or a whole profile with columns ``x0 .. xn`` and ``z0 .. zn``. The
sensor's z axis points along its optical axis and x along the laser line, as scanners define it; the hand's pose and the
rig place both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.readings.frames import numbered_columns
from tanteo.io.readings.headers import GROUPS_OF_READINGS, canonical
from tanteo.io.readings.units import LENGTH_UNITS

if TYPE_CHECKING:
    from tanteo.io.readings.stated import Stated

_LEAST = 8
"""Smallest number of points of a profile in one row."""
_HALVINGS = 24
"""Number of halvings of the search for the size of a grid's cells."""
_MISSING = ("", "nan", "-nan", "inf", "-inf", "none", "null")


@dataclass(frozen=True, slots=True)
class Profiles:
    """Columns of a table of profiles.

    Attributes:
        header: header of the rows that a profile becomes: the kept columns, profile number, and the point.
        kept: indices of the columns that all points of a row share.
        zones: index of the column of z of each point of a row.
        across: index of the column of x of each point.
        group: index of the column of the profile's number; None to count rows.
        invalid: numbers that mean no point.
        shown: columns as messages name them.
        notes: sentences about assumptions.
    """

    header: tuple[str, ...]
    kept: tuple[int, ...]
    zones: tuple[int, ...]
    across: tuple[int, ...]
    group: int | None
    invalid: tuple[float, ...]
    shown: str
    notes: tuple[str, ...] = ()

    def rows(self, rows: Iterator[list[str]], width: int) -> Iterator[list[str]]:
        """Yield one row for each point; a point without z is invalid.

        Args:
            rows: rows of the file.
            width: number of columns of the file; other rows are passed on, so that the table refuses them.
        """
        for number, row in enumerate(rows, start=1):
            if len(row) != width:
                yield row
                continue
            shared = [row[k] for k in self.kept]
            name = str(number) if self.group is None else row[self.group]
            for x, z in zip(self.across, self.zones, strict=True):
                if row[z].strip().lower() not in _MISSING and _number(row[z]) not in self.invalid:
                    yield [*shared, f"profile {name.strip()}", row[x], "0", row[z]]


def find_profiles(header: Sequence[str], place: str, stated: Stated) -> Profiles | None:
    """Return the columns of a table of profiles; None for another table.

    Args:
        header: cells of the header.
        place: file and line for messages.
        stated: options of the user.

    Raises:
        ReadingsError: the hand's pose is neither in the columns nor stated.
    """
    names = [canonical(cell) for cell in header]
    bases = [name.rpartition("_")[0] if name.rpartition("_")[2] in LENGTH_UNITS else name for name in names]
    runs = numbered_columns(header)
    several = "x" in runs and "z" in runs and len(runs["x"]) == len(runs["z"]) >= _LEAST and "y" not in runs
    single = {"x", "z"} <= set(bases) and "y" not in bases
    if not (several or single):
        return None
    across, zones = (runs["x"], runs["z"]) if several else ((bases.index("x"),), (bases.index("z"),))
    if "hand_x" not in bases and stated.hand is None:
        raise ReadingsError(
            f"{place}: expected the pose of the hand with profiles of x and z, got none. Add its columns, use --hand "
            "with a pose or a table of poses, or name the third coordinate y."
        )
    group = next((k for name in GROUPS_OF_READINGS for k, own in enumerate(names) if own in (name, f"{name}_id")), None)
    group = names.index("group") if "group" in names else group
    used = {*across, *zones} | (set() if group is None else {group})
    kept = tuple(k for k in range(len(names)) if k not in used)
    units = {
        names[k].rpartition("_")[2] if names[k].rpartition("_")[2] in LENGTH_UNITS else "" for k in (*across, *zones)
    }
    unit = f"_{units.pop()}" if len(units) == 1 and units != {""} else ""
    shown = ", ".join(header[k] for k in (across[0], zones[0]))
    invalid = tuple(one.number for one in stated.special)
    return Profiles(
        (*(header[k] for k in kept), "group", f"x{unit}", f"y{unit}", f"z{unit}"), kept, tuple(zones), tuple(across),
        group, invalid, shown,
    )  # fmt: skip


def place_profiles(points: FloatArray, Ts_world_hand: Transforms, stated: Stated) -> tuple[FloatArray, FloatArray, str]:
    """Return points in the world, the optical axis at each, and a note on where the sensor sits.

    Args:
        points: points in the frame of the sensor ``(n, 3)`` [m].
        Ts_world_hand: pose of the hand at each point ``(n, 4, 4)`` [m].
        stated: options of the user, with the rig.

    Raises:
        ReadingsError: the rig has several sensors.
    """
    sensors = () if stated.rig is None else stated.rig.sensors
    if len(sensors) > 1:
        raise ReadingsError(f"rig: expected the line scanner as its only sensor, got {len(sensors)}. Give its own rig.")
    T = Ts_world_hand @ (sensors[0].T_hand_sensor if sensors else np.eye(4))
    note = (
        f"Profiles are placed by the sensor '{sensors[0].name}' of the rig; state its error on the hand as --tip-sd."
        if sensors
        else "The profiles are taken in the frame of the hand; use --rig FILE if the sensor sits elsewhere on it."
    )
    return np.einsum("nij,nj->ni", T[:, :3, :3], points) + T[:, :3, 3], T[:, :3, 2], note


def spread(points: FloatArray, most: int) -> list[int]:
    """Return the indices of at most ``most`` points, one in each occupied cell of the finest grid with so few cells.

    Dense lines and slow parts of a motion then count no more than others: the information about a pose is in where and
    on which faces the points are, and neighbours on a line share their errors.

    Args:
        points: points in the world ``(n, 3)`` [m].
        most: largest number of points.
    """
    span = float(np.ptp(points, axis=0).max())
    low, high, best = 0.0, max(span, 1e-9), np.zeros(1, dtype=np.int64)
    for _ in range(_HALVINGS):
        size = 0.5 * (low + high)
        cells = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
        _, first = np.unique(cells, axis=0, return_index=True)
        if len(first) > most:
            low = size
        else:
            high, best = size, first
    return sorted(best.tolist())


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")
