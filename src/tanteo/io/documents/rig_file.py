"""Read, check and write rig files: the poses of range sensors on the hand (TOML, ``docs/formats_scenes.md``)."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, structs

from tanteo.errors import CovarianceError, InputError, UnitError
from tanteo.geometry import SE3, SO3, check_covariance
from tanteo.geometry.typing import Covariances, FloatArray, Rotations, Transforms
from tanteo.io.documents.document import load_toml, made
from tanteo.io.documents.mount_files import is_mount, read_mount
from tanteo.io.documents.schema import (
    Covariance,
    Direction,
    Length,
    Number,
    Numbers,
    Place,
    Point,
    Quaternion,
    Table,
    toml_lines,
)
from tanteo.replaced import replaced
from tanteo.sensors import Rig, RigSensor
from tanteo.sensors.noise import equal_cone, square_axes
from tanteo.sensors.presets import SensorPreset, sensor_preset

_FARTHEST = 2.0
"""Largest accepted distance of a sensor from the hand's origin [m]; larger values indicate a wrong unit."""

_NEAREST = 0.5e-3
"""Distance from the hand's origin [m] below which a sensor's position may have been written in metres."""

_WIDEST = np.pi / 3
"""Largest accepted half angle of a beam [rad]; larger values indicate a wrong unit."""

_INTO = 0.5
"""Fraction of the sensor's distance from the hand's origin within which a beam counts as running into the hand."""

_SMALL_HAND = 0.03
"""Distance of a sensor from the hand's origin [m] up to which its beam may pass it, as of a sensor at the flange."""

_EQUAL_POSE = 1e-6
"""Difference below which two sensors have the same position [m] and direction."""


def check_beam(sensor: RigSensor, place: str) -> None:
    """Check that a beam starts near the hand and does not run into it.

    Args:
        sensor: sensor to check.
        place: file and sensor for messages.

    Raises:
        UnitError: the distance or the beam's width indicates a wrong unit.
        InputError: the beam passes through the middle of the hand.
    """
    origin = sensor.T_hand_sensor[:3, 3]
    beam = sensor.T_hand_sensor[:3, 2]
    away = float(np.linalg.norm(origin))
    if away > _FARTHEST:
        raise UnitError(
            f"{place}, position: expected within {_FARTHEST:g} m of the hand's origin, got {away:g} m. Check the unit "
            "in the key."
        )
    if sensor.beam_half_angle > _WIDEST:
        got = np.degrees(sensor.beam_half_angle)
        raise UnitError(
            f"{place}, beam_half_angle: expected 60 degrees or less, got {got:g}. Check the unit in the key."
        )
    ahead = max(-float(origin @ beam), 0.0)
    nearest = float(np.linalg.norm(origin + ahead * beam))
    if away > _SMALL_HAND and nearest < _INTO * away and ahead < _reach(sensor):
        raise InputError(
            f"{place}, direction: expected the beam to lead away from the hand, got one that passes its origin within "
            f"{1e3 * nearest:.3g} mm. Turn it around, or move the hand's origin out of its way."
        )


def suspect_metres(rig: Rig) -> str:
    """Return a question if a sensor is so close to the hand's origin that its unit is doubtful; otherwise empty.

    Args:
        rig: rig to check.
    """
    for sensor in rig.sensors:
        away = float(np.linalg.norm(sensor.T_hand_sensor[:3, 3]))
        if 0 < away < _NEAREST:
            return (
                f"{rig.source}, sensors.{sensor.name}: it sits {1e3 * away:.2g} mm from the origin of the hand's "
                "frame. Is its position in metres? Then call it position_m."
            )
    return ""


def _reach(sensor: RigSensor) -> float:
    """Return the largest range of a sensor [m]; infinite if unknown."""
    return float(np.nan_to_num(sensor.max_range, nan=np.inf))


