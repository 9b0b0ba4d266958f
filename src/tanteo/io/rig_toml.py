"""Rig files: where the range sensors sit on the hand (TOML, ``docs/formats.md``)."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import CovarianceError, InputError, UnitError
from tanteo.frames import check_covariance
from tanteo.io.rig_checks import check_beam, check_twins
from tanteo.io.rig_zones import zones_of
from tanteo.io.units import ANGLE_UNITS, LENGTH_UNITS
from tanteo.lie import SE3, SO3
from tanteo.sensors import Rig, RigSensor, SensorPreset, sensor_preset
from tanteo.typing import Covariances, FloatArray, Rotations, Transforms

_LENGTHS = ("position", "sd", "max", "bias", "bias_sd", "mount_sd", "unit_position")
_ANGLES = ("beam_half_angle", "mount_turn_sd", "field")
_PLAIN = (
    "preset", "direction", "quaternion_wxyz", "axis", "sd_per_range", "scale", "scale_sd", "zones", "unit",
    "unit_quaternion_wxyz",
)  # fmt: skip
_COVARIANCES = {"mount_covariance_m_rad": (6, 6), "scale_covariance_m_rad": (6,)}


def read_rig(path: str | Path) -> Rig:
    """Read a rig file: one table ``[sensors.NAME]`` a sensor.

    Args:
        path: The file, or the name of a rig that comes with tanteo (:func:`shipped_rigs`).

    Raises:
        InputError: The file cannot be read, is not TOML, or a key or value is not one of a rig; the message names
            file, sensor, key and value.
        UnitError: A unit in a key is missing, unknown or contradictory.
    """
    shipped = shipped_rigs().get(str(path))
    path = Path(path)
    try:
        text = path.read_bytes().decode() if shipped is None or path.exists() else shipped
        document = tomllib.loads(text)
    except OSError as error:
        why = error.strerror or str(error)
        raise InputError(
            f"{path}: expected a rig file or one of {', '.join(shipped_rigs())}, got: {why}. Check the path."
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: expected TOML, got: {error}. Correct the file.") from None
    _only(document, ("sensors",), str(path))
    tables = document.get("sensors")
    if not isinstance(tables, dict) or not tables:
        raise InputError(f"{path}: expected tables [sensors.NAME], one a sensor, got none. Add one.")
    found = (_sensors(name, table, f"{path}, sensor '{name}'") for name, table in tables.items())
    rig = Rig(tuple(sensor for sensors in found for sensor in sensors), str(path))
    check_twins(rig, str(path))
    return rig


@cache
def shipped_rigs() -> Mapping[str, str]:
    """The rigs that come with tanteo: name to text."""
    folder = resources.files("tanteo.sensors")
    files = [f for f in folder.iterdir() if f.name.endswith(".toml")]
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in sorted(files, key=lambda f: f.name)}


def _sensors(name: str, table: Any, place: str) -> tuple[RigSensor, ...]:
    """The sensor of a table, or all the zones of a multi-zone one."""
    if not isinstance(table, dict):
        raise InputError(f"{place}: expected a table [sensors.{name}], got {table!r}. Write it so.")
    values = _in_si(table, place)
    preset = _preset(values.get("preset"), place)
    if preset is None and not {"sd", "beam_half_angle"} <= values.keys():
        raise InputError(f"{place}: expected a preset, or sd_mm and beam_half_angle_deg, got neither. Add them.")
    R = _rotation(values, place)
    unit, T_hand_unit = _unit(values, place)
    sensor = RigSensor(
        name=name,
        unit=unit,
        T_hand_unit=T_hand_unit,
        T_hand_sensor=SE3.from_parts(R, _numbers(values, "position", 3, place)),
        preset=preset,
        sd=_number(values, "sd", math.nan, place, above=0),
        beam_half_angle=_number(values, "beam_half_angle", preset.beam_half_angle if preset else 0.0, place, least=0),
        max_range=_number(values, "max", preset.max_range if preset else math.nan, place, above=0),
        bias_sd=_number(values, "bias_sd", preset.bias_std if preset else 0.0, place, least=0),
        cov_mount=_mount(values, place),
        axis_cosine=_axis_cosine(values, R, place),
        sd_prop=_number(values, "sd_per_range", 0.0, place, least=0),
        bias=_number(values, "bias", 0.0, place),
        scale=_number(values, "scale", 0.0, place, above=-1),
        scale_sd=_number(values, "scale_sd", math.nan, place, least=0),
        cov_scale=values.get("scale_covariance_m_rad", np.zeros(6)),
    )
    check_beam(sensor, place)
    return (sensor,) if not {"zones", "field"} & values.keys() else zones_of(sensor, values, place)


def _unit(values: Mapping[str, Any], place: str) -> tuple[str, Transforms]:
    """Name and pose of the device that a beam is one of; nothing for a device of its own."""
    keys = {"unit", "unit_position", "unit_quaternion_wxyz"} & values.keys()
    if not keys:
        return "", np.full((4, 4), np.nan)
    if len(keys) < 3 or not isinstance(values["unit"], str) or not values["unit"]:
        raise InputError(
            f"{place}: expected unit (a name), unit_position_mm and unit_quaternion_wxyz together, got "
            f"{', '.join(sorted(keys))}. Give all three, or none for a device of its own."
        )
    return values["unit"], SE3.from_parts(
        _quaternion(values, "unit_quaternion_wxyz", place), _numbers(values, "unit_position", 3, place)
    )


def _mount(values: Mapping[str, Any], place: str) -> Covariances:
    """Covariance of the mounting: from standard deviations, or whole as a calibration writes it."""
    if "mount_covariance_m_rad" not in values:
        sds = np.concatenate([_per_axis(values, "mount_sd", place), _per_axis(values, "mount_turn_sd", place)])
        return np.diag(sds**2)
    if {"mount_sd", "mount_turn_sd"} & values.keys():
        raise InputError(f"{place}: expected mount_covariance_m_rad or mount_sd and mount_turn_sd, got both. Keep one.")
    try:
        return check_covariance(f"{place}, mount_covariance_m_rad", values["mount_covariance_m_rad"], 6)
    except CovarianceError as error:
        raise InputError(f"{error} Copy it as the calibration wrote it.") from None


def _in_si(table: Mapping[str, Any], place: str) -> dict[str, Any]:
    """Values by key without unit, in metres and radians."""
    out: dict[str, Any] = {}
    for key, value in table.items():
        if key in _COVARIANCES:
            out[key] = _matrix(value, key, _COVARIANCES[key], place)
            continue
        base, factor = _key(key, place)
        if base in out:
            raise UnitError(f"{place}, {key}: expected '{base}' once, got it in two units. Keep one.")
        out[base] = value if factor is None else np.asarray(_numeric(value, key, place)) * factor
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
    _only({key: None}, known, place)
    raise AssertionError(key)


def _only(table: Mapping[str, Any], known: tuple[str, ...] | list[str], place: str) -> None:
    for key in table:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f" Did you mean '{near[0]}'?" if near else ""
            raise InputError(f"{place}: expected one of {', '.join(known)}, got '{key}'.{hint}")


def _numeric(value: Any, key: str, place: str) -> float | list[float]:
    items = value if isinstance(value, list) else [value]
    good = all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in items)
    if not good or not items:
        raise InputError(f"{place}, {key}: expected finite numbers, got {value!r}. Correct it.")
    return [float(v) for v in items] if isinstance(value, list) else float(value)


def _numbers(values: Mapping[str, Any], key: str, n: int, place: str) -> FloatArray:
    if key not in values:
        raise InputError(f"{place}: expected '{key}' ({n} numbers), got nothing. Add it.")
    array = np.asarray(_numeric(values[key], key, place) if key in _PLAIN else values[key], dtype=np.float64)
    if array.shape != (n,):
        raise InputError(f"{place}, {key}: expected {n} numbers, got {array.size}. Correct it.")
    return array


def _number(
    values: Mapping[str, Any],
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
        raise InputError(f"{place}, {key}: expected {expected}, got {array.tolist()}. Correct it.")
    return float(array)


def _matrix(value: Any, key: str, shape: tuple[int, ...], place: str) -> FloatArray:
    rows = value if isinstance(value, list) and len(shape) == 2 else [value]
    numbers = [_numeric(row, key, place) for row in rows]
    try:
        return np.asarray(numbers, dtype=np.float64).reshape(shape)
    except ValueError:
        size = " x ".join(map(str, shape))
        raise InputError(f"{place}, {key}: expected {size} numbers, got {value!r}. Copy them whole.") from None


def _per_axis(values: Mapping[str, Any], key: str, place: str) -> FloatArray:
    """One standard deviation for all three axes, or three; zero when the key is absent."""
    array = np.asarray(values.get(key, 0.0), dtype=np.float64)
    if array.shape not in ((), (3,)) or (array < 0).any():
        raise InputError(f"{place}, {key}: expected one or three numbers of zero or more, got {array.tolist()}.")
    return np.array(np.broadcast_to(array, 3))


def _preset(name: Any, place: str) -> SensorPreset | None:
    if name is None:
        return None
    if not isinstance(name, str):
        raise InputError(f"{place}, preset: expected a name, got {name!r}. Write it in quotes.")
    preset = sensor_preset(name)
    if preset.is_contact:
        raise InputError(f"{place}, preset: expected a range sensor, got '{name}', which touches. Use --sensor for it.")
    return preset


def _rotation(values: Mapping[str, Any], place: str) -> Rotations:
    """Sensor axes on the hand, from a quaternion or from the direction of the beam (turn about it arbitrary)."""
    if ("quaternion_wxyz" in values) == ("direction" in values):
        raise InputError(f"{place}: expected direction or quaternion_wxyz, got both or neither. Give one.")
    if "direction" in values:
        return SO3.frame_from_axis(_direction(values, "direction", place), 2)
    return _quaternion(values, "quaternion_wxyz", place)


def _quaternion(values: Mapping[str, Any], key: str, place: str) -> Rotations:
    q = _numbers(values, key, 4, place)
    if abs(np.linalg.norm(q) - 1) > 1e-3:
        raise InputError(f"{place}, {key}: expected unit length, got {np.linalg.norm(q):.6g}. Normalise it.")
    return SO3.from_quaternion(q)


def _direction(values: Mapping[str, Any], key: str, place: str) -> FloatArray:
    d = _numbers(values, key, 3, place)
    length = float(np.linalg.norm(d))
    if length < 1e-9:
        raise InputError(f"{place}, {key}: expected a direction that is not zero, got {d.tolist()}. Correct it.")
    return d / length


def _axis_cosine(values: Mapping[str, Any], R: Rotations, place: str) -> float:
    """Between beam and optical axis: some devices report the distance along the axis."""
    if "axis" not in values:
        return 1.0
    return min(1.0, float(_direction(values, "axis", place) @ R[:, 2]))
