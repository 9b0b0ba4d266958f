"""Values of one table of a rig file: keys and their units, numbers in metres and radians, words about what is wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from tanteo.errors import InputError, UnitError, did_you_mean
from tanteo.io.units import ANGLE_UNITS, LENGTH_UNITS
from tanteo.typing import FloatArray

_LENGTHS = ("position", "sd", "max", "bias", "bias_sd", "mount_sd", "unit_position")
_ANGLES = ("beam_half_angle", "mount_turn_sd", "field")
_PLAIN = (
    "preset", "direction", "quaternion_wxyz", "axis", "sd_per_range", "scale", "scale_sd", "zones", "unit",
    "unit_quaternion_wxyz",
)  # fmt: skip
_COVARIANCES = {"mount_covariance_m_rad": (6, 6), "scale_covariance_m_rad": (6,)}


class Values(dict[str, Any]):
    """Values by key without unit, in metres and radians; knows how they are written.

    Attributes:
        written: of each, its key and value in the file.
    """

    def __init__(self) -> None:
        super().__init__()
        self.written: dict[str, tuple[str, Any]] = {}

    def refused(self, key: str, place: str, expected: str) -> InputError:
        """What is wrong with a value, as it is written."""
        written, value = self.written[key]
        return InputError(f"{place}, {written}: expected {expected}, got {value!r}. Correct it.")


def in_si(table: Mapping[str, Any], place: str) -> Values:
    """Values by key without unit, in metres and radians."""
    out = Values()
    for key, value in table.items():
        if key in _COVARIANCES:
            out[key] = _matrix(value, key, _COVARIANCES[key], place)
            continue
        base, factor = _key(key, place)
        if base in out:
            raise UnitError(f"{place}, {key}: expected '{base}' once, got it in two units. Keep one.")
        out[base] = value if factor is None else np.asarray(_numeric(value, key, place)) * factor
        out.written[base] = key, value
    return out


def _key(key: str, place: str) -> tuple[str, float | None]:
    if key in _PLAIN:
        return key, None
    base, _, unit = key.rpartition("_")
    for bases, units in ((_LENGTHS, LENGTH_UNITS), (_ANGLES, ANGLE_UNITS)):
        if base in bases and unit in units:
            return base, units[unit]
        if key in bases or base in bases:
            listed = ", ".join(f"{base if base in bases else key}_{u}" for u in units)
            raise UnitError(f"{place}, {key}: expected one of {listed}, got '{key}'. Say the unit in the name.")
    lengths, angles = (f"{name}_mm" for name in _LENGTHS), (f"{name}_deg" for name in _ANGLES)
    known = [*_PLAIN, *lengths, *angles, *_COVARIANCES]
    only({key: None}, known, place)
    raise AssertionError(key)


def only(table: Mapping[str, Any], known: tuple[str, ...] | list[str], place: str) -> None:
    """Nothing, if every key is known.

    Raises:
        InputError: one is not; the message names the nearest that is.
    """
    for key in table:
        if key not in known:
            raise InputError(f"{place}: expected one of {', '.join(known)}, got '{key}'.{did_you_mean(key, known)}")


def numbers(values: Values, key: str, n: int, place: str) -> FloatArray:
    """So many numbers ``(n,)``, which have to be there."""
    if key not in values:
        raise InputError(f"{place}: expected '{key}' ({n} numbers), got nothing. Add it.")
    array = np.asarray(_numeric(values[key], key, place) if key in _PLAIN else values[key], dtype=np.float64)
    if array.shape != (n,):
        raise InputError(f"{place}, {values.written[key][0]}: expected {n} numbers, got {array.size}. Correct it.")
    return array


def number(
    values: Values,
    key: str,
    default: float,
    place: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
) -> float:
    """One number above ``above`` and not less than ``least``; the default without the key."""
    if key not in values:
        return default
    array = np.asarray(_numeric(values[key], key, place) if key in _PLAIN else values[key])
    if array.ndim or not (array > above and array >= least):
        expected = "one number"
        if least == 0 or above == 0:
            expected = "one number of zero or more" if least == 0 else "one positive number"
        elif above > -math.inf:
            expected = f"one number above {above:g}"
        raise values.refused(key, place, expected)
    return float(array)


def per_axis(values: Values, key: str, place: str) -> FloatArray:
    """One standard deviation for all three axes, or three; zero when the key is absent."""
    array = np.asarray(values.get(key, 0.0), dtype=np.float64)
    if array.shape not in ((), (3,)) or (array < 0).any():
        raise values.refused(key, place, "one or three numbers of zero or more")
    return np.array(np.broadcast_to(array, 3))


def _numeric(value: Any, key: str, place: str) -> float | list[float]:
    items = value if isinstance(value, list) else [value]
    good = all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in items)
    if not good or not items:
        raise InputError(f"{place}, {key}: expected finite numbers, got {value!r}. Correct it.")
    return [float(v) for v in items] if isinstance(value, list) else float(value)


def _matrix(value: Any, key: str, shape: tuple[int, ...], place: str) -> FloatArray:
    rows = value if isinstance(value, list) and len(shape) == 2 else [value]
    entries = [_numeric(row, key, place) for row in rows]
    try:
        return np.asarray(entries, dtype=np.float64).reshape(shape)
    except ValueError:
        size = " x ".join(map(str, shape))
        raise InputError(f"{place}, {key}: expected {size} numbers, got {value!r}. Copy them whole.") from None