def check_duplicates(rig: Rig, place: str) -> None:
    """Check that no two sensors have the same beam.

    Args:
        rig: rig to check.
        place: file name for messages.

    Raises:
        InputError: two sensors have the same beam; the message names them.
    """
    for i, one in enumerate(rig.sensors):
        for other in rig.sensors[:i]:
            difference = one.T_hand_sensor[:3, 2:] - other.T_hand_sensor[:3, 2:]
            if np.abs(difference).max() < _EQUAL_POSE:
                raise InputError(
                    f"{place}: expected every sensor at a place or with a direction of its own, got '{other.name}' and "
                    f"'{one.name}' with the same. Correct one."
                )


_MOST_ZONES = 4096
_SENSOR_FIELDS = {
    "sd": "sd", "sd_per_range": "sd_prop", "beam_half_angle": "beam_half_angle", "max": "max_range",
    "bias_sd": "bias_sd", "bias": "bias", "scale": "scale", "scale_sd": "scale_sd",
    "scale_covariance_m_rad": "cov_scale", "footprint": "footprint",
}  # fmt: skip
"""Field of :class:`RigSensor` for each table key."""


def _per_axis(sds: FloatArray) -> FloatArray | None:
    return np.array(np.broadcast_to(sds, 3)) if (sds >= 0).all() else None


_SDS = ((), (3,)), _per_axis, "one or three numbers of zero or more"
_FIELD = ((), (1,), (2,)), lambda f: f if ((f > 0) & (f < np.pi)).all() else None
_FIELD_WORDS = "field_deg = [height, width] below 180, or one number for both"


