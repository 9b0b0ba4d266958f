"""A rig: which range sensors sit where on the hand. Metres, radians; the beam runs along +z of each sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError, did_you_mean
from tanteo.sensors.presets import SensorPreset
from tanteo.typing import Covariances, FloatArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class RigSensor:
    """One range sensor on the hand.

    Attributes:
        name: As in the ``sensor`` column of the readings.
        T_hand_sensor: Its pose on the hand, ``(4, 4)``; the beam leaves its origin along +z.
        preset: Noise law, beam and range limits; None when ``sd`` and ``beam_half_angle`` say it.
        sd: One standard deviation along the beam [m]; overrides the preset's law. NaN for "use the preset".
        sd_prop: Part of the noise proportional to the range, beside ``sd``.
        beam_half_angle: Half angle of the beam's cone [rad].
        max_range: Farthest range [m]; NaN for unknown.
        bias_sd: Standard deviation of the error common to all readings of this sensor [m].
        cov_mount: Of the mounting: body error at the sensor, ``(6, 6)``, common to all its readings.
        axis_cosine: Cosine of the angle between beam and optical axis, for devices that report the distance along
            the axis instead of along the beam (``range_kind`` perpendicular); 1 otherwise.
        bias: Known offset of its ranges [m], from a calibration: what it reads too far. It is taken off.
        scale: Known scale error of its ranges: it reads ``1 + scale`` times the range. It is taken off.
        scale_sd: Standard deviation of the scale error that is left; NaN for the preset's.
        unit: The device that it is one beam of, as a zone of a multi-zone sensor: beams of one unit share bias, scale
            and mounting; ``''`` for a device of its own.
        T_hand_unit: Pose of the device, at which its mounting error is stated; that of the beam if not given.
        cov_scale: Covariance ``(6,)`` between mounting error and scale error, as a calibration finds them together.
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

    @property
    def device(self) -> str:
        """Name of the device that it is or belongs to."""
        return self.unit or self.name

    def __post_init__(self) -> None:
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


def _check_unit(sensor: RigSensor, first: RigSensor) -> None:
    """Beams of one device have one pose and one set of errors that stay."""
    same = all(
        np.array_equal(getattr(sensor, name), getattr(first, name), equal_nan=True)
        for name in ("T_hand_unit", "cov_mount", "cov_scale", "bias_sd", "scale_sd")
    )
    if not same:
        raise InputError(
            f"unit '{sensor.device}': expected one pose, mounting error, bias_sd and scale_sd of '{first.name}' and "
            f"'{sensor.name}', got two. They are one device: make them equal, or give them units of their own."
        )


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """The range sensors of one hand, by name."""

    sensors: tuple[RigSensor, ...]
    source: str = "rig"

    def __post_init__(self) -> None:
        names = [s.name for s in self.sensors]
        if not names or len(set(names)) < len(names):
            raise InputError(f"{self.source}: expected sensors with names of their own, got {names}.")
        for sensor in self.sensors:
            _check_unit(sensor, next(s for s in self.sensors if s.device == sensor.device))

    def numbers(self, names: Sequence[str]) -> np.ndarray:
        """Index into ``sensors`` for every name; -1 for ``''``.

        Raises:
            InputError: A name that the rig does not have.
        """
        known = {s.name: i for i, s in enumerate(self.sensors)} | {"": -1}
        for name in dict.fromkeys(names):
            if name not in known:
                hint = did_you_mean(name, known, 0.4)
                expected = ", ".join(s.name for s in self.sensors)
                raise InputError(f"sensor of a reading: expected one of the rig's ({expected}), got '{name}'.{hint}")
        return np.fromiter((known[n] for n in names), dtype=np.int64, count=len(names))
