"""Read rig files: the poses of range sensors on the hand (TOML, ``docs/formats.md``)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tanteo.errors import CovarianceError, InputError
from tanteo.frames import check_covariance
from tanteo.io.document import load_toml, made
from tanteo.io.rig_checks import check_beam, check_duplicates
from tanteo.io.schema import Covariance, Direction, Length, Number, Numbers, Place, Point, Quaternion, Table
from tanteo.lie import SE3, SO3
from tanteo.sensors import Rig, RigSensor, SensorPreset, sensor_preset
from tanteo.typing import Covariances, FloatArray, Rotations, Transforms

_MOST_ZONES = 4096
_SAME = {
    "sd": "sd", "sd_per_range": "sd_prop", "beam_half_angle": "beam_half_angle", "max": "max_range",
    "bias_sd": "bias_sd", "bias": "bias", "scale": "scale", "scale_sd": "scale_sd",
    "scale_covariance_m_rad": "cov_scale",
}  # fmt: skip
"""Field of :class:`RigSensor` for each table key."""


def _per_axis(sds: FloatArray) -> FloatArray | None:
    return np.array(np.broadcast_to(sds, 3)) if (sds >= 0).all() else None


_SDS = ((), (3,)), _per_axis, "one or three numbers of zero or more"
_FIELD = ((), (1,), (2,)), lambda f: f if ((f > 0) & (f < np.pi)).all() else None
_FIELD_WORDS = "field_deg = [height, width] below 180, or one number for both"


class SensorTable(Table, frozen=True, kw_only=True, eq=False):
    """Table of a sensor, or of all zones of a multi-zone sensor."""

    preset: Annotated[str, Meta(description="a name")] | None = None
    position: Point
    direction: Direction | None = None
    quaternion_wxyz: Quaternion | None = None
    unit: str | None = None
    unit_position: Point | None = None
    unit_quaternion_wxyz: Quaternion | None = None
    sd: Annotated[Length, Meta(gt=0)] | None = None
    sd_per_range: Annotated[Number, Meta(ge=0)] | None = None
    axis: Direction | None = None
    beam_half_angle: Annotated[float, Numbers("angle"), Meta(ge=0)] | None = None
    max: Annotated[Length, Meta(gt=0)] | None = None
    bias_sd: Annotated[Length, Meta(ge=0)] | None = None
    bias: Length | None = None
    scale: Annotated[Number, Meta(gt=-1)] | None = None
    scale_sd: Annotated[Number, Meta(ge=0)] | None = None
    mount_sd: Annotated[FloatArray, Numbers("length", *_SDS)] | None = None
    mount_turn_sd: Annotated[FloatArray, Numbers("angle", *_SDS)] | None = None
    zones: (
        Annotated[list[Annotated[int, Meta(ge=1)]], Meta(min_length=2, max_length=2, description="[rows, columns]")]
        | None
    ) = None
    field: Annotated[FloatArray, Numbers("angle", *_FIELD, _FIELD_WORDS)] | None = None
    mount_covariance_m_rad: Covariance | None = None
    scale_covariance_m_rad: Annotated[FloatArray, Numbers("plain", ((6,),), digits=17)] | None = None

    def sensors(self, name: str) -> tuple[RigSensor, ...]:
        """Return the sensor, or its zones named ``NAME.row.column``.

        Args:
            name: name of the table.
        """
        preset = self._preset()
        if preset is None and (self.sd is None or self.beam_half_angle is None):
            raise self.at.error("expected a preset, or sd_mm and beam_half_angle_deg, got neither. Add them.")
        R, T_hand_unit = self._rotation(), self._unit()
        given = {theirs: got for ours, theirs in _SAME.items() if (got := getattr(self, ours)) is not None}
        if self.axis is not None:
            # some devices report the distance along the optical axis
            given["axis_cosine"] = min(1.0, float(self.axis @ R[:, 2]))
        if T_hand_unit is not None:
            given |= {"unit": self.unit, "T_hand_unit": T_hand_unit}
        usual = {
            "sd": math.nan,
            "beam_half_angle": preset.beam_half_angle if preset else 0.0,
            "max_range": preset.max_range if preset else math.nan,
            "bias_sd": preset.bias_std if preset else 0.0,
        }
        own = {"name": name, "T_hand_sensor": SE3.from_parts(R, self.position), "cov_mount": self._mount()}
        sensor = made(RigSensor, {**usual, **given, **own, "preset": preset}, str(self.at))
        check_beam(sensor, str(self.at))
        return (sensor,) if self.zones is None and self.field is None else self._zones(sensor)

    def _preset(self) -> SensorPreset | None:
        preset = None if self.preset is None else sensor_preset(self.preset)
        if preset is not None and preset.is_contact:
            raise self.at.refused("preset", "a range sensor", "Use --sensor for it.", f"'{self.preset}', which touches")
        return preset

    def _rotation(self) -> Rotations:
        """Return the sensor's axes in the hand frame, from a quaternion or a beam direction with arbitrary roll."""
        if self.direction is not None and self.quaternion_wxyz is None:
            return SO3.frame_from_axis(self.direction, 2)
        if self.quaternion_wxyz is None or self.direction is not None:
            raise self.at.error("expected direction or quaternion_wxyz, got both or neither. Give one.")
        return SO3.from_quaternion(self.quaternion_wxyz)

    def _unit(self) -> Transforms | None:
        """Return the pose of the device that the beam belongs to; None for a separate device."""
        given = self.at.has("unit", "unit_position", "unit_quaternion_wxyz")
        if not given:
            return None
        if not self.unit or self.unit_position is None or self.unit_quaternion_wxyz is None:
            raise self.at.error(
                "expected unit (a name), unit_position_mm and unit_quaternion_wxyz together, got "
                f"{', '.join(given)}. Give all three, or none for a device of its own."
            )
        return SE3.from_parts(SO3.from_quaternion(self.unit_quaternion_wxyz), self.unit_position)

    def _mount(self) -> Covariances:
        """Return the covariance of the mounting pose, from standard deviations or from a calibration's full matrix."""
        if self.mount_covariance_m_rad is None:
            sds = [np.zeros(3) if sds is None else sds for sds in (self.mount_sd, self.mount_turn_sd)]
            return np.diag(np.concatenate(sds) ** 2)
        if self.at.has("mount_sd", "mount_turn_sd"):
            raise self.at.error("expected mount_covariance_m_rad or mount_sd and mount_turn_sd, got both. Keep one.")
        try:
            return check_covariance(f"{self.at}, mount_covariance_m_rad", self.mount_covariance_m_rad, 6)
        except CovarianceError as error:
            raise InputError(f"{error} Copy it as the calibration wrote it.") from None

    def _zones(self, device: RigSensor) -> tuple[RigSensor, ...]:
        """Return the beams of a multi-zone device, evenly spaced in angle.

        Rows along its y axis, columns along its x axis.

        All zones share the device's bias, scale and mounting. If the device reports the distance along its optical axis
        (``range_kind`` perpendicular), every zone does.
        """
        if self.zones is None or math.prod(self.zones) > _MOST_ZONES:
            raise self.at.refused("zones", "[rows, columns]", "Write zones = [8, 8].")
        if self.field is None:
            raise self.at.refused("field", _FIELD_WORDS, "Add it.")
        if self.axis is not None or self.unit is not None or self.quaternion_wxyz is None:
            raise self.at.error(
                "expected quaternion_wxyz beside zones (which way are the rows?), and neither axis nor unit, which "
                "zones imply. Correct the keys."
            )
        perpendicular = device.preset is not None and device.preset.range_kind == "perpendicular"
        (rows, columns), (height, width) = self.zones, np.broadcast_to(self.field, 2).tolist()
        out = []
        for r, c in np.ndindex(rows, columns):
            across = np.tan([width * ((c + 0.5) / columns - 0.5), height * ((r + 0.5) / rows - 0.5)])
            turned = SO3.frame_from_axis(np.append(across, 1.0), 2)
            zone: dict[str, Any] = {
                "name": f"{device.name}.{r + 1}.{c + 1}",
                "T_hand_sensor": device.T_hand_sensor @ SE3.from_parts(turned, np.zeros(3)),
                "axis_cosine": float(turned[2, 2]) if perpendicular else 1.0,
            }
            out.append(replace(device, **zone, unit=device.name, T_hand_unit=device.T_hand_sensor))
        return tuple(out)

    @classmethod
    def of(cls, sensor: RigSensor) -> SensorTable:
        """Return the table of a sensor.

        Args:
            sensor: sensor to write.
        """
        T, U, c = sensor.T_hand_sensor, sensor.T_hand_unit, sensor.axis_cosine
        values: dict[str, Any] = {
            ours: got for ours, theirs in _SAME.items() if not np.isnan(got := getattr(sensor, theirs)).any()
        }
        values |= {"mount_covariance_m_rad": sensor.cov_mount}
        needless = [
            name
            for name in ("bias", "scale", "scale_covariance_m_rad", "mount_covariance_m_rad")
            if not np.any(values[name])
        ]
        for name in [*needless, *(["sd_per_range"] if "sd" not in values else [])]:
            del values[name]
        if sensor.unit:
            values |= {"unit": sensor.unit, "unit_position": U[:3, 3]}
            values["unit_quaternion_wxyz"] = SO3.as_quaternion(U[:3, :3])
        if sensor.preset is not None:
            values["preset"] = sensor.preset.name
        if c < 1:
            # an optical axis at the right angle to the beam; on which side does not matter
            values["axis"] = c * T[:3, 2] + math.sqrt(1 - c * c) * T[:3, 0]
        pose: dict[str, Any] = {"position": T[:3, 3], "quaternion_wxyz": SO3.as_quaternion(T[:3, :3])}
        return cls(at=Place("rig"), **pose, **values)


