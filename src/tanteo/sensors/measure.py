"""From readings to measurements: points in the world with their covariance and the errors they share.

What the numbers mean. ``sd`` is one standard deviation along the beam or the normal. Across a beam the spread is
that of its cone (half the half angle, ``math.md`` section 7) where the range is known; a touch, and a beam whose
cone is unknown, gets the same ``sd`` in every direction. Repeatability of the robot is independent from reading to
reading. Shared by the run: the robot's absolute error (a rigid left error of the world about its origin), the tip's
offset (in the hand's frame), each sensor's bias and scale (along its beam) and its mounting.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.features import SharedError
from tanteo.lie import SO3
from tanteo.limits import LARGEST, LEAST_SD
from tanteo.sensors.devices import Device, Placed, find_devices, place
from tanteo.sensors.measurements import FreeBeams, PointMeasurements
from tanteo.sensors.noise import beam_cov, body_jacobian
from tanteo.sensors.presets import RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.sensors.readings import Readings
from tanteo.sensors.rig import Rig
from tanteo.typing import BoolArray, Covariances, FloatArray, IntArray, Vectors

_ACROSS_FLOOR = 1e-2
"""Least spread across a beam, as a share of the spread along it: keeps covariances invertible."""

Shared = list[tuple[SharedError, FloatArray]]


def measure(
    readings: Readings,
    *,
    sensor: SensorPreset | str | None = None,
    robot: RobotPreset | str | None = None,
    sd: float | None = None,
    tip_sd: npt.ArrayLike | None = None,
    rig: Rig | None = None,
) -> PointMeasurements:
    """Points in the world with covariance and shared errors, from what the devices said.

    A point is the sensed **surface** point where the contact normal is known (ball centre less one radius along the
    normal); otherwise it is the centre of the tip's ball and its radius is kept. Free beams are carried along.

    Args:
        readings: What the devices said.
        sensor: Preset (or its name) of readings whose sensor the rig does not know.
        robot: Preset (or its name) of the robot's errors; none are assumed without it.
        sd: One standard deviation along the beam or normal [m], for rows that have none of their own.
        tip_sd: Standard deviations ``(3,)`` of the tip's offset in the hand's frame [m], one draw for the run.
        rig: Where the range sensors sit on the hand.

    Raises:
        InputError: The spread of a reading is unknown (no column, no ``sd``, no preset, or a preset that needs the
            range), the tip's error is asked for without hand poses, a range without a rig, or a name is unknown.
        ReadingsError: A range is outside what its device can give.
    """
    sensor = sensor_preset(sensor) if isinstance(sensor, str) else sensor
    robot = robot_preset(robot) if isinstance(robot, str) else robot
    if sd is not None and not LEAST_SD <= sd <= LARGEST:
        raise InputError(f"sd: expected one standard deviation from {LEAST_SD:g} to {LARGEST:g} m, got {sd:g}.")
    devices, numbers = find_devices(readings, sensor, rig)
    placed = place(readings, devices, numbers)
    hit = ~readings.is_free
    sds = _spreads(readings, placed, devices, numbers, sd)
    points, radii = _surface_points(readings, placed)
    covs = _independent(readings, placed, devices, numbers, sds, radii)
    shared: Shared = []
    if robot is not None:
        covs = covs + _repeatability(readings, points, robot)
        shared += _base(points, robot)
    if tip_sd is not None:
        shared += _tip(readings, placed, hit, tip_sd)
    aims = _aims(readings, placed)
    covs = covs + _unaimed_bias(aims, devices, numbers)
    shared += _device_errors(placed, aims, devices, numbers, hit)
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
        shared=tuple(error for error, _ in shared),
        jacobians=tuple(J[hit] for _, J in shared),
        rows=np.flatnonzero(hit),
        free=_free_beams(readings, placed, devices, numbers),
        taken_off=(readings.radii - radii)[hit],
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
    readings: Readings,
    placed: Placed,
    devices: tuple[Device, ...],
    numbers: IntArray,
    sds: FloatArray,
    radii: FloatArray,
) -> Covariances:
    """Independent covariances: along and across the beam, or a ball; and the normal's tilt on the tip's radius."""
    half_angles = np.array([d.beam_half_angle for d in devices])[numbers]
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


def _base(points: Vectors, robot: RobotPreset) -> Shared:
    """Rigid left error of the world about its origin: ``delta p = v + w x p`` (``math.md`` section 6)."""
    variances = np.repeat([robot.pos_abs_std**2, robot.rot_abs_std**2], 3)
    error = SharedError("robot base", np.diag(variances), f"absolute error of the robot ({robot.name}) [m, rad]")
    J = np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -SO3.hat(points)], axis=-1)
    return [(error, J)]


def _tip(readings: Readings, placed: Placed, hit: BoolArray, tip_sd: npt.ArrayLike) -> Shared:
    """Tip offset in the hand's frame: moves a touch by ``R_world_hand c``; ranges of the rig have no tip."""
    tip_sd = np.asarray(tip_sd, dtype=np.float64)
    if tip_sd.shape != (3,) or not np.isfinite(tip_sd).all() or (tip_sd < 0).any() or not tip_sd.any():
        raise InputError(f"tip_sd: expected three lengths of zero or more [m], got {tip_sd.tolist()}. Say 1,1,0.3mm.")
    if tip_sd.max() > LARGEST:
        raise InputError(f"tip_sd: expected lengths up to {LARGEST:g} m, got {tip_sd.max():g} m. Check their unit.")
    touched = hit & ~placed.by_rig
    lost = np.flatnonzero(touched & ~readings.has_hand)
    if len(lost):
        raise InputError(
            f"tip_sd: expected the hand's pose beside every reading, got none for '{readings.ids[lost[0]]}'. "
            "Add the columns hand_x_mm, hand_y_mm, hand_z_mm, hand_qw, hand_qx, hand_qy, hand_qz."
        )
    error = SharedError("tip offset", np.diag(tip_sd**2), "offset of the tip in the hand's frame [m]")
    return [(error, np.where(touched[:, None, None], readings.Ts_world_hand[:, :3, :3], 0.0))]


