"""Readings: what the device said, before anything is made of it. World frame, metres and radians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError, check_kind
from tanteo.sensors.checks import check_readings
from tanteo.sensors.given import filled_kinds, flags_of, frozen, frozen_flags, names_of, units_of
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

_COLUMNS = {
    "points": (3,), "directions": (3,), "normals": (3,), "normal_sds": (), "sds": (), "across_sds": (), "radii": (),
    "Ts_world_hand": (4, 4), "ranges": (), "max_ranges": (), "hole_radii": (), "half_angles": (),
}  # fmt: skip
_NAMES = ("ids", "features", "kinds", "sensors", "material_sides")


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """``n`` readings as a struct of arrays; NaN stands for "not given" and ``''`` for "no name".

    Build it with :meth:`from_columns`, which fills what is missing, normalises directions and checks everything.

    Attributes:
        ids: Names of the readings, unique.
        points: Sensed points in the world [m], or centres of the tip's ball where ``radii`` is positive. For a free
            beam the point is where the beam starts. A row of NaN where the device gave a range only.
        directions: Unit directions in which the sensor looked or the tip moved, world.
        normals: Unit outward surface normals, world, where they were sensed.
        normal_sds: Standard deviation of the normal about each of its two tilts [rad].
        sds: One standard deviation along the beam or normal [m].
        across_sds: One standard deviation across the beam [m], where it is known better than by the beam's cone: how
            well an edge was placed by crossing it.
        radii: Radius of the tip's ball [m], 0 for none.
        features: Labels: rows with one label were taken on one feature.
        kinds: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder`` (contacts on the wall of a hole or boss),
            ``sphere``, ``cone``, ``centre``, ``sphere_centre``, ``apex``, ``point`` or ``free``, one a row. A
            ``centre`` is that of a circle, on the axis of a hole or boss at any height; its normal, if given, is the
            axis with either sign; that of an ``apex`` is the axis into the cone. They have no ball.
        Ts_world_hand: Pose of the hand at the reading.
        ranges: Raw ranges along the beam [m].
        sensors: Name of the sensor of the rig that gave the range.
        is_free: The beam met nothing (status ``none``).
        max_ranges: How far a free-space ray was free [m].
        hole_radii: Radius of the hole, boss or sphere of which the row gives the centre [m].
        half_angles: Half angle of the cone of which the row gives the apex [rad].
        material_sides: ``hole``, ``boss`` or ``''`` of the same.
        source: Where the readings come from (a file name), for messages.
        notes: What was left out or taken as something when they were read, a sentence each.

    Example:
        >>> readings = tanteo.Readings.from_columns(points=[[0.1, 0.0, 0.02], [0.12, 0.01, 0.02]], sds=[3e-4, 3e-4])
        >>> len(readings)
        2
    """

    ids: tuple[str, ...]
    points: Vectors
    directions: Vectors
    normals: Vectors
    normal_sds: FloatArray
    sds: FloatArray
    across_sds: FloatArray
    radii: FloatArray
    features: tuple[str, ...]
    kinds: tuple[str, ...]
    Ts_world_hand: Transforms
    ranges: FloatArray
    sensors: tuple[str, ...]
    is_free: BoolArray
    max_ranges: FloatArray
    hole_radii: FloatArray
    half_angles: FloatArray
    material_sides: tuple[str, ...]
    source: str = field(default="readings")
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.ids)
        for name, shape in _COLUMNS.items():
            object.__setattr__(self, name, frozen(name, getattr(self, name), (n, *shape)))
        object.__setattr__(self, "is_free", frozen_flags(self.is_free, n))
        for name in ("features", "kinds", "sensors", "material_sides"):
            if len(getattr(self, name)) != n:
                raise ReadingsError(f"{name}: expected {n} entries, one a reading, got {len(getattr(self, name))}.")
        check_readings(self)

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def from_columns(
        cls,
        points: Vectors | None = None,
        *,
        n: int | None = None,
        ids: Sequence[str] | None = None,
        directions: Vectors | None = None,
        normals: Vectors | None = None,
        normal_sds: FloatArray | None = None,
        sds: FloatArray | None = None,
        across_sds: FloatArray | None = None,
        radii: FloatArray | None = None,
        features: Sequence[str] | None = None,
        kinds: Sequence[str] | None = None,
        Ts_world_hand: Transforms | None = None,
        ranges: FloatArray | None = None,
        sensors: Sequence[str] | None = None,
        is_free: BoolArray | None = None,
        max_ranges: FloatArray | None = None,
        hole_radii: FloatArray | None = None,
        half_angles: FloatArray | None = None,
        material_sides: Sequence[str] | None = None,
        source: str = "readings",
        notes: Sequence[str] = (),
    ) -> Readings:
        """Readings from the columns there are; the others are "not given". Units: metres, radians, world frame.

        The columns are those of the class; ``n``, the number of readings, is needed only when neither ``points``
        nor ``ranges`` nor ``ids`` is given. Directions and normals may have any length but zero.

        Raises:
            ReadingsError: Names the column, the reading and the value.
        """
        first = next((c for c in (points, ranges, ids) if c is not None), None)
        if first is not None and not hasattr(first, "__len__"):
            raise ReadingsError(f"readings: expected columns, one row a reading, got {first!r}.")
        n = n if n is not None else (0 if first is None else len(first))
        free = np.zeros(n, dtype=bool) if is_free is None else flags_of(is_free)
        kinds = filled_kinds(kinds, free, n)
        labels = ("",) * n if features is None else names_of(features)
        columns = {
            "points": points, "directions": units_of("directions", directions),
            "normals": units_of("normals", normals), "normal_sds": normal_sds, "sds": sds,
            "across_sds": across_sds,
            "radii": np.zeros(n) if radii is None else radii, "Ts_world_hand": Ts_world_hand,
            "ranges": ranges, "max_ranges": max_ranges, "hole_radii": hole_radii, "half_angles": half_angles,
        }  # fmt: skip
        arrays = {k: np.broadcast_to(np.nan, (n, *_COLUMNS[k])) if v is None else v for k, v in columns.items()}
        return cls(
            ids=tuple(map(str, range(1, n + 1))) if ids is None else names_of(ids),
            features=tuple("" if f else label for f, label in zip(free, labels, strict=True)) if free.any() else labels,
            kinds=kinds,
            sensors=("",) * n if sensors is None else names_of(sensors),
            material_sides=("",) * n if material_sides is None else names_of(material_sides),
            is_free=free,
            source=source,
            notes=tuple(notes),
            **arrays,
        )

    def take(self, rows: Sequence[int] | np.ndarray) -> Readings:
        """The readings at these row numbers or where a boolean mask is true, in that order."""
        index = np.arange(len(self))[np.asarray(rows)]
        arrays = {k: getattr(self, k)[index] for k in _COLUMNS}
        names: dict[str, Any] = {k: tuple(getattr(self, k)[i] for i in index) for k in _NAMES}
        return Readings(**names, **arrays, is_free=self.is_free[index], source=self.source, notes=self.notes)

    @property
    def has_point(self) -> BoolArray:
        """Rows whose point is given."""
        return np.asarray(~np.isnan(self.points[:, 0]))

    @property
    def has_direction(self) -> BoolArray:
        """Rows whose direction is given."""
        return np.asarray(~np.isnan(self.directions[:, 0]))

    @property
    def has_normal(self) -> BoolArray:
        """Rows whose surface normal was sensed."""
        return np.asarray(~np.isnan(self.normals[:, 0]))

    @property
    def has_hand(self) -> BoolArray:
        """Rows whose hand pose is given."""
        return np.asarray(~np.isnan(self.Ts_world_hand[:, 3, 3]))


def check_readings_kind(name: str, value: object) -> None:
    """Refuse what are no readings at all.

    Raises:
        InputError: with what it is.
    """
    how = "tanteo.read_readings(path) reads a file, tanteo.Readings.from_columns(points, sds=..) takes arrays."
    check_kind(name, value, Readings, how)


ENOUGH = 5000
"""More readings tell nothing: a pose is then known seventy times better than one of them, and no part is made so."""


def thinned(readings: Readings, most: int = ENOUGH) -> Readings:
    """As many of the readings as are enough, spread evenly over all of them; all, if they are no more."""
    n = len(readings)
    return readings if n <= most else readings.take(np.linspace(0, n - 1, most).round().astype(int))


def concatenate(parts: Sequence[Readings]) -> Readings:
    """Several sets of readings as one, in order; their names must differ.

    Raises:
        ReadingsError: nothing to join, or a name comes twice.
    """
    if not parts:
        raise ReadingsError("readings: expected at least one set to join, got none.")
    arrays: dict[str, Any] = {k: np.concatenate([getattr(p, k) for p in parts]) for k in (*_COLUMNS, "is_free")}
    names: dict[str, Any] = {k: tuple(x for p in parts for x in getattr(p, k)) for k in _NAMES}
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    return Readings(**names, **arrays, source=parts[0].source, notes=notes)