class RigTable(Table, frozen=True, kw_only=True, eq=False):
    """Content of a rig file."""

    sensors: Annotated[
        Mapping[str, SensorTable], Meta(title="sensor", min_length=1, description="tables [sensors.NAME], one a sensor")
    ]


def read_rig(path: str | Path) -> Rig:
    """Read a rig file with one table ``[sensors.NAME]`` for each sensor.

    Args:
        path: file, or name of a rig shipped with tanteo (:func:`shipped_rigs`).

    Raises:
        InputError: the file cannot be read, is not TOML, or has an invalid key or value; the message names file,
            sensor, key and value.
        UnitError: a unit in a key is missing, unknown or contradictory.

    Example:
        >>> rig = tanteo.read_rig("readings/laser_rig.toml")
        >>> [sensor.name for sensor in rig.sensors]
        ['laser']
    """
    shipped, path = shipped_rigs().get(str(path)), Path(path)
    kinds = f"rig file or one of {', '.join(shipped_rigs())}"
    document = load_toml(path, kinds, RigTable, None if path.exists() else shipped)
    found = [sensor for name, table in document.sensors.items() for sensor in table.sensors(name)]
    rig = Rig(tuple(found), str(path))
    check_duplicates(rig, str(path))
    return rig


@cache
def shipped_rigs() -> Mapping[str, str]:
    """Return the rigs shipped with tanteo: file content by name."""
    folder = resources.files("tanteo.sensors")
    files = [f for f in folder.iterdir() if f.name.endswith(".toml")]
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in sorted(files, key=lambda f: f.name)}