def _aims(readings: Readings, placed: Placed) -> Vectors:
    """The direction in which a device's bias acts: the beam or touch, else against the normal, else NaN."""
    return np.where(np.isnan(placed.directions), -readings.normals, placed.directions)


def _unaimed_bias(aims: Vectors, devices: tuple[Device, ...], numbers: IntArray) -> Covariances:
    """Bias of rows whose direction is unknown: it cannot be shared, so it widens the independent part."""
    bias = np.array([d.bias_sd for d in devices])[numbers]
    return np.where(np.isnan(aims[:, 0]), bias**2, 0.0)[:, None, None] * np.eye(3)


def _device_errors(
    placed: Placed, aims: Vectors, devices: tuple[Device, ...], numbers: IntArray, hit: BoolArray
) -> Shared:
    """Bias, scale and mounting of every device that gave a point; zones of one device share them."""
    out: Shared = []
    units: dict[str, Device] = {}
    for device in devices:
        units.setdefault(device.unit, device)
    own = np.array([list(units).index(device.unit) for device in devices])[numbers]
    for k, (unit, device) in enumerate(units.items()):
        rows = hit & (own == k)
        aimed = rows & ~np.isnan(aims[:, 0])
        ranged = aimed & ~np.isnan(placed.ranges)
        if device.bias_sd > 0 and aimed.any():
            J = np.where(aimed[:, None], aims, 0.0)[..., None]
            out.append((_one(f"bias of {unit}", device.bias_sd, "along the beam [m]"), J))
        if device.mount is not None and device.mount.cov_scale.any():
            out += _mount_and_scale(placed, device, rows & placed.by_rig)
            continue
        if device.scale_sd > 0 and ranged.any():
            J = np.where(ranged[:, None], aims * placed.ranges[:, None], 0.0)[..., None]
            out.append((_one(f"scale of {unit}", device.scale_sd, "along the beam, per range [1]"), J))
        mount = rows & placed.by_rig
        if device.mount is not None and device.mount.cov_mount.any() and mount.any():
            J = np.zeros((len(rows), 3, 6))
            J[mount] = body_jacobian(placed.T_world_units[mount], placed.points[mount])
            meaning = "mounting of the sensor on the hand, body error [m, rad]"
            out.append((SharedError(f"mounting of {unit}", device.mount.cov_mount, meaning), J))
    return out


def _mount_and_scale(placed: Placed, device: Device, rows: BoolArray) -> Shared:
    """Mounting and scale of a calibrated sensor, which were found together: one error of seven numbers."""
    if not rows.any():
        return []
    J = np.zeros((len(rows), 3, 7))
    J[rows, :, :6] = body_jacobian(placed.T_world_units[rows], placed.points[rows])
    # the more it reads too far, the nearer is what it met
    J[rows, :, 6] = -placed.ranges[rows, None] * placed.directions[rows]
    meaning = "mounting of the sensor on the hand, body error [m, rad], and scale error [1]"
    return [(SharedError(f"mounting and scale of {device.unit}", device.cov_unit, meaning), J)]


def _one(name: str, sd: float, meaning: str) -> SharedError:
    return SharedError(name, np.array([[sd**2]]), meaning)


def _free_beams(readings: Readings, placed: Placed, devices: tuple[Device, ...], numbers: IntArray) -> FreeBeams:
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
    )
