"""Assign readings to devices with their noise figures, and convert ranges to points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError, ReadingsError, did_you_mean
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors
from tanteo.sensors.columns import Column
from tanteo.sensors.presets import NoiseLaw, SensorPreset, sensor_presets
from tanteo.sensors.readings import Readings
from tanteo.sensors.rig import Rig, RigSensor

_UNITS, _BEYOND = {"mm": 1e-3, "m": 1e3}, 3.0
"""Factors for ranges given in a wrong unit, and the factor beyond the limits from which a wrong unit is suspected."""

_NEAR = 0.85
"""Similarity of two names above which one counts as a misspelling of the other."""


@dataclass(frozen=True, slots=True, eq=False)
class Device:
    """Error figures of one device: a sensor of the rig, a preset, or unknown (NaN and zero).

    Attributes:
        name: name of the sensor or preset; empty if unknown.
        preset: preset of the device; None if it has none.
        mount: sensor of the rig; None if the device is not on a rig.
    """

    name: str
    preset: SensorPreset | None
    mount: RigSensor | None

    @property
    def unit(self) -> str:
        """Name of the device with shared errors: this one, or the multi-zone sensor that contains it as a zone."""
        return self.mount.device if self.mount is not None else self.name

    @property
    def min_range(self) -> float:
        """Smallest range [m]; 0 if unknown."""
        return self.preset.min_range if self.preset is not None else 0.0

    @property
    def max_range(self) -> float:
        """Largest range [m]; NaN if unknown."""
        if self.mount is not None and not math.isnan(self.mount.max_range):
            return self.mount.max_range
        return self.preset.max_range if self.preset is not None and not self.preset.is_contact else math.nan

    @property
    def max_incidence(self) -> float:
        """Largest incidence with an echo [rad]; a right angle if unknown."""
        return self.preset.max_incidence if self.preset is not None else math.pi / 2

    @property
    def beam_half_angle(self) -> float:
        """Half angle of the beam [rad]; NaN if unknown."""
        if self.mount is not None:
            return self.mount.beam_half_angle
        return self.preset.beam_half_angle if self.preset is not None else math.nan

    @property
    def response(self) -> str:
        """What the device reports of its cone; empty if unknown."""
        if self.mount is not None and self.mount.response:
            return self.mount.response
        return self.preset.response if self.preset is not None else ""

    @property
    def half_axes(self) -> Vectors | None:
        """Half axes of a rectangular beam at distance one, in the sensor frame ``(2, 3)``; None for a circle."""
        return self.mount.half_axes if self.mount is not None else None

    @property
    def bias_sd(self) -> float:
        """Standard deviation of the bias common to all readings of the device [m]."""
        if self.mount is not None:
            return self.mount.bias_sd
        return self.preset.bias_std if self.preset is not None else 0.0

    @property
    def scale_sd(self) -> float:
        """Standard deviation of the scale error common to all readings of the device."""
        if self.mount is not None and not math.isnan(self.mount.scale_sd):
            return self.mount.scale_sd
        return self.preset.bias_prop_std if self.preset is not None else 0.0

    @property
    def cov_unit(self) -> Covariances:
        """Covariance ``(7, 7)`` of mounting (body error) and scale error, which are constant for the device."""
        cov = np.zeros((7, 7))
        cov[6, 6] = self.scale_sd**2
        if self.mount is not None:
            cov[:6, :6] = self.mount.cov_mount
            cov[:6, 6] = cov[6, :6] = self.mount.cov_scale
        return cov

    @property
    def law(self) -> NoiseLaw:
        """Noise law over the range; NaN if unknown."""
        if self.mount is not None and self.mount.sd > 0:
            return NoiseLaw.of(self.mount.sd, self.mount.sd_prop)
        return self.preset.law if self.preset is not None else NoiseLaw.of(math.nan)

    def along_beam(self, ranges: FloatArray) -> FloatArray:
        """Return ranges along the beam, corrected for the known bias and scale [m].

        Args:
            ranges: reported ranges ``(n,)`` [m].
        """
        if self.mount is None:
            return ranges
        return (ranges / self.mount.axis_cosine - self.mount.bias) / (1 + self.mount.scale)


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Readings as points, and free-space rays as origin, direction and length, in the world frame.

    Attributes:
        points: sensed points ``(n, 3)`` [m]; origin of the beam for a free-space ray.
        directions: unit directions of beams and approaches ``(n, 3)``.
        ranges: ranges along the beam ``(n,)`` [m].
        lengths: lengths of free-space rays ``(n,)`` [m].
        by_rig: mask of the readings whose position the rig determines ``(n,)``.
        T_world_units: poses of the rig's devices at these readings ``(n, 4, 4)`` [m].
        half_axes: half axes of rectangular beams at distance one ``(n, 2, 3)``; NaN for circles.
    """

    points: Vectors
    directions: Column
    ranges: Column
    lengths: Column
    by_rig: BoolArray
    T_world_units: Column
    half_axes: Column


def find_devices(
    readings: Readings, sensor: SensorPreset | None, rig: Rig | None
) -> tuple[tuple[Device, ...], IntArray]:
    """Return the devices of the readings, and the index of the device of each reading.

    The ``sensor`` column names a sensor of the rig; without a rig it may name a preset. Rows without a name use
    ``sensor``.

    Args:
        readings: readings to assign.
        sensor: preset of rows without a name; None if unknown.
        rig: rig of the sensors; None if there is none.

    Raises:
        InputError: a row names a sensor that the rig does not have.
    """
    default = Device(sensor.name if sensor else "", sensor, None)
    if rig is not None:
        mounted = tuple(Device(s.name, s.preset, s) for s in rig.sensors)
        numbers = rig.numbers(readings.sensors)
        return (*mounted, default), np.where(numbers < 0, len(mounted), numbers)
    names = list(dict.fromkeys(n for n in readings.sensors if n))
    named = tuple(Device(n, sensor_presets().get(n, sensor), None) for n in names)
    known = {n: i for i, n in enumerate(names)} | {"": len(named)}
    numbers = np.fromiter((known[n] for n in readings.sensors), dtype=np.int64, count=len(readings))
    return (*named, default), numbers