def _looking(across: FloatArray) -> Rotations:
    """Return the axes of the zone at a place ``(2,)`` at distance one, its x along the columns as far as possible."""
    z = np.append(across, 1.0) / np.sqrt(1 + across @ across)
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


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
    response: str | None = None
    footprint: str | None = None
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
    zone_bias: Annotated[FloatArray, Numbers("length", ())] | None = None
    mount_covariance_m_rad: Covariance | None = None
    scale_covariance_m_rad: Annotated[FloatArray, Numbers("plain", ((6,),), digits=17)] | None = None

    def sensors(self, name: str) -> tuple[RigSensor, ...]:
        """Return the sensor, or its zones named ``NAME.row.column``.

        Args:
            name: name of the table.

        Raises:
            InputError: a required key is missing, or a value is invalid.
        """
        preset = self._preset()
        filled = self.field is not None  # zones fill the field of view
        if preset is None and (self.sd is None or (self.beam_half_angle is None and not filled)):
            raise self.at.error("expected a preset, or sd_mm and beam_half_angle_deg, got neither. Add them.")
        R = self._rotation()
        T_hand_unit = self._unit()
        given = {theirs: got for ours, theirs in _SENSOR_FIELDS.items() if (got := getattr(self, ours)) is not None}
        if self.response is not None:
            given["response"] = self.response
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
        """Return the pose of the device that the beam is part of; None for a separate device."""
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
        if self.zone_bias is not None and (self.zones is None or self.zone_bias.shape != (math.prod(self.zones),)):
            raise self.at.refused("zone_bias", "one number a zone, row by row", "Write as many as zones.")
        if self.zones is None or math.prod(self.zones) > _MOST_ZONES:
            raise self.at.refused("zones", "[rows, columns]", "Write zones = [8, 8].")
        if self.field is None:
            raise self.at.refused("field", _FIELD_WORDS, "Add it.")
        if self.axis is not None or self.unit is not None or self.quaternion_wxyz is None:
            raise self.at.error(
                "expected quaternion_wxyz beside zones, and neither direction, axis nor unit, which zones imply. Write "
                "quaternion_wxyz = [1, 0, 0, 0] if the hand's z is the optical axis, its x the direction of the "
                "columns, and its y that of the rows."
            )
        perpendicular = device.preset is not None and device.preset.range_kind == "perpendicular"
        (rows, columns), (height, width) = self.zones, np.broadcast_to(self.field, 2).tolist()
        out = []
        grid = (rows, columns, height, width)
        footprint = self.footprint or ("rectangle" if self.beam_half_angle is None else "circle")
        if footprint == "rectangle" and self.beam_half_angle is not None:
            raise self.at.refused(
                "beam_half_angle", "none beside zones that are rectangles", "Zones fill field_deg; remove one of both."
            )
        biases = np.zeros(rows * columns) if self.zone_bias is None else self.zone_bias
        for (r, c), bias in zip(np.ndindex(rows, columns), biases.tolist(), strict=True):
            across = np.tan([width * ((c + 0.5) / columns - 0.5), height * ((r + 0.5) / rows - 0.5)])
            turned = _looking(across)
            zone: dict[str, Any] = {
                "name": f"{device.name}.{r + 1}.{c + 1}",
                "T_hand_sensor": device.T_hand_sensor @ SE3.from_parts(turned, np.zeros(3)),
                "axis_cosine": float(turned[2, 2]) if perpendicular else 1.0,
                "bias": device.bias + bias,
            }
            one = replace(
                device, **zone, unit=device.name, T_hand_unit=device.T_hand_sensor, grid=grid, footprint=footprint
            )
            if one.half_axes is not None:
                one = replace(one, beam_half_angle=equal_cone(one.half_axes))
            out.append(one)
        return tuple(out)

    @classmethod
    def of_zones(cls, zones: Sequence[RigSensor]) -> SensorTable:
        """Return the table of a multi-zone device.

        Args:
            zones: all its zones, row by row.
        """
        first = zones[0]
        assert first.grid is not None
        rows, columns, height, width = first.grid
        biases = np.array([zone.bias for zone in zones])
        bias = round(float(biases.mean()), 8)  # digits that a second writing finds again
        device = replace(first, T_hand_sensor=first.T_hand_unit, unit="", axis_cosine=1.0, bias=bias)
        uneven = bool(np.ptp(biases) > 0)
        table = structs.replace(
            cls.of(device), zones=[rows, columns], field=np.array([height, width]),
            zone_bias=biases - bias if uneven else None, footprint=None,
        )  # fmt: skip
        return table if first.half_axes is None else structs.replace(table, beam_half_angle=None)

    @classmethod
    def of(cls, sensor: RigSensor) -> SensorTable:
        """Return the table of a sensor.

        Args:
            sensor: sensor to write.
        """
        T = sensor.T_hand_sensor
        U = sensor.T_hand_unit
        c = sensor.axis_cosine
        values: dict[str, Any] = {
            ours: got
            for ours, theirs in _SENSOR_FIELDS.items()
            if theirs != "footprint" and not np.isnan(got := getattr(sensor, theirs)).any()
        }
        if sensor.footprint:
            values["footprint"] = sensor.footprint
        values |= {"mount_covariance_m_rad": sensor.cov_mount}
        needless = [
            name
            for name in ("bias", "scale", "scale_covariance_m_rad", "mount_covariance_m_rad")
            if not np.any(values[name])
        ]
        for name in [*needless, *(["sd_per_range"] if "sd" not in values else [])]:
            del values[name]
        if sensor.response:
            values["response"] = sensor.response
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


def read_rig(path: str | Path, *, sensor: str | None = None, sd: float | None = None) -> Rig:
    """Read a rig: a file with a table ``[sensors.NAME]`` for each sensor, or poses from files of ROS and calibrations.

    URDF, xacro, hand-eye results, static transforms and camera chains of Kalibr are named as ``robot.urdf#link``, with
    the sensor's name as ``tof=robot.urdf#tof_link``, several with commas (:mod:`tanteo.io.documents.mount_files`).

    Args:
        path: file, or name of a rig shipped with tanteo (:func:`shipped_rigs`).
        sensor: preset of sensors whose file states a pose only.
        sd: standard deviation along the beam of sensors whose file states a pose only [m].

    Raises:
        InputError: the file cannot be read, is not TOML, or has an invalid key or value; the message names file,
            sensor, key and value.
        UnitError: a unit in a key is missing, unknown or contradictory.

    Example:
        >>> rig = tanteo.read_rig("readings/laser_rig.toml")
        >>> [sensor.name for sensor in rig.sensors]
        ['laser']
    """
    shipped = shipped_rigs().get(str(path))
    if shipped is None and all(is_mount(part) for part in str(path).split(",")):
        return _mounted(str(path), sensor, sd)
    path = Path(path)
    kinds = f"rig file or one of {', '.join(shipped_rigs())}"
    document = load_toml(path, kinds, RigTable, None if path.exists() else shipped)
    found = [sensor for name, table in document.sensors.items() for sensor in table.sensors(name)]
    rig = Rig(tuple(found), str(path))
    check_duplicates(rig, str(path))
    return rig


