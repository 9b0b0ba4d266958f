"""Define a rig: the range sensors of a hand with their poses; each beam runs along +z of its sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.errors import InputError, did_you_mean
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors
from tanteo.sensors.noise import square_axes
from tanteo.sensors.presets import SensorPreset, check_beam
from tanteo.values import Value, lock


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RigSensor(Value):
    """One range sensor on the hand.

    Attributes:
        name: name of the sensor, as in the ``sensor`` column of the readings.
        T_hand_sensor: pose of the sensor on the hand ``(4, 4)`` [m]; the beam leaves its origin along +z.
        preset: noise law, beam and range limits; None if ``sd`` and ``beam_half_angle`` are given.
        sd: standard deviation along the beam [m], which overrides the preset's law; NaN to use the preset.
        beam_half_angle: half angle of the beam's cone, or of the cone of equal section for a rectangle [rad].
        max_range: largest range [m]; NaN if unknown.
        bias_sd: standard deviation of the bias common to all readings of this sensor [m].
        cov_mount: covariance of the mounting, a body error at the sensor common to all its readings ``(6, 6)``.
        axis_cosine: cosine between beam and optical axis, for devices that report the distance along the axis
            (``range_kind`` perpendicular); 1 otherwise.
        sd_prop: standard deviation proportional to the range, in addition to ``sd``.
        bias: known offset of the ranges from a calibration [m], which is subtracted.
        scale: known scale error of the ranges, which is removed; the device reports ``1 + scale`` times the range.
        scale_sd: standard deviation of the remaining scale error; NaN to use the preset's.
        cov_scale: covariance between mounting error and scale error ``(6,)``, from a joint calibration.
        unit: name of the device with the beam, as a zone of a multi-zone sensor; beams of one unit share
            bias, scale and mounting. Empty for a separate device.
        T_hand_unit: pose of the device on the hand ``(4, 4)`` [m], at which its mounting error acts; NaN for that of
            the beam.
        grid: rows, columns, height and width [rad] of the zones of the device; None for another device.
        response: what the device reports of its cone, one of :data:`~tanteo.sensors.presets.RESPONSES`; empty to use
            the preset's.
        footprint: section of the beam, one of :data:`~tanteo.sensors.presets.FOOTPRINTS`; empty to use the preset's.
    """

    name: str
    T_hand_sensor: Transforms
    preset: SensorPreset | None
    sd: float
    beam_half_angle: float
    max_range: float
    bias_sd: float
    cov_mount: Covariances
    axis_cosine: float = 1.0
    sd_prop: float = 0.0
    bias: float = 0.0
    scale: float = 0.0
    scale_sd: float = math.nan
    cov_scale: FloatArray = field(default_factory=lambda: np.zeros(6))
    unit: str = ""
    T_hand_unit: Transforms = field(default_factory=lambda: np.full((4, 4), np.nan))
    response: str = ""
    grid: tuple[int, int, float, float] | None = None
    footprint: str = ""

    @property
    def device(self) -> str:
        """Name of the device with the beam."""
        return self.unit or self.name

    @property
    def half_axes(self) -> Vectors | None:
        """Half axes of the rectangle at distance one, in the sensor frame ``(2, 3)``; None for a circle.

        The zones of a grid fill its field of view. The rectangle of another beam is a square.
        """
        footprint = self.footprint or ("circle" if self.preset is None else self.preset.footprint)
        if footprint == "circle":
            return None
        if self.grid is None:
            return square_axes(self.beam_half_angle)
        axes = (self.T_hand_sensor[:3, :3].T @ self.T_hand_unit[:3, :3]).T  # of the device, in the sensor frame
        rows, columns, height, width = self.grid
        depth = axes[2, 2]  # cosine between beam and optical axis
        tangents = np.array([axes[0, 2], axes[1, 2]]) / depth
        halves = np.array([width / columns, height / rows]) / 2
        sides = (np.tan(np.arctan(tangents) + halves) - np.tan(np.arctan(tangents) - halves)) / 2
        across = axes[:2] - axes[:2, 2:] * [0.0, 0.0, 1.0]
        return np.asarray(depth * sides[:, None] * across)

    def __post_init__(self) -> None:
        check_beam(self.name, self.response, self.footprint)
        if np.isnan(self.T_hand_unit).all():
            object.__setattr__(self, "T_hand_unit", self.T_hand_sensor)
        for name, shape in (
            ("T_hand_sensor", (4, 4)),
            ("T_hand_unit", (4, 4)),
            ("cov_mount", (6, 6)),
            ("cov_scale", (6,)),
        ):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise InputError(f"{name} of sensor '{self.name}': expected finite numbers of shape {shape}.")
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if self.preset is None and not self.sd > 0:
            raise InputError(f"sd of sensor '{self.name}': expected a preset or a positive sd, got neither. Give one.")
        if not 0 < self.axis_cosine <= 1:
            raise InputError(
                f"axis of sensor '{self.name}': expected it within 90 degrees of the beam, got a cosine of "
                f"{self.axis_cosine:g}. Turn it around."
            )
        if not (math.isfinite(self.bias) and -1 < self.scale < math.inf and self.sd_prop >= 0):
            raise InputError(
                f"bias, scale and sd_prop of sensor '{self.name}': expected finite numbers, a scale above -1 and no "
                f"negative sd_prop, got {self.bias:g}, {self.scale:g} and {self.sd_prop:g}. Correct them."
            )
        if self.cov_scale.any() and not self.scale_sd > 0:
            raise InputError(f"cov_scale of sensor '{self.name}': expected scale_sd beside it, got none. Give both.")
        if self.sd_prop > 0 and not self.sd > 0:
            raise InputError(
                f"sd_prop of sensor '{self.name}': expected sd beside it, got none. Give both, or neither to use the "
                "preset's noise."
            )
        lock(self)


def _check_unit(sensor: RigSensor, first: RigSensor) -> None:
    """Check that all beams of a device have the same device pose and the same shared error figures."""
    same = all(
        np.array_equal(getattr(sensor, name), getattr(first, name), equal_nan=True)
        for name in ("T_hand_unit", "cov_mount", "cov_scale", "bias_sd", "scale_sd")
    )
    if not same:
        raise InputError(
            f"unit '{sensor.device}': expected one pose, mounting error, bias_sd and scale_sd of '{first.name}' and "
            f"'{sensor.name}', got two. They are one device: make them equal, or give them units of their own."
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Rig(Value):
    """Range sensors of one hand.

    Attributes:
        sensors: sensors with unique names.
        source: origin of the rig (a file name), for messages.
        notes: sentences about assumptions of the file's reader.
    """

    sensors: tuple[RigSensor, ...]
    source: str = "rig"
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names = [s.name for s in self.sensors]
        if not names or len(set(names)) < len(names):
            raise InputError(f"{self.source}: expected sensors with names of their own, got {names}.")
        for sensor in self.sensors:
            _check_unit(sensor, next(s for s in self.sensors if s.device == sensor.device))
        lock(self)

    def with_response(self, response: str) -> Rig:
        """Return the rig with another response of all sensors.

        Args:
            response: what the devices report of their cones, one of :data:`~tanteo.sensors.presets.RESPONSES`.

        Raises:
            InputError: the response is unknown.
        """
        return replace(self, sensors=tuple(replace(sensor, response=response) for sensor in self.sensors))

    def numbers(self, names: Sequence[str]) -> np.ndarray:
        """Return the index into ``sensors`` of every name; -1 for an empty name.

        Args:
            names: names of sensors.

        Raises:
            InputError: the rig does not have a sensor of that name.
        """
        known = {s.name: i for i, s in enumerate(self.sensors)} | {"": -1}
        for name in dict.fromkeys(names):
            if name not in known:
                suggestion = did_you_mean(name, known, 0.4)
                expected = ", ".join(s.name for s in self.sensors)
                raise InputError(
                    f"sensor of a reading: expected one of the rig's ({expected}), got '{name}'.{suggestion}"
                )
        return np.fromiter((known[n] for n in names), dtype=np.int64, count=len(names))
