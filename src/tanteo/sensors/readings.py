"""Define readings: the unprocessed output of devices, in the world frame, in metres and radians."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError, check_kind
from tanteo.geometry import frozen_array
from tanteo.geometry.limits import check_length
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms, Vectors
from tanteo.sensors.checks import check_readings
from tanteo.sensors.columns import Column, column_of, joined, real_numbers, unit_vectors
from tanteo.values import Value, html_table


def names_of(values: Sequence[object]) -> tuple[str, ...]:
    """Return names as text; None and NaN, which tables have in empty cells, become empty.

    Args:
        values: names of any type.
    """
    return tuple("" if v is None or v != v else str(v) for v in values)


def _cell(value: float) -> str:
    return f"{value:.4f}" if np.isfinite(value) else ""


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


_COLUMNS = {
    "points": (3,), "directions": (3,), "normals": (3,), "normal_sds": (), "sds": (), "across_sds": (),
    "Ts_world_hand": (4, 4), "ranges": (), "true_distances": (), "max_ranges": (), "hole_radii": (),
    "half_angles": (),
}  # fmt: skip
"""Columns that only some readings have, with the shape of their quantity."""

_SHOWN = 20
"""Number of readings that a notebook shows: one screen."""

_NAMES = ("ids", "features", "kinds", "sensors", "material_sides", "groups")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Readings(Value):
    """``n`` readings as a structure of columns.

    A :class:`~tanteo.sensors.Column` has numbers of only those readings whose device reported them: ``given`` is the
    mask, ``values`` the numbers, ``column[rows]`` the numbers of rows that have them. Names are empty where there is
    none. Use :meth:`from_columns`, which normalizes directions and checks everything.

    Attributes:
        ids: unique names of the readings.
        points: sensed points in the world, or centres of the tip's ball where ``radii`` is positive ``(n, 3)`` [m];
            start of the beam for a free-space ray; not given where the device reported only a range.
        directions: unit viewing or approach directions in the world ``(n, 3)``.
        normals: sensed unit outward surface normals in the world ``(n, 3)``.
        normal_sds: standard deviations of the normals for each of the two tilt components ``(n,)`` [rad].
        sds: standard deviations along the beam or normal ``(n,)`` [m].
        across_sds: standard deviations across the beam ``(n,)`` [m], where better known than by the beam's cone, as for
            an edge located by crossing it.
        radii: radii of the tip's ball ``(n,)`` [m]; 0 for a sharp tip.
        features: labels; rows with one label lie on one feature.
        kinds: kind of each row: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder`` (contacts on the wall of a
            hole or boss), ``sphere``, ``cone``, ``centre``, ``sphere_centre``, ``apex``, ``point`` or ``free``. A
            ``centre`` lies on the axis of a hole or boss at any height; its normal, if given, is the axis with either
            sign. The normal of an ``apex`` is the axis into the cone. Centres and apexes have no tip radius.
        Ts_world_hand: poses of the hand at the readings ``(n, 4, 4)`` [m].
        ranges: reported ranges along the beam ``(n,)`` [m].
        true_distances: known distances from the device to a surface across its axis ``(n,)`` [m], for a calibration.
        sensors: names of the rig's sensors that measured the ranges.
        is_free: mask of beams that hit nothing (status ``none``) ``(n,)``.
        max_ranges: free lengths of free-space rays ``(n,)`` [m].
        hole_radii: radii of the holes, bosses or spheres whose centre a row states ``(n,)`` [m].
        half_angles: half angles of the cones whose apex a row states ``(n,)`` [rad].
        material_sides: ``hole``, ``boss`` or ``''`` for rows that state a centre.
        groups: group of each reading, whose readings may share an error: a scan line, a speed, a pass; empty for none.
        source: origin of the readings (a file name), for messages.
        notes: sentences about assumptions and ignored content of the file.
        frame: name of the frame that is called the world here: that of points, directions, normals and hand poses.
        stamp: time of the last reading [s]; NaN if unknown.
        step: smallest difference of two coordinates that the file can express [m], to which they are rounded; 0 if
            unknown.

    Example:
        >>> readings = tanteo.Readings.from_columns(points=[[0.1, 0.0, 0.02], [0.12, 0.01, 0.02]], sds=[3e-4, 3e-4])
        >>> len(readings)
        2
    """

    ids: tuple[str, ...]
    points: Column
    directions: Column
    normals: Column
    normal_sds: Column
    sds: Column
    across_sds: Column
    radii: FloatArray
    features: tuple[str, ...]
    kinds: tuple[str, ...]
    Ts_world_hand: Column
    ranges: Column
    true_distances: Column
    sensors: tuple[str, ...]
    is_free: BoolArray
    max_ranges: Column
    hole_radii: Column
    half_angles: Column
    material_sides: tuple[str, ...]
    groups: tuple[str, ...] = ()
    source: str = field(default="readings")
    notes: tuple[str, ...] = ()
    frame: str = "world"
    stamp: float = math.nan
    step: float = 0.0

    def __post_init__(self) -> None:
        n = len(self.ids)
        for name, shape in _COLUMNS.items():
            object.__setattr__(self, name, column_of(name, getattr(self, name), n, shape))
        radii = real_numbers("radii", self.radii)
        if radii.shape != (n,):
            raise ReadingsError(f"radii: expected shape {(n,)}, got {radii.shape}. Give one row a reading.")
        object.__setattr__(self, "radii", frozen_array(radii))
        object.__setattr__(self, "is_free", frozen_flags(self.is_free, n))
        object.__setattr__(self, "groups", tuple(self.groups) or ("",) * n)
        for name in _NAMES[1:]:
            if len(getattr(self, name)) != n:
                raise ReadingsError(f"{name}: expected {n} entries, one a reading, got {len(getattr(self, name))}.")
        check_length("step", self.step)
        check_readings(self)

    def __len__(self) -> int:
        return len(self.ids)

    def __repr__(self) -> str:
        kinds = ", ".join(f"{count} {kind}" for kind, count in Counter(self.kinds).items())
        given = [name for name in _COLUMNS if getattr(self, name).given.any()]
        return f"Readings({len(self)} of {self.source!r}: {kinds}; with {', '.join(given)})"

    def _repr_html_(self) -> str:
        points, sds = (self.points.filled(np.nan), self.sds.filled(np.nan))
        rows = [
            [self.ids[i], self.kinds[i], self.features[i], *[_cell(1e3 * x) for x in (*points[i], sds[i])]]
            for i in range(min(len(self), _SHOWN))
        ]
        more = [f"{len(self) - _SHOWN} more readings."] if len(self) > _SHOWN else []
        headers = ["id", "kind", "label", "x mm", "y mm", "z mm", "sd mm"]
        return html_table(f"{len(self)} readings of {self.source}", headers, rows, " ".join([*more, *self.notes]))

    @classmethod
    def from_columns(
        cls,
        points: Column | Vectors | None = None,
        *,
        n: int | None = None,
        ids: Sequence[str] | None = None,
        directions: Column | Vectors | None = None,
        normals: Column | Vectors | None = None,
        normal_sds: Column | FloatArray | None = None,
        sds: Column | FloatArray | None = None,
        across_sds: Column | FloatArray | None = None,
        radii: FloatArray | None = None,
        features: Sequence[str] | None = None,
        kinds: Sequence[str] | None = None,
        Ts_world_hand: Column | Transforms | None = None,
        ranges: Column | FloatArray | None = None,
        true_distances: Column | FloatArray | None = None,
        sensors: Sequence[str] | None = None,
        is_free: BoolArray | None = None,
        max_ranges: Column | FloatArray | None = None,
        hole_radii: Column | FloatArray | None = None,
        half_angles: Column | FloatArray | None = None,
        material_sides: Sequence[str] | None = None,
        groups: Sequence[str] | None = None,
        source: str = "readings",
        notes: Sequence[str] = (),
        frame: str = "world",
        stamp: float = math.nan,
        step: float = 0.0,
    ) -> Readings:
        """Return readings from the given columns in metres and radians, world frame.

        A column is a :class:`~tanteo.sensors.Column`, or an array with one row for each reading. Rows of NaN, which
        tables have in empty cells, are readings without the quantity. Directions and normals may have any length except
        zero.

        Args:
            points: sensed points, or centres of the tip's ball ``(n, 3)`` [m].
            n: number of readings; needed only if ``points``, ``ranges`` and ``ids`` are all missing.
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
            true_distances: known distances from the device to a surface across its axis ``(n,)`` [m].
            sensors: names of the sensors.
            is_free: mask of beams that hit nothing ``(n,)``.
            max_ranges: free lengths of free-space rays ``(n,)`` [m].
            hole_radii: radii of holes, bosses and spheres ``(n,)`` [m].
            half_angles: half angles of cones ``(n,)`` [rad].
            material_sides: ``hole``, ``boss`` or empty for each row.
            groups: groups of readings that may share an error.
            source: origin of the readings (a file name), for messages.
            notes: sentences about assumptions and ignored content.
            frame: name of the frame in which points, directions and poses are.
            stamp: time of the last reading [s]; NaN if unknown.
            step: step to which the coordinates are rounded [m]; 0 if unknown.

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
        columns: dict[str, Any] = {
            "points": points, "directions": unit_vectors("directions", directions),
            "normals": unit_vectors("normals", normals), "normal_sds": normal_sds, "sds": sds,
            "across_sds": across_sds, "Ts_world_hand": Ts_world_hand, "ranges": ranges,
            "true_distances": true_distances, "max_ranges": max_ranges, "hole_radii": hole_radii,
            "half_angles": half_angles,
        }  # fmt: skip
        return cls(
            ids=tuple(map(str, range(1, n + 1))) if ids is None else names_of(ids),
            features=tuple("" if f else label for f, label in zip(free, labels, strict=True)) if free.any() else labels,
            kinds=kinds,
            sensors=("",) * n if sensors is None else names_of(sensors),
            material_sides=("",) * n if material_sides is None else names_of(material_sides),
            groups=("",) * n if groups is None else names_of(groups),
            is_free=free,
            radii=np.zeros(n) if radii is None else radii,
            source=source,
            notes=tuple(notes),
            frame=frame,
            stamp=stamp,
            step=step,
            **{name: column_of(name, column, n, _COLUMNS[name]) for name, column in columns.items()},
        )

    def take(self, rows: Sequence[int] | np.ndarray) -> Readings:
        """Return the readings at row numbers or where a mask is true, in that order.

        Args:
            rows: row numbers, or mask ``(n,)``.
        """
        index = np.arange(len(self))[np.asarray(rows)]
        columns: dict[str, Any] = {k: getattr(self, k).take(index) for k in _COLUMNS}
        names: dict[str, Any] = {k: tuple(getattr(self, k)[i] for i in index) for k in _NAMES}
        return Readings(
            **names, **columns, radii=self.radii[index], is_free=self.is_free[index], source=self.source,
            notes=self.notes, frame=self.frame, stamp=self.stamp, step=self.step,
        )  # fmt: skip


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
        ReadingsError: there is no set, a name occurs twice, or the sets are in different frames.
    """
    if not parts:
        raise ReadingsError("readings: expected at least one set to join, got none.")
    columns: dict[str, Any] = {k: joined([getattr(p, k) for p in parts]) for k in _COLUMNS}
    columns |= {k: np.concatenate([getattr(p, k) for p in parts]) for k in ("radii", "is_free")}
    names: dict[str, Any] = {k: tuple(x for p in parts for x in getattr(p, k)) for k in _NAMES}
    notes = tuple(dict.fromkeys(note for part in parts for note in part.notes))
    if len(frames := {part.frame for part in parts}) > 1:
        raise ReadingsError(f"readings: expected one frame, got {', '.join(sorted(frames))}. Transform them to one.")
    stamp = max(part.stamp for part in parts)
    step = max(part.step for part in parts)
    return Readings(
        **names, **columns, source=parts[0].source, notes=notes, frame=parts[0].frame, stamp=stamp, step=step
    )
