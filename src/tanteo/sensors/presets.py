"""Define presets of sensors and robots: typical error figures with their sources, and noise laws.

The ``check`` text of a preset uses the letters V for verified in the source, C for computed from it, M for from memory,
and A for assumed. A calibration of your own device is always better than a preset.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Any, Literal, TypeVar

import numpy as np

from tanteo.errors import InputError, check_kind, did_you_mean
from tanteo.geometry.typing import FloatArray

_LARGEST_EXPONENT = 20.0
"""Largest exponent of the exponential law, which prevents overflow far beyond any device's range."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseLaw:
    """Standard deviation of a range along the beam over the range, for one sensor or for arrays of sensors.

    The constant, proportional and quadratic parts are independent and add in quadrature. With an exponential law the
    constant part is ``const (1 + exp(k (d - d0)))``: nearly constant up to ``d0``, then growing fast (Crazyflie
    firmware, ``zranger.c``).

    Attributes:
        const: constant standard deviation [m].
        prop: standard deviation proportional to the range.
        quad: standard deviation proportional to the squared range [1/m].
        exp_d0: range at which the exponential law doubles the constant part [m].
        exp_k: rate of the exponential law [1/m]; 0 for none.

    Raises:
        InputError: a part is negative.
    """

    const: FloatArray
    prop: FloatArray
    quad: FloatArray
    exp_d0: FloatArray
    exp_k: FloatArray
    _explodes: bool = field(init=False, repr=False)
    _grows: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("const", "prop", "quad", "exp_k"):  # NaN where the device does not state it
            value = getattr(self, name)
            if np.any(value < 0):
                raise InputError(f"noise law, {name}: expected 0 or more, got {np.nanmin(value):g}. Correct it.")
        # simulators evaluate the law a thousand times a second, so these tests are made once
        object.__setattr__(self, "_explodes", bool(np.any(self.exp_k > 0)))
        object.__setattr__(self, "_grows", bool(np.any(self.prop > 0) or np.any(self.quad > 0)))

    @classmethod
    def of(
        cls, const: float, prop: float = 0.0, quad: float = 0.0, exp_d0: float = 0.0, exp_k: float = 0.0
    ) -> NoiseLaw:
        """Return the law of one device.

        Args:
            const: constant standard deviation [m].
            prop: standard deviation proportional to the range.
            quad: standard deviation proportional to the squared range [1/m].
            exp_d0: range at which the exponential law doubles the constant part [m].
            exp_k: rate of the exponential law [1/m]; 0 for none.
        """
        return cls(*(np.asarray(x, dtype=np.float64) for x in (const, prop, quad, exp_d0, exp_k)))

    @classmethod
    def stack(cls, laws: Sequence[NoiseLaw]) -> NoiseLaw:
        """Return one law with arrays over the devices on the last axis.

        Args:
            laws: laws of the devices.
        """
        names = ("const", "prop", "quad", "exp_d0", "exp_k")
        return cls(*(np.stack([getattr(law, name) for law in laws], axis=-1) for name in names))

    @property
    def depends_on_range(self) -> bool:
        """Whether the noise depends on the range, so that the range must be known."""
        return self._explodes or self._grows

    def sigma(self, d: FloatArray | float) -> FloatArray:
        """Return the standard deviation [m] at a range; a constant law accepts NaN.

        Args:
            d: range [m].
        """
        d = np.asarray(d, dtype=np.float64)
        if not (self._explodes or self._grows):
            return np.array(np.broadcast_to(self.const, np.broadcast_shapes(d.shape, self.const.shape)))
        variance = self.const**2
        if self._explodes:
            growth = np.exp(np.minimum(self.exp_k * (d - self.exp_d0), _LARGEST_EXPONENT))
            variance = np.where(self.exp_k > 0, self.const * (1 + growth), self.const) ** 2
        if self._grows:
            variance = variance + d * d * (self.prop**2 + (self.quad * d) ** 2)
        return np.sqrt(variance)


RESPONSES = ("ray", "nearest", "mean", "strongest")
"""What a device with a cone reports: the range along one random ray, to the nearest surface, the mean over the rays of
the cone, or the mean over the surface that returns most."""