def misspelt(readings: Readings) -> str:
    """Return a sentence on a sensor name that is probably a misspelt preset; empty if there is none.

    Args:
        readings: readings without a rig.
    """
    known = sensor_presets()
    for name in dict.fromkeys(readings.sensors):
        suggestion = "" if name in known else did_you_mean(name, known, _NEAR)
        if suggestion:
            unknown = f"column sensor: '{name}' is no known sensor (tanteo sensor list)"
            return f"{unknown}, so no noise figures are assumed for it.{suggestion}"
    return ""


def place(readings: Readings, devices: Sequence[Device], numbers: IntArray) -> Placed:
    """Return start, direction and end of every beam in the world.

    Args:
        readings: readings to place.
        devices: devices of the readings, see :func:`find_devices`.
        numbers: device index of each reading ``(n,)``.

    Raises:
        InputError: a row has only a range and no rig states the pose of its sensor.
        ReadingsError: a range is outside the limits of its device.
    """
    mounted = np.array([d.mount is not None for d in devices])[numbers]
    has_point = readings.points.given
    by_rig = ~has_point & mounted & readings.Ts_world_hand.given
    lost = np.flatnonzero(~has_point & ~by_rig)
    if len(lost) and readings.true_distances.given[lost[0]]:
        raise InputError(
            f"reading '{readings.ids[lost[0]]}': expected where the hand was, got a known distance, which only "
            "calibrates the sensor (tanteo sensor fit). Add the hand_ columns."
        )
    if len(lost):
        raise InputError(
            f"rig: expected it to say where sensor '{readings.sensors[lost[0]]}' of reading "
            f"'{readings.ids[lost[0]]}' sits on the hand, got no rig. Give one (--rig rig.toml), or points."
        )
    reported = readings.ranges
    ranges = np.array(reported.values)
    for k, device in enumerate(devices):
        rows = (by_rig & (numbers == k))[reported.given]
        ranges[rows] = device.along_beam(ranges[rows])
    along = Column(reported.given, ranges)
    _check_ranges(readings, devices, numbers)
    farthest = np.array([d.max_range for d in devices])[numbers]
    lengths = readings.max_ranges.coalesce(Column.from_rows(farthest)).only(readings.is_free)
    short = np.flatnonzero(readings.is_free & ~lengths.given)
    if len(short):
        raise InputError(
            f"max of free reading '{readings.ids[short[0]]}': expected how far the beam reached, got nothing. "
            "Add the column max_mm, or a preset to the rig."
        )
    points = readings.points.filled(0.0)
    directions = readings.directions
    units, half_axes = Column.empty(len(readings), (4, 4)), Column.empty(len(readings), (2, 3))
    if by_rig.any():
        T_hand_sensors = np.stack([d.mount.T_hand_sensor if d.mount else np.eye(4) for d in devices])
        T_hand_units = np.stack([d.mount.T_hand_unit if d.mount else np.eye(4) for d in devices])
        hands = readings.Ts_world_hand[by_rig]
        Ts = hands @ T_hand_sensors[numbers[by_rig]]
        units = Column(by_rig, hands @ T_hand_units[numbers[by_rig]])
        rectangles = np.stack([np.full((2, 3), np.nan) if d.half_axes is None else d.half_axes for d in devices])
        halves = rectangles[numbers[by_rig]] @ np.swapaxes(Ts[:, :3, :3], 1, 2)
        half_axes = Column(by_rig, halves)
        axes = Ts[:, :3, 2]
        directions = Column(by_rig, axes).coalesce(directions)
        reach = along.only(~readings.is_free).filled(0.0)[by_rig, None]
        points[by_rig] = Ts[:, :3, 3] + reach * axes
    return Placed(points, directions, along, lengths, by_rig, units, half_axes)


def _advice(got: float, nearest: float, farthest: float) -> str:
    """Return advice for a range outside the limits of its device."""
    unit = next((u for u, factor in _UNITS.items() if nearest <= got * factor <= farthest), "")
    if unit and (got > _BEYOND * farthest or got < nearest / _BEYOND):
        return f"It would be in range in {unit}: correct the unit in the column's name, or the value"
    if got < nearest:
        return "Remove the row; in a session, call refuse() instead"
    return "Drop the row, or give it status none"


def _check_ranges(readings: Readings, devices: Sequence[Device], numbers: IntArray) -> None:
    nearest = np.array([d.min_range for d in devices])[numbers]
    farthest = np.array([d.max_range for d in devices])[numbers]
    rows = np.flatnonzero(readings.ranges.given & ~readings.is_free)
    ranges = readings.ranges[rows]
    bad = rows[(ranges < nearest[rows]) | (ranges > farthest[rows])]
    if len(bad):
        i = bad[0]
        what = _advice(float(readings.ranges[i]), float(nearest[i]), float(farthest[i]))
        raise ReadingsError(
            f"range of reading '{readings.ids[i]}': expected {nearest[i]:g} to {farthest[i]:g} m from "
            f"'{devices[numbers[i]].name}', got {readings.ranges[i]:g} m. {what}."
        )
