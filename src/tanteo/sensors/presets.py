"""Presets of sensors and robots: typical error figures, each with its source and how far it was verified.

The ``check`` text of a preset uses the letters V verified in the source, C computed by us from it, M from memory
and A assumed by us. A preset is a start: a calibration of your own device is always better.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Any, TypeVar

from tanteo.errors import InputError, did_you_mean
from tanteo.sensors.law import NoiseLaw


@dataclass(frozen=True, slots=True)
class SensorPreset:
    """Error figures of one kind of sensor. Lengths [m], angles [rad]; NaN where the figure does not apply.

    Attributes:
        name: Name of the preset.
        kind: ``tof``, ``laser_triangulation``, ``touch``, ...
        min_range: Nearest range the device gives [m].
        max_range: Farthest range [m]; 0 for a touch.
        beam_half_angle: Half angle of the beam's cone [rad].
        sigma_const: Constant standard deviation of a range [m].
        sigma_prop: Part proportional to the range.
        sigma_quad: Part proportional to the range squared [1/m].
        exp_d0: Range at which the exponential law has doubled ``sigma_const`` [m].
        exp_k: Rate of the exponential law [1/m].
        bias_std: Standard deviation of the error common to all readings of one device [m].
        bias_prop_std: The same, proportional to the range (scale error).
        max_incidence: Incidence up to which the figures hold [rad].
        rate_hz: Readings a second.
        range_kind: ``radial`` along the beam, ``perpendicular`` along the optical axis, or ``contact``.
        check: What was verified and what is assumed.
        source: Where the figures come from.
    """

    name: str
    kind: str
    min_range: float
    max_range: float
    beam_half_angle: float
    sigma_const: float
    sigma_prop: float
    sigma_quad: float
    exp_d0: float
    exp_k: float
    bias_std: float
    bias_prop_std: float
    max_incidence: float
    rate_hz: float
    range_kind: str
    check: str
    source: str

    @property
    def is_contact(self) -> bool:
        """It touches: there is no range and no beam."""
        return self.range_kind == "contact"

    @property
    def law(self) -> NoiseLaw:
        """How its noise grows with the range."""
        exponential = (self.exp_d0, self.exp_k) if self.exp_k > 0 else (0.0, 0.0)
        return NoiseLaw.of(self.sigma_const, self.sigma_prop, self.sigma_quad, *exponential)

    @property
    def depends_on_range(self) -> bool:
        """The noise grows with the range, so the range must be known."""
        return self.law.depends_on_range


@dataclass(frozen=True, slots=True)
class RobotPreset:
    """Errors of a robot's hand pose. ``repeat`` differs from reading to reading, ``abs`` is common to the run.

    Attributes:
        name: Name of the preset.
        pos_repeat_std: Position repeatability, per axis [m].
        pos_abs_std: Absolute position error, per axis [m].
        rot_repeat_std: Orientation repeatability, per axis [rad].
        rot_abs_std: Absolute orientation error, per axis [rad].
        check: What was verified and what is assumed.
        source: Where the figures come from.
    """

    name: str
    pos_repeat_std: float
    pos_abs_std: float
    rot_repeat_std: float
    rot_abs_std: float
    check: str
    source: str


_P = TypeVar("_P", SensorPreset, RobotPreset)

_DEGREES = {"beam_half_angle": "beam_half_deg", "max_incidence": "max_incidence_deg"}
_COLUMN = {
    "min_range": "min_m", "max_range": "max_m", "sigma_const": "sigma_const_m", "sigma_quad": "sigma_quad_1pm",
    "exp_d0": "exp_d0_m", "exp_k": "exp_k_1pm", "bias_std": "bias_std_m",
    "pos_repeat_std": "pos_repeat_std_m", "pos_abs_std": "pos_abs_std_m",
    "rot_repeat_std": "rot_repeat_std_rad", "rot_abs_std": "rot_abs_std_rad",
} | _DEGREES  # fmt: skip


@cache
def sensor_presets() -> Mapping[str, SensorPreset]:
    """All sensor presets by name."""
    rows = _rows("sensor_presets.csv")
    return MappingProxyType({r["name"]: SensorPreset(**_values(SensorPreset, r)) for r in rows})


@cache
def robot_presets() -> Mapping[str, RobotPreset]:
    """All robot presets by name."""
    rows = _rows("robot_error_presets.csv")
    return MappingProxyType({r["name"]: RobotPreset(**_values(RobotPreset, r)) for r in rows})


def sensor_preset(name: str) -> SensorPreset:
    """The errors of a sensor, from the shipped table.

    Args:
        name: as ``tanteo sensor list`` shows it.

    Raises:
        InputError: No such preset; the message lists the nearest names.

    Example:
        >>> preset = tanteo.sensor_preset("keyence_il300")
        >>> preset.name
        'keyence_il300'
    """
    return _look_up("sensor", name, sensor_presets())


def robot_preset(name: str) -> RobotPreset:
    """The errors of a robot, from the shipped table.

    Args:
        name: as :func:`robot_presets` lists it.

    Raises:
        InputError: No such preset; the message lists the nearest names.

    Example:
        >>> tanteo.robot_preset("calibrated_small").name
        'calibrated_small'
    """
    return _look_up("robot", name, robot_presets())


def _rows(file: str) -> list[dict[str, str]]:
    text = resources.files("tanteo.sensors").joinpath(file).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


def _values(cls: type[SensorPreset] | type[RobotPreset], row: Mapping[str, str]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for f in fields(cls):
        cell = row[_COLUMN.get(f.name, f.name)]
        if f.type == "str":
            out[f.name] = cell
        else:
            value = float(cell) if cell else math.nan
            out[f.name] = math.radians(value) if f.name in _DEGREES else value
    return out


def _look_up(what: str, name: str, table: Mapping[str, _P]) -> _P:
    if name not in table:
        hint = did_you_mean(name, table, 0.4)
        raise InputError(f"{what}: expected one of {', '.join(table)}, got '{name}'.{hint}")
    return table[name]
