"""Define readings: the unprocessed output of devices, in the world frame, in metres and radians."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError, check_kind
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms, Vectors
from tanteo.sensors.checks import check_readings


def frozen(name: str, value: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Return a read-only float64 copy with the required shape; broadcast columns of NaN are not expanded in memory.

    Args:
        name: name of the column, for messages.
        value: numbers of the column.
        shape: required shape.

    Raises:
        ReadingsError: the values are not real numbers, or the shape differs.
    """
    array = _numbers(name, value)
    if array.shape != shape:
        raise ReadingsError(f"{name}: expected shape {shape}, got {array.shape}. Give one row a reading.")
    if array.flags.writeable:
        array = array.copy()
        array.flags.writeable = False
    return array


def _numbers(name: str, value: FloatArray) -> FloatArray:
    """Return real numbers as float64; refuse masked and complex arrays, whose conversion would lose information."""
    if "numpy.ma" in sys.modules and np.ma.is_masked(value):  # the attribute access alone would import numpy.ma
        raise ReadingsError(f"{name}: expected numbers, got a masked array. Fill it with NaN, or leave the rows out.")
    try:
        if np.iscomplexobj(value):
            raise ReadingsError(f"{name}: expected real numbers, got complex ones. Give their real parts.")
        return np.asarray(value, dtype=np.float64)
    except (ValueError, TypeError) as error:
        if isinstance(error, ReadingsError):
            raise
        raise ReadingsError(f"{name}: expected numbers, one row a reading, got others ({error}).") from None


def names_of(values: Sequence[object]) -> tuple[str, ...]:
    """Return names as text; None and NaN, which tables have in empty cells, become empty.

    Args:
        values: names of any type.
    """
    return tuple("" if v is None or v != v else str(v) for v in values)


def flags_of(value: BoolArray) -> BoolArray:
    """Return a boolean copy; refuse words, which would all be true.

    Args:
        value: flags as booleans or integers.

    Raises:
        ReadingsError: the values are neither booleans nor integers.
    """
    flags = np.array(value)
    if flags.dtype.kind not in "bui" and flags.size:
        raise ReadingsError(f"is_free: expected true or false, got '{flags.flat[0]}'. Compare the words first.")
    return flags.astype(bool)


def frozen_flags(value: BoolArray, n: int) -> BoolArray:
    """Return a read-only boolean copy with one flag per reading.

    Args:
        value: flags as booleans or integers.
        n: number of readings.

    Raises:
        ReadingsError: the values are not flags, or their number differs.
    """
    flags = flags_of(value)
    if flags.shape != (n,):
        raise ReadingsError(f"is_free: expected shape {(n,)}, got {flags.shape}. Give one flag a reading.")
    flags.flags.writeable = False
    return flags


def filled_kinds(kinds: Sequence[str] | None, free: BoolArray, n: int) -> tuple[str, ...]:
    """Return a kind for every reading, and mark rows of kind ``free`` in ``free``.

    Args:
        kinds: kinds of the readings; None for the default.
        free: mask of free-space rays ``(n,)``; updated in place.
        n: number of readings.

    Raises:
        ReadingsError: the number of kinds differs.
    """
    if kinds is None:
        return tuple("free" if f else "point" for f in free) if free.any() else ("point",) * n
    if len(kinds) != n:
        raise ReadingsError(f"kinds: expected {n} entries, one a reading, got {len(kinds)}.")
    free |= np.fromiter((k == "free" for k in kinds), dtype=bool, count=n)
    return tuple("free" if f else (k or "point") for f, k in zip(free, kinds, strict=True))


def units_of(name: str, vectors: Vectors | None) -> Vectors | None:
    """Return vectors scaled to length one, with NaN rows unchanged; None for None.

    Args:
        name: name of the column, for messages.
        vectors: vectors ``(n, 3)``.

    Raises:
        ReadingsError: the shape is wrong, or a vector is zero or infinite.
    """
    if vectors is None:
        return None
    vectors = _numbers(name, vectors)
    if vectors.ndim != 2 or vectors.shape[1] != 3:
        raise ReadingsError(f"{name}: expected shape (n, 3), got {vectors.shape}. Give one row a reading.")
    if np.isinf(vectors).any():
        raise ReadingsError(f"{name}: expected finite numbers, got infinity. Correct them.")
    norms = np.linalg.norm(vectors, axis=1)
    short = np.flatnonzero(norms < 1e-9)
    if len(short):
        raise ReadingsError(f"{name}: expected a vector that is not zero, got zero in row {short[0] + 1}.")
    # the check of numbers reports rows that are partly NaN
    return np.asarray(vectors / np.where(np.isnan(norms), 1.0, norms)[:, None])


_COLUMNS = {
    "points": (3,), "directions": (3,), "normals": (3,), "normal_sds": (), "sds": (), "across_sds": (), "radii": (),
    "Ts_world_hand": (4, 4), "ranges": (), "max_ranges": (), "hole_radii": (), "half_angles": (),
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
        hole_radii: radii of the holes, bosses or spheres whose centre a row states ``(n,)`` [m].
        half_angles: half angles of the cones whose apex a row states ``(n,)`` [rad].
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
        """Return readings from the given columns in metres and radians, world frame.

        The other columns are missing values.

        The columns are those of the class. ``n``, the number of readings, is needed only if ``points``, ``ranges`` and
        ``ids`` are all missing. Directions and normals may have any length except zero.

        Args:
            points: sensed points, or centres of the tip's ball ``(n, 3)`` [m].
            n: number of readings; None to derive it from the columns.
            ids: unique names; None for 1, 2, ...
            directions: viewing or approach directions ``(n, 3)``.
            normals: sensed outward surface normals ``(n, 3)``.
            normal_sds: standard deviations of the normals for each tilt component ``(n,)`` [rad].
            sds: standard deviations along the beam or normal ``(n,)`` [m].
            across_sds: standard deviations across the beam ``(n,)`` [m].
            radii: radii of the tip's ball ``(n,)`` [m]; None for 0.
            features: labels of the features.
            kinds: kinds of the readings, see the class; None for ``point``.
            Ts_world_hand: poses of the hand ``(n, 4, 4)`` [m].
            ranges: reported ranges ``(n,)`` [m].
            sensors: names of the sensors.
            is_free: mask of beams that hit nothing ``(n,)``.
            max_ranges: free lengths of free-space rays ``(n,)`` [m].
            hole_radii: radii of holes, bosses and spheres ``(n,)`` [m].
            half_angles: half angles of cones ``(n,)`` [rad].
            material_sides: ``hole``, ``boss`` or empty for each row.
            source: origin of the readings (a file name), for messages.
            notes: sentences about assumptions and ignored content.

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
"""Largest useful number of readings.

The pose is then known 70 times better than one reading, beyond part tolerances.
"""


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
