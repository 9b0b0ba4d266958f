"""From readings to measurements: points in the world with their covariance and the errors they share.

What the numbers mean. ``sd`` is one standard deviation along the beam or the normal. Across a beam the spread is
that of its cone (half the half angle, ``math.md`` section 7) where the range is known; a touch, and a beam whose
cone is unknown, gets the same ``sd`` in every direction. Repeatability of the robot is independent from reading to
reading. Shared by the run: the robot's absolute error (a rigid left error of the world about its origin), the tip's
offset (in the hand's frame), each sensor's bias and scale (along its beam) and its mounting.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError, check_kind
from tanteo.limits import LARGEST, LEAST_SD, check_length, check_number
from tanteo.sensors.devices import Device, Placed, find_devices, place
from tanteo.sensors.measurements import FreeBeams, PointMeasurements
from tanteo.sensors.noise import beam_cov
from tanteo.sensors.presets import RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.sensors.readings import Readings, check_readings_kind
from tanteo.sensors.rig import Rig
from tanteo.sensors.shared import Common, aims_of, base, of_devices, offset, tip
from tanteo.typing import Covariances, FloatArray, IntArray, Vectors

_ACROSS_FLOOR = 1e-2
"""Least spread across a beam, as a share of the spread along it: keeps covariances invertible."""


_SIDES = {"hole": 1, "boss": -1, "": 0}

UNSTATED_SD = 1e-4
"""Of touches of which nobody said how well they repeat [m]: between a touch probe and a hand-held tip."""


def measure(
    readings: Readings,
    *,
    sensor: SensorPreset | str | None = None,
    robot: RobotPreset | str | None = None,
    sd: float | None = None,
    tip_sd: npt.ArrayLike | None = None,
    bias_sd: float | None = None,
    rig: Rig | None = None,
    beam_half_angle: float = math.nan,
) -> PointMeasurements:
    """Points in the world with covariance and shared errors, from what the devices said.

    A point is the sensed **surface** point where the contact normal is known (ball centre less one radius along the
    normal); otherwise it is the centre of the tip's ball and its radius is kept. Free-space rays are carried along.

    Args:
        readings: What the devices said.
        sensor: Preset (or its name) of readings whose sensor the rig does not know.
        robot: Preset (or its name) of the robot's errors; none are assumed without it.
        sd: One standard deviation along the beam or normal [m], for rows that have none of their own.
        tip_sd: Standard deviations ``(3,)`` of the tip's offset in the hand's frame [m], one draw for the run.
        bias_sd: Standard deviation of an error along the approach that all readings share [m]: of the ball's radius,
            the trigger point or the zero, beside what presets and rigs say.
        rig: Where the range sensors sit on the hand.
        beam_half_angle: Of the beams of readings with a range whose sensor says none [rad]; if NaN, such readings are
            as uncertain across as along, as a touch is.

    Raises:
        InputError: The spread of a reading is unknown (no column, no ``sd``, no preset, or a preset that needs the
            range), the tip's error is asked for without hand poses, a range without a rig, or a name is unknown.
        ReadingsError: A range is outside what its device can give.
    """
    sensor, robot = _checked(readings, sensor, robot, rig)
    _check_sds(sd, bias_sd)
    devices, numbers = find_devices(readings, sensor, rig)
    placed = place(readings, devices, numbers)
    free = readings.is_free
    hit = ~free
    sds = _spreads(readings, placed, devices, numbers, sd)
    points, radii = _surface_points(readings, placed)
    half_angles = np.array([d.beam_half_angle for d in devices])[numbers]
    half_angles = np.where(np.isnan(half_angles), beam_half_angle, half_angles)
    covs, aims = _independent(readings, placed, half_angles, sds, radii), aims_of(readings, placed)
    shared = list[Common]()
    if robot is not None:
        covs = covs + _repeatability(readings, points, robot)
        shared.append(base(points, placed, free, robot))
    if tip_sd is not None:
        shared.append(tip(readings, placed, tip_sd))
    covs = covs + _unaimed(aims, np.array([d.bias_sd for d in devices])[numbers])
    shared += of_devices(placed, aims, devices, numbers, free)
    if bias_sd is not None:
        covs = covs + _unaimed(aims, bias_sd)
        shared.append(offset(aims, hit, bias_sd))
    sizes = np.fmax(readings.hole_radii, readings.half_angles)
    return PointMeasurements(
        ids=tuple(np.array(readings.ids, dtype=object)[hit]),
        points=points[hit],
        covs=covs[hit],
        radii=radii[hit],
        directions=placed.directions[hit],
        normals=readings.normals[hit],
        normal_sds=readings.normal_sds[hit],
        features=tuple(np.array(readings.features, dtype=object)[hit]),
        kinds=tuple(np.array(readings.kinds, dtype=object)[hit]),
        shared=tuple(one.error for one in shared),
        jacobians=tuple(one.points[hit] for one in shared),
        rows=np.flatnonzero(hit),
        free=_free_beams(readings, placed, devices, numbers, shared),
        taken_off=(readings.radii - radii)[hit],
        sizes=tuple(None if np.isnan(size) else size for size in sizes[hit].tolist()),
        material_sides=tuple(_SIDES[readings.material_sides[k]] for k in np.flatnonzero(hit)),
    )


def _check_sds(sd: float | None, bias_sd: float | None) -> None:
    """Spreads that readings can have."""
    if sd is not None:
        check_number("sd", sd, "m")
    if sd is not None and not LEAST_SD <= sd <= LARGEST:
        raise InputError(f"sd: expected one standard deviation from {LEAST_SD:g} to {LARGEST:g} m, got {sd:g}.")
    if bias_sd is not None:
        check_length("bias_sd", bias_sd, LEAST_SD)


def _unaimed(aims: Vectors, sds: FloatArray | float) -> Covariances:
    """A bias whose direction is unknown cannot be shared: it widens the independent part ``(n, 3, 3)``."""
    return np.asarray(np.where(np.isnan(aims[:, 0]), np.square(sds), 0.0)[:, None, None] * np.eye(3))


def unstated_sd(
    readings: Readings, *, sensor: SensorPreset | str | None = None, sd: float | None = None, rig: Rig | None = None
) -> float | None:
    """The sd that is assumed of readings of which nobody said any [m]; None where somebody did, or it is a preset's.

    It is only where to begin: the readings themselves tell how much they scatter, within a factor of some twenty.
    """
    check_readings_kind("readings", readings)
    said = sd is not None or sensor is not None or rig is not None or bool(np.isfinite(readings.sds).any())
    return None if said or bool(np.isfinite(readings.ranges).any()) else UNSTATED_SD


def _checked(
    readings: Readings, sensor: SensorPreset | str | None, robot: RobotPreset | str | None, rig: Rig | None
) -> tuple[SensorPreset | None, RobotPreset | None]:
    """The presets, by name or not; what is no readings, preset or rig at all is refused."""
    check_readings_kind("readings", readings)
    if rig is not None:
        check_kind("rig", rig, Rig, "Read its file first: tanteo.io.read_rig(path).")
    if sensor is not None:
        check_kind("sensor", sensor, (SensorPreset, str), "Name one of tanteo.sensors.sensor_presets().")
    if robot is not None:
        check_kind("robot", robot, (RobotPreset, str), "Name one of tanteo.sensors.robot_presets().")
    return (
        sensor_preset(sensor) if isinstance(sensor, str) else sensor,
        robot_preset(robot) if isinstance(robot, str) else robot,
    )


def _spreads(
    readings: Readings, placed: Placed, devices: tuple[Device, ...], numbers: IntArray, sd: float | None
) -> FloatArray:
    """Standard deviation along the beam or normal: the column, else ``sd``, else the device."""
    sds = np.array(readings.sds)
    if sd is not None:
        sds[np.isnan(sds)] = sd
    for k, device in enumerate(devices):
        rows = np.isnan(sds) & (numbers == k)
        sds[rows] = device.law.sigma(placed.ranges[rows])
    unknown = np.flatnonzero(np.isnan(sds) & ~readings.is_free)
    if len(unknown):
        device = devices[numbers[unknown[0]]]
        why = (
            f"the noise of '{device.name}' depends on the range and there is none"
            if device.preset is not None
            else "no column sd, no --sd and no sensor preset"
        )
        raise InputError(
            f"sd of reading '{readings.ids[unknown[0]]}': expected one standard deviation, got none ({why}). "
            "Add the column sd_mm, or --sd 0.3mm, or --sensor with ranges."
        )
    return np.where(readings.is_free, 1.0, sds)


def _surface_points(readings: Readings, placed: Placed) -> tuple[Vectors, FloatArray]:
    """Points, moved to the surface where the normal is known, and the radii that remain."""
    known = readings.has_normal & (readings.radii > 0)
    shift = np.where(known[:, None], readings.radii[:, None] * readings.normals, 0.0)
    return placed.points - shift, np.where(known, 0.0, readings.radii)


def _independent(
    readings: Readings, placed: Placed, half_angles: FloatArray, sds: FloatArray, radii: FloatArray
) -> Covariances:
    """Independent covariances: along and across the beam, or a ball; and the normal's tilt on the tip's radius."""
    cone = 0.5 * placed.ranges * half_angles
    is_beam = ~np.isnan(cone) & ~np.isnan(placed.directions[:, 0])
    across = np.where(is_beam, np.maximum(cone, _ACROSS_FLOOR * sds), sds)
    aimed = ~np.isnan(readings.across_sds) & ~np.isnan(placed.directions[:, 0])
    across = np.where(aimed, readings.across_sds, across)
    is_beam |= aimed
    axis = np.where(is_beam[:, None], placed.directions, [0.0, 0.0, 1.0])
    covs = beam_cov(axis, sds**2, across**2)
    tilted = (radii < readings.radii) & ~np.isnan(readings.normal_sds)
    if tilted.any():
        slip = (readings.radii[tilted] * readings.normal_sds[tilted]) ** 2
        covs[tilted] += beam_cov(readings.normals[tilted], np.zeros_like(slip), slip)
    return covs


def _repeatability(readings: Readings, points: Vectors, robot: RobotPreset) -> Covariances:
    """Of the hand's pose: its position, and its turn times the arm from hand to point where the hand is known."""
    arms = np.where(readings.has_hand[:, None], points - readings.Ts_world_hand[:, :3, 3], 0.0)
    squares = np.sum(arms**2, axis=-1)[:, None, None]
    turned = squares * np.eye(3) - arms[:, :, None] * arms[:, None, :]
    return np.asarray(robot.pos_repeat_std**2 * np.eye(3) + robot.rot_repeat_std**2 * turned)


def _free_beams(
    readings: Readings, placed: Placed, devices: tuple[Device, ...], numbers: IntArray, shared: Sequence[Common]
) -> FreeBeams:
    free = readings.is_free
    half_angles = np.array([d.beam_half_angle for d in devices])[numbers]
    touches = [d.preset is not None and d.preset.is_contact for d in devices]  # a tip is stopped however it comes
    limits = np.where(touches, np.pi / 2, [d.max_incidence for d in devices])[numbers]
    return FreeBeams(
        ids=tuple(np.array(readings.ids, dtype=object)[free]),
        origins=placed.points[free],
        directions=placed.directions[free],
        lengths=placed.lengths[free],
        half_angles=np.nan_to_num(half_angles[free]),
        max_incidences=limits[free],
        jacobians=tuple(one.points[free] for one in shared),
        turns=tuple(one.turns[free] for one in shared),
    )
