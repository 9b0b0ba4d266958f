"""Model errors that readings share, and their effect on points and free-space rays.

A beam has an origin and a direction. An error of its frame moves both. Bias and scale of a sensor move
neither, because they act on ranges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.features import SharedError
from tanteo.geometry import SO3
from tanteo.geometry.limits import LARGEST
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors
from tanteo.sensors.columns import Column
from tanteo.sensors.devices import Device, Placed
from tanteo.sensors.error_states import ANGLES, Columns, ErrorState, Fan, Sensed
from tanteo.sensors.noise import body_jacobian
from tanteo.sensors.presets import RobotPreset
from tanteo.sensors.readings import Readings


@dataclass(frozen=True, slots=True, eq=False)
class SharedEffect:
    """Shared error ``c`` of ``d`` components, with its effect on all readings.

    Attributes:
        error: name, covariance and meaning of the error.
        points: derivative of points, and of origins of free-space rays, by ``c`` ``(n, 3, d)``.
        turns: derivative of directions of beams by ``c`` ``(n, 3, d)``; zero for readings without direction.
    """

    error: SharedError
    points: FloatArray
    turns: FloatArray


def base(points: Vectors, placed: Placed, robot: RobotPreset) -> SharedEffect:
    """Return the absolute error of the robot, a rigid left error of the world.

    ``delta p = v + w x p`` (``math.md`` section 6).

    Args:
        points: points of the readings ``(n, 3)`` [m].
        placed: readings in the world.
        robot: error figures of the robot.
    """
    variances = np.repeat([robot.pos_abs_std**2, robot.rot_abs_std**2], 3)
    error = SharedError("robot base", np.diag(variances), f"absolute error of the robot ({robot.name}) [m, rad]")
    J = np.concatenate([np.broadcast_to(np.eye(3), (len(points), 3, 3)), -SO3.hat(points)], axis=-1)
    turns = np.zeros_like(J)
    aimed = placed.directions.given
    turns[aimed, :, 3:] = -SO3.hat(placed.directions[aimed])
    return SharedEffect(error, J, turns)


def tip(readings: Readings, placed: Placed, tip_sd: npt.ArrayLike) -> SharedEffect:
    """Return the tip's offset in the hand frame, which moves a contact reading by ``R_world_hand c`` but not a range.

    Args:
        readings: readings with hand poses.
        placed: readings in the world.
        tip_sd: standard deviations of the offset ``(3,)`` [m].

    Raises:
        InputError: ``tip_sd`` is invalid, or a contact reading has no hand pose.
    """
    try:
        tip_sd = np.asarray(tip_sd, dtype=np.float64)
    except (ValueError, TypeError):
        raise InputError(f"tip_sd: expected three numbers [m], got {tip_sd!r}. Use [1e-3, 1e-3, 0.3e-3].") from None
    if tip_sd.shape != (3,) or not np.isfinite(tip_sd).all() or (tip_sd < 0).any():
        raise InputError(f"tip_sd: expected three lengths of zero or more [m], got {tip_sd.tolist()}. Correct them.")
    if tip_sd.max() > LARGEST:
        raise InputError(f"tip_sd: expected lengths up to {LARGEST:g} m, got {tip_sd.max():g} m. Check their unit.")
    touched = ~placed.by_rig
    lost = np.flatnonzero(touched & ~readings.Ts_world_hand.given)
    if len(lost):
        raise InputError(
            f"tip_sd: expected the hand's pose beside every reading, got none for '{readings.ids[lost[0]]}'. "
            "Add the columns hand_x_mm, hand_y_mm, hand_z_mm, hand_qw, hand_qx, hand_qy, hand_qz; in a session say "
            "action.read(distance, T_world_hand=...)."
        )
    error = SharedError("tip offset", np.diag(tip_sd**2), "offset of the tip in the hand's frame [m]")
    J = readings.Ts_world_hand.only(touched).filled(0.0)[:, :3, :3]
    return SharedEffect(error, J, np.zeros_like(J))


def of_state(error: ErrorState, columns: Columns) -> SharedEffect:
    """Return the effect of an error state; its mean is added to the points by :func:`tanteo.sensors.measure`.

    Args:
        error: error with its prior.
        columns: derivatives of the readings by its states.
    """
    count = columns.points.shape[2]
    name = columns.names[0] if count == 1 else error.name
    cov = (error.spread * error.sd) ** 2 * np.eye(count)
    turns = np.zeros_like(columns.points) if columns.turns is None else columns.turns
    shared = SharedError(name, cov, f"{name} [{error.unit}]", columns.names, error.one_sided)
    return SharedEffect(shared, columns.points, turns)


def unstated_angles(sensed: Sensed, devices: tuple[Device, ...], numbers: IntArray, sd: float) -> list[SharedEffect]:
    """Return assumed errors of the angles of range sensors whose rig states no mounting error.

    Args:
        sensed: the readings.
        devices: devices of the readings.
        numbers: device index of each reading ``(n,)``.
        sd: standard deviation of each angle [rad].
    """
    loose = [k for k, d in enumerate(devices) if d.mount is not None and not d.mount.cov_mount.any()]
    out = []
    for unit in dict.fromkeys(devices[k].unit for k in loose):
        own = [k for k in loose if devices[k].unit == unit]
        rows = sensed.T_world_units.given & np.isin(numbers, own)
        if rows.any():
            columns = Fan(sd).columns(replace(sensed, T_world_units=sensed.T_world_units.only(rows)))
            one = of_state(Fan(sd), columns)
            meaning = f"assumed error of the angles of {unit} [rad]"
            out.append(replace(one, error=replace(one.error, name=f"{ANGLES}{unit}", meaning=meaning)))
    return out


def aims_of(readings: Readings, placed: Placed) -> Column:
    """Return the directions in which a device's bias acts ``(n, 3)``: of beam or approach, else against the normal.

    Args:
        readings: readings of the devices.
        placed: readings in the world.
    """
    return placed.directions.coalesce(readings.normals.map(np.negative))


def of_devices(
    placed: Placed, aims: Column, devices: tuple[Device, ...], numbers: IntArray, free: BoolArray
) -> list[SharedEffect]:
    """Return bias, scale and mounting errors of every device; the zones of one device share them.

    Args:
        placed: readings in the world.
        aims: directions in which a bias acts ``(n, 3)``.
        devices: devices of the readings.
        numbers: device index of each reading ``(n,)``.
        free: mask of free-space rays ``(n,)``.
    """
    out: list[SharedEffect] = []
    units: dict[str, Device] = {}
    for device in devices:
        units.setdefault(device.unit, device)
    own = np.array([list(units).index(device.unit) for device in devices])[numbers]
    for k, (unit, device) in enumerate(units.items()):
        rows = own == k
        aimed = rows & ~free & aims.given
        ranged = aimed & placed.ranges.given
        if device.bias_sd > 0 and aimed.any():
            J = aims.only(aimed).filled(0.0)[..., None]
            out.append(_one(f"bias of {unit}", device.bias_sd, "along the beam [m]", J))
        if device.mount is not None and device.mount.cov_scale.any():
            out += _mount_and_scale(placed, device, rows & placed.by_rig, free)
            continue
        if device.scale_sd > 0 and ranged.any():
            J = (aims.only(ranged).filled(0.0) * placed.ranges.only(ranged).filled(0.0)[:, None])[..., None]
            out.append(_one(f"scale of {unit}", device.scale_sd, "along the beam, per range [1]", J))
        mount = rows & placed.by_rig
        if device.mount is not None and device.mount.cov_mount.any() and mount.any():
            meaning = "mounting of the sensor on the hand [m, rad]"
            error = SharedError(f"mounting of {unit}", device.mount.cov_mount, meaning)
            out.append(SharedEffect(error, *_mounted(placed, mount)))
    return out


def _mounted(placed: Placed, rows: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of points and of ray directions by the sensor's body error ``(n, 3, 6)``."""
    J = np.zeros((len(rows), 3, 6))
    turns = np.zeros((len(rows), 3, 6))
    J[rows] = body_jacobian(placed.T_world_units[rows], placed.points[rows])
    ahead = placed.points[rows] + placed.directions[rows]
    turns[rows] = body_jacobian(placed.T_world_units[rows], ahead) - J[rows]
    return J, turns


def _mount_and_scale(placed: Placed, device: Device, rows: BoolArray, free: BoolArray) -> list[SharedEffect]:
    """Return mounting and scale of a jointly calibrated sensor as one error of seven components."""
    if not rows.any():
        return []
    mounted, turns = _mounted(placed, rows)
    # a device that reports too large a range has a nearer target
    hit = rows & ~free
    nearer = np.zeros((len(rows), 3, 1))
    nearer[hit, :, 0] = -placed.ranges[hit][:, None] * placed.directions[hit]
    meaning = "mounting of the sensor on the hand [m, rad] and its scale [1]"
    error = SharedError(f"mounting and scale of {device.unit}", device.cov_unit, meaning)
    return [SharedEffect(error, np.concatenate([mounted, nearer], axis=2), np.pad(turns, [(0, 0), (0, 0), (0, 1)]))]


def _one(name: str, sd: float, meaning: str, J: FloatArray) -> SharedEffect:
    return SharedEffect(SharedError(name, np.array([[sd**2]]), meaning), J, np.zeros_like(J))
