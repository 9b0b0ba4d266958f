"""Error models of a sensed point: the range, the beam, the sensor's mounting and the robot (``math.md`` section 7)."""

from __future__ import annotations

import numpy as np

from tanteo.errors import InputError
from tanteo.lie import SE3, SO3
from tanteo.sensors.presets import SensorPreset
from tanteo.typing import Covariances, FloatArray, Transforms, Vectors


def range_variance(
    d: FloatArray | float,
    beta: FloatArray | float,
    *,
    s0: float,
    k1: float = 0.0,
    k3: float = 0.0,
    s_rho: float = 0.0,
    s_beta: float = 0.0,
) -> FloatArray:
    """Variance of the range of an intensity sensor, ``I = k rho cos(beta) / d^2`` (``math.md`` section 7).

    Args:
        d: Range [m].
        beta: Incidence: angle between beam and surface normal [rad], below pi/2.
        s0: Floor [m].
        k1: Part proportional to the range.
        k3: Constant noise of the intensity, which grows as ``d^3 / cos(beta)`` [1/m^2].
        s_rho: Relative standard deviation of the reflectance. It is common to a surface: use it as noise only
            when readings come from different surfaces.
        s_beta: Standard deviation of the incidence [rad].

    Returns:
        The variance [m^2], broadcast over ``d`` and ``beta``.

    Raises:
        InputError: An incidence of pi/2 or more: the beam does not meet the surface.
    """
    d, beta = np.asarray(d, dtype=np.float64), np.asarray(beta, dtype=np.float64)
    cos = np.cos(beta)
    if not (cos > 0).all():
        raise InputError(
            f"beta: expected an incidence below pi/2, got {np.max(np.abs(beta)):g} rad. Look at the front."
        )
    reflectance, incidence = 0.5 * d * s_rho, 0.5 * d * np.tan(beta) * s_beta
    return np.asarray(s0**2 + (k1 * d) ** 2 + (k3 * d**3 / cos) ** 2 + reflectance**2 + incidence**2)


def preset_sigma(preset: SensorPreset, d: FloatArray | float) -> FloatArray:
    """Standard deviation of a range by a preset's noise law [m], independent from reading to reading.

    Args:
        preset: The sensor.
        d: Range [m]; ignored by a preset without range-dependent terms.
    """
    return preset.law.sigma(d)


def sensor_error_cov(
    T_robot_sensor: Transforms, T_sensor_feature: Transforms, cov_robot: Covariances, cov_device: Covariances
) -> Covariances:
    """Covariance of a sensed feature's location in its own frame: equation (2) of the paper.

    ``T_robot_feature = T_robot_sensor T_sensor_feature``, with a body error of the robot ahead of the first and a
    body error of the device between the two, independent: ``C = FJR C_r FJR^T + FJS C_d FJS^T``.

    Args:
        T_robot_sensor: Pose of the sensor in the robot's frame.
        T_sensor_feature: Pose of the feature in the sensor's frame.
        cov_robot: Of the robot's body error at ``robot`` (``x y z rx ry rz``).
        cov_device: Of the device's body error at ``sensor``.

    Returns:
        ``(*batch, 6, 6)`` in the feature's frame.
    """
    J_robot = SE3.adjoint_inverse(T_robot_sensor @ T_sensor_feature)
    J_device = SE3.adjoint_inverse(T_sensor_feature)
    return carry(J_robot, cov_robot) + carry(J_device, cov_device)


def sensed_point(
    T_world_robot: Transforms,
    T_robot_sensor: Transforms,
    d: FloatArray | float,
    *,
    cov_robot: Covariances,
    cov_sensor: Covariances,
    var_range: FloatArray | float,
    cone_half_angle: FloatArray | float = 0.0,
) -> tuple[Vectors, Covariances]:
    """Point that a beam along +z of the sensor met at range ``d``, with its covariance (``math.md`` section 7).

    Args:
        T_world_robot: Pose of the robot (or of the hand, if ``cov_robot`` is the hand's) in the world.
        T_robot_sensor: Pose of the sensor on it.
        d: Range [m].
        cov_robot: Of the body error at ``robot``.
        cov_sensor: Of the body error at ``sensor`` (mounting).
        var_range: Variance of the range [m^2].
        cone_half_angle: Of the beam [rad]; a uniform disc, so a quarter of its square per axis.

    Returns:
        The points ``(*batch, 3)`` in the world [m] and their covariances ``(*batch, 3, 3)`` [m^2].
    """
    T_world_sensor = T_world_robot @ T_robot_sensor
    d = np.asarray(d, dtype=np.float64)
    beam = T_world_sensor[..., :3, 2]
    points = T_world_sensor[..., :3, 3] + d[..., None] * beam
    cov = carry(body_jacobian(T_world_robot, points), cov_robot)
    cov = cov + carry(body_jacobian(T_world_sensor, points), cov_sensor)
    return points, cov + beam_cov(beam, var_range, (0.5 * d * cone_half_angle) ** 2)


def body_jacobian(T_world_body: Transforms, points: Vectors) -> FloatArray:
    """How points fixed to a body move in the world with the body's error: ``R [I, -[q]x]``, ``(*batch, 3, 6)``.

    Args:
        T_world_body: Pose of the body; its error is ``T exp(e)``.
        points: The points in the world [m].
    """
    R = T_world_body[..., :3, :3]
    arms = SE3.apply(SO3.inverse(R), points - T_world_body[..., :3, 3])
    return np.concatenate([np.broadcast_to(R, (*arms.shape[:-1], 3, 3)), -R @ SO3.hat(arms)], axis=-1)


def beam_cov(beam: Vectors, along: FloatArray | float, across: FloatArray | float) -> Covariances:
    """``along a a^T + across (I - a a^T)`` for unit vectors ``a``: variances [m^2] along and across a beam."""
    along, across = np.asarray(along, dtype=np.float64), np.asarray(across, dtype=np.float64)
    outer = beam[..., :, None] * beam[..., None, :]
    return np.asarray(across[..., None, None] * np.eye(3) + (along - across)[..., None, None] * outer)


def carry(J: FloatArray, cov: Covariances) -> Covariances:
    """``J C J^T``, symmetric to the last bit."""
    out = J @ cov @ np.swapaxes(J, -1, -2)
    return np.asarray(0.5 * (out + np.swapaxes(out, -1, -2)))
