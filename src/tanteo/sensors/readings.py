"""Define readings: the unprocessed output of devices, in the world frame, in metres and radians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError, check_kind
from tanteo.sensors.checks import check_readings
from tanteo.sensors.column_arrays import filled_kinds, flags_of, frozen, frozen_flags, names_of, units_of
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

_COLUMNS = {
    "points": (3,), "directions": (3,), "normals": (3,), "normal_sds": (), "sds": (), "across_sds": (), "radii": (),
    "Ts_world_hand": (4, 4), "ranges": (), "max_ranges": (), "hole_radii": (),
}  # fmt: skip
_NAMES = ("ids", "features", "kinds", "sensors", "material_sides")


@dataclass(frozen=True, slots=True, eq=False)
class Readings:
    """``n`` readings as a structure of arrays; NaN stands for a missing number and ``''`` for a missing name.

    Use :meth:`from_columns`, which fills missing columns, normalizes directions and checks everything.

    Attributes:
        ids: unique names of the readings.
        points: sensed points in the world, or centres of the tip's ball where ``radii`` is positive ``(n, 3)`` [m];
            start of the beam for a free-space ray; NaN where the device reported only a range.
        directions: unit viewing or approach directions in the world ``(n, 3)``.
        normals: sensed unit outward surface normals in the world ``(n, 3)``.
        normal_sds: standard deviations of the normals for each of the two tilt components ``(n,)`` [rad].
        sds: standard deviations along the beam or normal ``(n,)`` [m].
        across_sds: standard deviations across the beam ``(n,)`` [m], where better known than by the beam's cone, as for
            an edge located by crossing it.
        radii: radii of the tip's ball ``(n,)`` [m]; 0 for none.
        features: labels; rows with one label lie on one feature.
        kinds: kind of each row: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder`` (contacts on the wall of a
            hole or boss), ``sphere``, ``cone``, ``centre``, ``sphere_centre``, ``apex``, ``point`` or ``free``. A
            ``centre`` lies on the axis of a hole or boss at any height; its normal, if given, is the axis with either
            sign. The normal of an ``apex`` is the axis into the cone. Centres and apexes have no tip radius.
        Ts_world_hand: poses of the hand at the readings ``(n, 4, 4)`` [m].
        ranges: reported ranges along the beam ``(n,)`` [m].
        sensors: names of the rig's sensors that measured the ranges.
        is_free: mask of beams that hit nothing (status ``none``) ``(n,)``.
        max_ranges: free lengths of free-space rays ``(n,)`` [m].
        hole_radii: radii of the holes, bosses or spheres whose centre a row states [m]; half angles of the cones whose
            apex a row states [rad] ``(n,)``.
        material_sides: ``hole``, ``boss`` or ``''`` for rows that state a centre.
        source: origin of the readings (a file name), for messages.
        notes: sentences about assumptions and ignored content of the file.

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
        material_sides: Sequence[str] | None = None,
        source: str = "readings",
        notes: Sequence[str] = (),
    ) -> Readings:
        """Return readings from the given columns in metres and radians, world frame.

        The other columns are missing values.

        The columns are those of the class. ``n``, the number of readings, is needed only if ``points``, ``ranges`` and
        ``ids``
        are all missing. Directions and normals may have any length except zero.

        Raises:
            ReadingsError: a column is invalid; the message names column, reading and value.
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
            "ranges": ranges, "max_ranges": max_ranges, "hole_radii": hole_radii,
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
        """Return the readings at row numbers or where a mask is true, in that order.

        Args:
            rows: row numbers, or mask ``(n,)``.
        """
        index = np.arange(len(self))[np.asarray(rows)]
        arrays = {k: getattr(self, k)[index] for k in _COLUMNS}
        names: dict[str, Any] = {k: tuple(getattr(self, k)[i] for i in index) for k in _NAMES}
        return Readings(**names, **arrays, is_free=self.is_free[index], source=self.source, notes=self.notes)

    @property
    def has_point(self) -> BoolArray:
        """Mask of rows with a point ``(n,)``."""
        return np.asarray(~np.isnan(self.points[:, 0]))

    @property
    def has_direction(self) -> BoolArray:
        """Mask of rows with a direction ``(n,)``."""
        return np.asarray(~np.isnan(self.directions[:, 0]))

    @property
    def has_normal(self) -> BoolArray:
        """Mask of rows with a sensed surface normal ``(n,)``."""
        return np.asarray(~np.isnan(self.normals[:, 0]))

    @property
    def has_hand(self) -> BoolArray:
        """Mask of rows with a hand pose ``(n,)``."""
        return np.asarray(~np.isnan(self.Ts_world_hand[:, 3, 3]))


def check_readings_kind(name: str, value: object) -> None:
    """Check that an argument is a :class:`Readings`.

    Args:
        name: name of the argument, for messages.
        value: argument to check.

    Raises:
        InputError: it is not; the message names its type.
    """
    how = "tanteo.read_readings(path) reads a file, tanteo.Readings.from_columns(points, sds=..) takes arrays."
    check_kind(name, value, Readings, how)


ENOUGH = 5000
"""Number of readings above which the pose gains nothing: its error is then below one seventieth of a reading's."""


def thinned(readings: Readings, most: int = ENOUGH) -> Readings:
    """Return at most ``most`` readings, spread evenly over all of them.

    Args:
        readings: readings in order.
        most: largest number to keep.
    """
    n = len(readings)
    return readings if n <= most else readings.take(np.linspace(0, n - 1, most).round().astype(int))


def concatenate(parts: Sequence[Readings]) -> Readings:
    """Return several sets of readings as one, in order.

    Args:
        parts: sets of readings; their names must differ.

    Raises:
        ReadingsError: there is no set, or a name occurs twice.
    """
    if not parts:
        raise ReadingsError("readings: expected at least one set to join, got none.")
    arrays: dict[str, Any] = {k: np.concatenate([getattr(p, k) for p in parts]) for k in (*_COLUMNS, "is_free")}
    names: dict[str, Any] = {k: tuple(x for p in parts for x in getattr(p, k)) for k in _NAMES}
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    return Readings(**names, **arrays, source=parts[0].source, notes=notes)
