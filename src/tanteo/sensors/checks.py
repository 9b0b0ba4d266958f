"""Check the validity of a set of readings."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.geometry.limits import LARGEST, LARGEST_TILT_SD, LEAST_SD, LEAST_TILT_SD
from tanteo.geometry.typing import BoolArray
from tanteo.sensors.kinds import SIZES, reading_kind, reading_kinds

if TYPE_CHECKING:
    from tanteo.sensors.columns import Column
    from tanteo.sensors.readings import Readings

_COLUMNS = (
    "points", "directions", "normals", "normal_sds", "sds", "across_sds", "Ts_world_hand", "ranges",
    "true_distances", "max_ranges", "hole_radii", "half_angles",
)  # fmt: skip
_SIDES = "", "hole", "boss"

_POSITIVE = {
    "normal_sds": "rad", "sds": "m", "across_sds": "m", "ranges": "m", "true_distances": "m", "max_ranges": "m",
    "hole_radii": "m", "half_angles": "rad",
}  # fmt: skip

_LENGTHS = "points", "ranges", "true_distances", "max_ranges", "hole_radii", "sds", "across_sds"


def check_readings(readings: Readings) -> None:
    """Check that a set of readings is valid.

    Names must be unique, kinds known, numbers finite, directions unit; a label must have one kind, and every row a
    position.

    Args:
        readings: readings to check.

    Raises:
        ReadingsError: a check fails; the message names the reading.
    """
    _check_ids(readings.ids)
    _check_kinds(readings)
    _check_numbers(readings)
    _check_tilts(readings)
    _check_hands(readings)
    _check_labels(readings)
    _check_centres(readings)
    _check_located(readings)


def check_features(readings: Readings) -> None:
    """Check that every labelled feature has the number of readings that its kind requires, such as three for a plane.

    Args:
        readings: readings to check.

    Raises:
        ReadingsError: a label has too few readings; the message names label and readings.
    """
    counts = Counter(zip(readings.features, readings.kinds, strict=True))
    for (label, kind), count in counts.items():
        least = reading_kind(kind).least
        if label and count < least:
            members = [i for i, f in zip(readings.ids, readings.features, strict=True) if f == label]
            raise ReadingsError(
                f"feature '{label}': expected at least {least} readings of kind {kind}, got {count} "
                f"({', '.join(members)}). Sense more of it, or leave feature and kind empty to use unlabelled points."
            )


def _check_ids(ids: tuple[str, ...]) -> None:
    if len(set(ids)) < len(ids):
        twice = next(i for i, count in Counter(ids).items() if count > 1)
        raise ReadingsError(f"id: expected every reading to have its own, got '{twice}' twice. Rename one.")
    if not all(ids):
        raise ReadingsError(f"id: expected a name, got none in row {ids.index('') + 1}. Name every reading or none.")


def _check_kinds(readings: Readings) -> None:
    for kind in sorted(set(readings.kinds)):
        reading_kind(kind)
    if any((kind == "free") != free for kind, free in zip(readings.kinds, readings.is_free.tolist(), strict=True)):
        raise ReadingsError("is_free: expected it true exactly where kind is 'free', got a mixture. Use from_columns.")


def _first_bad(readings: Readings, bad: BoolArray) -> str | None:
    rows = np.flatnonzero(bad)
    return f"'{readings.ids[rows[0]]}'" if len(rows) else None


def _first_where(readings: Readings, column: Column, bad: BoolArray) -> str | None:
    """Return the name of the first reading whose value in a column is bad; None if there is none.

    Args:
        readings: readings with the column.
        column: column of the readings.
        bad: mask of the column's values ``(m,)``.
    """
    rows = np.flatnonzero(column.given)[bad]
    return f"'{readings.ids[rows[0]]}'" if len(rows) else None


def _check_numbers(readings: Readings) -> None:
    for name in _COLUMNS:
        column: Column = getattr(readings, name)
        wrong = ~np.isfinite(column.values)
        if who := _first_where(readings, column, np.any(wrong.reshape(len(wrong), math.prod(wrong.shape[1:])), axis=1)):
            raise ReadingsError(f"{name} of reading {who}: expected finite numbers, got NaN or infinity. Correct them.")
    for name, unit in _POSITIVE.items():
        column = getattr(readings, name)
        if who := _first_where(readings, column, column.values <= 0):
            value = column.values[column.values <= 0][0]
            raise ReadingsError(f"{name} of reading {who}: expected a positive number [{unit}], got {value:g}.")
    for name in _LENGTHS:
        column = getattr(readings, name)
        far = (np.abs(column.values) > LARGEST).reshape(len(column.values), math.prod(column.values.shape[1:]))
        if who := _first_where(readings, column, np.any(far, axis=1)):
            raise ReadingsError(f"{name} of reading {who}: expected at most {LARGEST:g} m, got more. Check the units.")
    for name in ("sds", "across_sds"):
        column = getattr(readings, name)
        if who := _first_where(readings, column, column.values < LEAST_SD):
            raise ReadingsError(
                f"{name} of reading {who}: expected at least {LEAST_SD:g} m, got less. Check the units."
            )
    if who := _first_bad(readings, np.isinf(readings.radii)):
        raise ReadingsError(f"radii of reading {who}: expected finite numbers, got NaN or infinity. Correct them.")
    if who := _first_bad(readings, readings.radii > LARGEST):
        raise ReadingsError(f"radii of reading {who}: expected at most {LARGEST:g} m, got more. Check the units.")
    if who := _first_bad(readings, ~(readings.radii >= 0)):
        raise ReadingsError(f"radii of reading {who}: expected zero or more [m], got a negative number or NaN.")
    for name in ("directions", "normals"):
        column = getattr(readings, name)
        norms = np.linalg.norm(column.values, axis=1)
        if who := _first_where(readings, column, np.abs(norms - 1) > 1e-6):
            raise ReadingsError(f"{name} of reading {who}: expected unit length, got another. Use from_columns.")


def _check_tilts(readings: Readings) -> None:
    """Check that standard deviations of sensed normals are possible for a device and still determine a direction."""
    sds = readings.normal_sds.values
    wrong = (sds < LEAST_TILT_SD) | (sds > LARGEST_TILT_SD * (1 + 1e-9))
    if who := _first_where(readings, readings.normal_sds, wrong):
        least, most, got = np.degrees([LEAST_TILT_SD, LARGEST_TILT_SD, sds[wrong][0]])
        raise ReadingsError(
            f"normal_sds of reading {who}: expected from {least:.2g} to {most:.0f} degrees, got {got:.3g}. Check the "
            "unit, or drop a normal that is not known better."
        )


def _check_hands(readings: Readings) -> None:
    Ts = readings.Ts_world_hand.values
    if (np.abs(Ts[:, :3, 3]) > LARGEST).any():
        raise ReadingsError(
            f"Ts_world_hand: expected a hand within {LARGEST:g} m, got one farther away. Check the units."
        )
    R = Ts[:, :3, :3]
    skewed = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(1, 2), initial=0) > 1e-6
    mirrored = np.linalg.det(R) < 0
    if skewed.any() or mirrored.any() or (Ts[:, 3] != [0.0, 0.0, 0.0, 1.0]).any():
        raise ReadingsError("Ts_world_hand: expected rigid motions, got a matrix that scales, shears or mirrors.")


def _check_labels(readings: Readings) -> None:
    kinds: dict[str, str] = {}
    for label, kind, name in zip(readings.features, readings.kinds, readings.ids, strict=True):
        if label and kinds.setdefault(label, kind) != kind:
            raise ReadingsError(
                f"kind of reading '{name}': expected '{kinds[label]}' as for the other readings of feature "
                f"'{label}', got '{kind}'. Give one label one kind."
            )
        if not label and reading_kind(kind).is_labelled:
            raise ReadingsError(
                f"feature of reading '{name}': expected a label for kind '{kind}', got none. Label the readings "
                "that were taken on one feature, or leave kind empty."
            )


def _check_centres(readings: Readings) -> None:
    """Check that only centres of round features have a hole's size and side, and that they have no tip radius."""
    if strange := set(readings.material_sides) - set(_SIDES):
        raise ReadingsError(f"material_sides: expected hole, boss or nothing, got '{min(strange)}'. Correct it.")
    kinds = [reading_kind(kind) for kind in readings.kinds]
    centre = np.array([kind.is_centre for kind in kinds], dtype=bool)
    stated = np.array([bool(side) for side in readings.material_sides], dtype=bool)
    sized = {column: getattr(readings, column).given for column in SIZES.values()}
    if who := _first_bad(readings, np.any([stated, *sized.values()], axis=0) & ~centre):
        centres = [name for name in reading_kinds() if reading_kind(name).is_centre]
        raise ReadingsError(
            f"kind of reading {who}: expected one of {', '.join(centres)} of a row with the radius or side of a hole "
            "or boss, got another. Correct the kind, or leave radius and side of the hole empty."
        )
    for column, given in sized.items():
        if who := _first_bad(readings, given & np.array([kind.size != column for kind in kinds], dtype=bool)):
            raise ReadingsError(
                f"{column} of reading {who}: expected the half angle of an apex, or the radius of another centre, got "
                "the other. Give the size that the feature has."
            )
    if who := _first_bad(readings, centre & (readings.radii > 0)):
        raise ReadingsError(
            f"radii of reading {who}: expected none of the centre of a circle, which is no centre of a tip's ball, got "
            "one. The radius of a hole or boss is hole_radii (hole_radius_mm in a file)."
        )
    if who := _first_where(readings, readings.half_angles, readings.half_angles.values >= np.pi / 2):
        raise ReadingsError(
            f"half_angles of reading {who}: expected the half angle of a cone below pi/2 rad, got more. Is it in "
            "degrees?"
        )


def _check_located(readings: Readings) -> None:
    """Check that every row has a point, or a range with hand pose; a free-space ray also needs direction and length."""
    has_hand = readings.Ts_world_hand.given
    by_rig = has_hand & np.fromiter(map(bool, readings.sensors), dtype=bool, count=len(readings))
    ranged = (by_rig | readings.true_distances.given) & readings.ranges.given
    if who := _first_bad(readings, ~readings.is_free & ~readings.points.given & ~ranged):
        raise ReadingsError(
            f"reading {who}: expected a point (x, y, z) or a range with sensor and hand pose, got neither. Fill one."
        )
    aimed = (readings.points.given & readings.directions.given & readings.max_ranges.given) | by_rig
    aimed |= readings.true_distances.given
    if who := _first_bad(readings, readings.is_free & ~aimed):
        raise ReadingsError(
            f"free reading {who}: expected where the beam was (x, y, z, dx, dy, dz and max, or sensor and hand pose), "
            "got less. Fill them in, or drop the row."
        )
    if who := _first_bad(readings, readings.normal_sds.given & ~readings.normals.given):
        raise ReadingsError(f"normal_sd of reading {who}: expected a normal beside it, got none. Add nx, ny, nz.")