FOOTPRINTS = ("circle", "rectangle")
"""A beam has a circle as its section, or a rectangle along x and y of the sensor, as zones of detector arrays have."""


def check_beam(name: str, response: str, footprint: str) -> None:
    """Check the response and the section of a beam; empty ones are allowed, for those that are not known.

    Args:
        name: name of the device in the message.
        response: response to check.
        footprint: section to check.

    Raises:
        InputError: the response is none of :data:`RESPONSES`, or the section none of :data:`FOOTPRINTS`.
    """
    for what, value, allowed, advice in (
        ("response", response, RESPONSES, "if the data sheet does not state it"),
        ("footprint", footprint, FOOTPRINTS, "for a circle"),
    ):
        if value and value not in allowed:
            raise InputError(
                f"{what} of '{name}': expected one of {', '.join(allowed)}, got '{value}'. Leave it out {advice}."
            )


@dataclass(frozen=True, slots=True)
class SensorPreset:
    """Error figures of one kind of sensor; NaN where a figure does not apply.

    Attributes:
        name: name of the preset.
        kind: measuring principle: ``tof``, ``laser_triangulation``, ``touch``, ...
        min_range: smallest range [m].
        max_range: largest range [m]; 0 for a touch probe.
        beam_half_angle: half angle of the beam's cone, or of the cone of equal section for a rectangle [rad].
        sigma_const: constant standard deviation of a range [m].
        sigma_prop: standard deviation proportional to the range.
        sigma_quad: standard deviation proportional to the squared range [1/m].
        exp_d0: range at which the exponential law doubles ``sigma_const`` [m].
        exp_k: rate of the exponential law [1/m].
        bias_std: standard deviation of the bias common to all readings of one device [m].
        bias_prop_std: standard deviation of the common scale error.
        max_incidence: largest incidence for which the figures hold [rad].
        rate_hz: readings per second.
        range_kind: ``radial`` along the beam, ``perpendicular`` along the optical axis, or ``contact``.
        response: what the device reports of its cone, one of :data:`RESPONSES`; empty if unknown.
        footprint: section of the beam, one of :data:`FOOTPRINTS`.
        check: verified and assumed figures, see the module.
        source: source of the figures.
        outlier_rate: probability that a reading is not on the part; NaN for that of :class:`tanteo.Priors`. Assumed:
            0.001 for a trigger probe, 0.02 for time of flight, which mixes surfaces at edges.

    Example:
        >>> from tanteo.sensors.presets import SensorPreset
        >>> mine = SensorPreset("my_sonar", beam_half_angle=0.26, sigma_const=2e-3, max_range=2.0, response="nearest")
        >>> mine.range_kind
        'radial'
    """

    name: str
    kind: str = "tof"
    min_range: float = 0.0
    max_range: float = math.inf
    beam_half_angle: float = 0.0
    sigma_const: float = 1e-3
    sigma_prop: float = 0.0
    sigma_quad: float = 0.0
    exp_d0: float = math.nan
    exp_k: float = math.nan
    bias_std: float = 0.0
    bias_prop_std: float = 0.0
    max_incidence: float = math.pi / 2
    rate_hz: float = math.nan
    range_kind: str = "radial"
    response: str = ""
    footprint: str = "circle"
    check: str = "A: all"
    source: str = ""
    outlier_rate: float = math.nan

    def __post_init__(self) -> None:
        check_beam(self.name, self.response, self.footprint)

    @property
    def is_contact(self) -> bool:
        """Whether the sensor is a touch probe, without range and beam."""
        return self.range_kind == "contact"

    @property
    def law(self) -> NoiseLaw:
        """Noise law over the range."""
        exponential = (self.exp_d0, self.exp_k) if self.exp_k > 0 else (0.0, 0.0)
        return NoiseLaw.of(self.sigma_const, self.sigma_prop, self.sigma_quad, *exponential)


