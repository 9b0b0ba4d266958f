"""Rig files: where the range sensors sit on the hand (TOML, ``docs/formats.md``)."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import CovarianceError, InputError
from tanteo.frames import check_covariance
from tanteo.io.rig_checks import check_beam, check_twins
from tanteo.io.rig_values import Values, in_si, number, numbers, only, per_axis
from tanteo.io.rig_zones import zones_of
from tanteo.lie import SE3, SO3
from tanteo.sensors import Rig, RigSensor, SensorPreset, sensor_preset
from tanteo.typing import Covariances, FloatArray, Rotations, Transforms


def read_rig(path: str | Path) -> Rig:
    """Read a rig file: one table ``[sensors.NAME]`` a sensor.

    Args:
        path: The file, or the name of a rig that comes with tanteo (:func:`shipped_rigs`).

    Raises:
        InputError: The file cannot be read, is not TOML, or a key or value is not one of a rig; the message names
            file, sensor, key and value.
        UnitError: A unit in a key is missing, unknown or contradictory.

    Example:
        >>> rig = tanteo.read_rig("readings/laser_rig.toml")
        >>> [sensor.name for sensor in rig.sensors]
        ['laser']
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
    only(document, ("sensors",), str(path))
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
    values = in_si(table, place)
    preset = _preset(values.get("preset"), place)
    if preset is None and not {"sd", "beam_half_angle"} <= values.keys():
        raise InputError(f"{place}: expected a preset, or sd_mm and beam_half_angle_deg, got neither. Add them.")
    R = _rotation(values, place)
    unit, T_hand_unit = _unit(values, place)
    sensor = RigSensor(
        name=name,
        unit=unit,
        T_hand_unit=T_hand_unit,
        T_hand_sensor=SE3.from_parts(R, numbers(values, "position", 3, place)),
        preset=preset,
        sd=number(values, "sd", math.nan, place, above=0),
        beam_half_angle=number(values, "beam_half_angle", preset.beam_half_angle if preset else 0.0, place, least=0),
        max_range=number(values, "max", preset.max_range if preset else math.nan, place, above=0),
        bias_sd=number(values, "bias_sd", preset.bias_std if preset else 0.0, place, least=0),
        cov_mount=_mount(values, place),
        axis_cosine=_axis_cosine(values, R, place),
        sd_prop=number(values, "sd_per_range", 0.0, place, least=0),
        bias=number(values, "bias", 0.0, place),
        scale=number(values, "scale", 0.0, place, above=-1),
        scale_sd=number(values, "scale_sd", math.nan, place, least=0),
        cov_scale=values.get("scale_covariance_m_rad", np.zeros(6)),
    )
    check_beam(sensor, place)
    return (sensor,) if not {"zones", "field"} & values.keys() else zones_of(sensor, values, place)


def _unit(values: Values, place: str) -> tuple[str, Transforms]:
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
        _quaternion(values, "unit_quaternion_wxyz", place), numbers(values, "unit_position", 3, place)
    )


def _mount(values: Values, place: str) -> Covariances:
    """Covariance of the mounting: from standard deviations, or whole as a calibration writes it."""
    if "mount_covariance_m_rad" not in values:
        sds = np.concatenate([per_axis(values, "mount_sd", place), per_axis(values, "mount_turn_sd", place)])
        return np.diag(sds**2)
    if {"mount_sd", "mount_turn_sd"} & values.keys():
        raise InputError(f"{place}: expected mount_covariance_m_rad or mount_sd and mount_turn_sd, got both. Keep one.")
    try:
        return check_covariance(f"{place}, mount_covariance_m_rad", values["mount_covariance_m_rad"], 6)
    except CovarianceError as error:
        raise InputError(f"{error} Copy it as the calibration wrote it.") from None


def _preset(name: Any, place: str) -> SensorPreset | None:
    if name is None:
        return None
    if not isinstance(name, str):
        raise InputError(f"{place}, preset: expected a name, got {name!r}. Write it in quotes.")
    preset = sensor_preset(name)
    if preset.is_contact:
        raise InputError(f"{place}, preset: expected a range sensor, got '{name}', which touches. Use --sensor for it.")
    return preset


def _rotation(values: Values, place: str) -> Rotations:
    """Sensor axes on the hand, from a quaternion or from the direction of the beam (turn about it arbitrary)."""
    if ("quaternion_wxyz" in values) == ("direction" in values):
        raise InputError(f"{place}: expected direction or quaternion_wxyz, got both or neither. Give one.")
    if "direction" in values:
        return SO3.frame_from_axis(_direction(values, "direction", place), 2)
    return _quaternion(values, "quaternion_wxyz", place)


def _quaternion(values: Values, key: str, place: str) -> Rotations:
    q = numbers(values, key, 4, place)
    if abs(np.linalg.norm(q) - 1) > 1e-3:
        raise InputError(f"{place}, {key}: expected unit length, got {np.linalg.norm(q):.6g}. Normalise it.")
    return SO3.from_quaternion(q)


def _direction(values: Values, key: str, place: str) -> FloatArray:
    d = numbers(values, key, 3, place)
    length = float(np.linalg.norm(d))
    if length < 1e-9:
        raise InputError(f"{place}, {key}: expected a direction that is not zero, got {d.tolist()}. Correct it.")
    return d / length


def _axis_cosine(values: Values, R: Rotations, place: str) -> float:
    """Between beam and optical axis: some devices report the distance along the axis."""
    if "axis" not in values:
        return 1.0
    return min(1.0, float(_direction(values, "axis", place) @ R[:, 2]))