def _mounted(text: str, preset: str | None, sd: float | None) -> Rig:
    """Return the rig of poses in files of ROS and calibrations, with the stated figures of the sensors."""
    found: list[RigSensor] = []
    notes = []
    for part in text.split(","):
        name, equals, file = part.strip().partition("=")
        mount = read_mount(file if equals else name)
        T = mount.T_hand_sensor
        place = np.array2string(1e3 * T[:3, 3], separator=", ", precision=6, suppress_small=True)
        beam = np.array2string(T[:3, 2], separator=", ", precision=6, suppress_small=True)
        if preset is None and sd is None:
            raise InputError(
                f"{part}: expected --sensor or --sd for a sensor whose file states its pose only, got neither. The "
                f"{mount.words} places '{mount.name}' on '{mount.hand}' at position_mm = {place}, direction = {beam}. "
                "State one, or copy these lines to a rig (TOML)."
            )
        figures: dict[str, Any] = {"preset": preset} if preset is not None else {"beam_half_angle": 0.0}
        figures |= {} if sd is None else {"sd": sd}
        if preset is not None and (grid := re.search(r"(\d+)x(\d+)$", preset)):
            rows, columns = int(grid[1]), int(grid[2])
            zone = 2 * math.atan(square_axes(sensor_preset(preset).beam_half_angle)[0, 0])
            figures |= {"zones": [rows, columns], "field": np.array([rows * zone, columns * zone])}
        table = SensorTable(at=Place(part), position=T[:3, 3], quaternion_wxyz=SO3.as_quaternion(T[:3, :3]), **figures)
        found += table.sensors(name if equals else mount.name)
        notes.append(mount.note)
    rig = Rig(tuple(found), text, tuple(notes))
    check_duplicates(rig, text)
    return rig


@cache
def shipped_rigs() -> Mapping[str, str]:
    """Return the rigs shipped with tanteo: file content by name."""
    folder = resources.files("tanteo.sensors")
    files = [f for f in folder.iterdir() if f.name.endswith(".toml")]
    return {f.name.removesuffix(".toml"): f.read_text(encoding="utf-8") for f in sorted(files, key=lambda f: f.name)}


_BARE = re.compile(r"[A-Za-z0-9_-]+")


def write_rig(rig: Rig, path: str | Path, *, comment: str = "") -> None:
    """Write a rig file with lengths in millimetres and angles in degrees.

    Args:
        rig: rig to write.
        path: file to write; replaced if it exists.
        comment: comment lines for the start of the file.

    Raises:
        OSError: the file cannot be written.
    """
    text = rig_text(rig, comment=comment)
    with replaced(path) as file:
        file.write_text(text, encoding="utf-8")


def rig_text(rig: Rig, *, comment: str = "") -> str:
    """Return the text of a rig file.

    Args:
        rig: rig to write.
        comment: comment lines for the start of the file.
    """
    blocks = ["\n".join(f"# {line}".rstrip() for line in comment.splitlines())] if comment else []
    for sensor in rig.sensors:
        zones = [one for one in rig.sensors if one.unit == sensor.unit]
        whole = sensor.grid is not None and len(zones) == math.prod(sensor.grid[:2])
        if whole and sensor is not zones[0]:
            continue
        name, table = sensor.name, SensorTable.of(sensor)
        if whole:
            name, table = sensor.unit, SensorTable.of_zones(zones)
        name = name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)
        blocks.append("\n".join([f"[sensors.{name}]", *toml_lines(table)]))
    return "\n\n".join(blocks) + "\n"