@dataclass(frozen=True, slots=True)
class RobotPreset:
    """Errors of a robot's hand pose: ``repeat`` differs for each reading, ``abs`` is common to the run.

    Attributes:
        name: name of the preset.
        pos_repeat_std: standard deviation of the position's repeatability per axis [m].
        pos_abs_std: standard deviation of the absolute position error per axis [m].
        rot_repeat_std: standard deviation of the orientation's repeatability per axis [rad].
        rot_abs_std: standard deviation of the absolute orientation error per axis [rad].
        check: verified and assumed figures, see the module.
        source: source of the figures.
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
    """Return all sensor presets by name."""
    return _table(SensorPreset, "sensor_presets.csv")


@cache
def robot_presets() -> Mapping[str, RobotPreset]:
    """Return all robot presets by name."""
    return _table(RobotPreset, "robot_error_presets.csv")


def sensor_preset(name: str) -> SensorPreset:
    """Return the error figures of a sensor from the shipped table.

    Args:
        name: name of the preset, see ``tanteo sensor list``.

    Raises:
        InputError: there is no such preset; the message lists the nearest names.

    Example:
        >>> preset = tanteo.sensors.presets.sensor_preset("keyence_il300")
        >>> preset.name
        'keyence_il300'
    """
    return _preset_named("sensor", name, sensor_presets())


def sensor_outlier_rate(sensor: SensorPreset | str | None) -> float | None:
    """Return the outlier rate of a sensor; None without a sensor, or if its preset states none.

    Args:
        sensor: preset or its name.

    Raises:
        InputError: ``sensor`` is neither, or no preset has this name.

    Example:
        >>> tanteo.sensors.presets.sensor_outlier_rate("touch_trigger_cnc")
        0.001
    """
    if sensor is None:
        return None
    check_kind("sensor", sensor, (SensorPreset, str), "Name one of tanteo.sensors.presets.sensor_presets().")
    rate = (sensor_preset(sensor) if isinstance(sensor, str) else sensor).outlier_rate
    return None if math.isnan(rate) else rate


def robot_preset(name: str) -> RobotPreset:
    """Return the error figures of a robot from the shipped table.

    Args:
        name: name of the preset, see :func:`robot_presets`.

    Raises:
        InputError: there is no such preset; the message lists the nearest names.

    Example:
        >>> tanteo.sensors.presets.robot_preset("calibrated_small").name
        'calibrated_small'
    """
    return _preset_named("robot", name, robot_presets())


def _table(cls: type[_P], file: str) -> Mapping[str, _P]:
    text = resources.files("tanteo.sensors").joinpath(file).read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return MappingProxyType({row["name"]: cls(**_values(cls, row)) for row in rows})


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


def _preset_named(what: str, name: str, table: Mapping[str, _P]) -> _P:
    if name not in table:
        suggestion = did_you_mean(name, table, 0.4)
        raise InputError(f"{what}: expected one of {', '.join(table)}, got '{name}'.{suggestion}")
    return table[name]


Meaning = Literal["none", "near", "error"]
"""Meaning of a range that is no distance: nothing in range, the surface is too near, the measurement failed."""

MEANINGS: Mapping[str, str] = MappingProxyType(
    {"none": "nothing in range", "near": "too near", "error": "no valid measurement"}
)
"""Text of each meaning."""


@cache
def codes_of(preset: str) -> Mapping[float, Meaning]:
    """Return the values of a preset that are no distances [mm], with their meaning; empty for an unknown preset.

    The table ``sensor_codes.csv`` states them as the device or its usual driver writes them, with the source of each.

    Args:
        preset: name of the preset.

    Example:
        >>> tanteo.sensors.presets.codes_of("vl53l0x")[8190.0]
        'none'
    """
    return MappingProxyType({value: meaning for names, value, meaning in _code_rows() if preset in names})


@cache
def known_codes() -> Mapping[float, tuple[str, ...]]:
    """Return all special values [mm] with the presets that write them."""
    out: dict[float, tuple[str, ...]] = {}
    for names, value, _ in _code_rows():
        out[value] = (*out.get(value, ()), *names)
    return MappingProxyType(out)


@cache
def _code_rows() -> tuple[tuple[tuple[str, ...], float, Meaning], ...]:
    text = resources.files("tanteo.sensors").joinpath("sensor_codes.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return tuple((tuple(row["presets"].split()), float(row["value_mm"]), row["meaning"]) for row in rows)  # type: ignore[misc]
