"""Error models of a sensed point: range, beam and its cone, mounting and robot (``math.md`` section 7).

Two ways to look along a cone. One ray drawn from it for every reading (:func:`draw_aims`) is what :func:`measure`
assumes: the point met is off the axis by a quarter of the squared half angle per axis, independently. Many rays that
fill it (:func:`cone_rays`) and are blended into one range (:func:`blend`) show what a real device does where only a
share of its spot is on the part.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.errors import InputError
from tanteo.lie import SE3, SO3
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


_GOLDEN_TURN = math.pi * (3 - math.sqrt(5))


def draw_aims(rng: np.random.Generator, half_angles: FloatArray | float, batch: tuple[int, ...] = ()) -> Vectors:
    """One unit direction per reading, drawn uniformly from the disc of the cone about +z of the sensor.

    Args:
        rng: Source of chance.
        half_angles: Half angles of the cones [rad], any shape.
        batch: Leading axes of the result, before those of ``half_angles``.

    Returns:
        ``(*batch, *half_angles.shape, 3)`` in the sensor's frame.
    """
    half_angles = np.asarray(half_angles, dtype=np.float64)
    u = rng.random((2, *batch, *half_angles.shape))
    off = np.tan(half_angles) * np.sqrt(u[0])
    return _directions(off, 2 * math.pi * u[1])


def cone_rays(half_angle: FloatArray | float, n: int) -> Vectors:
    """``n`` unit directions that fill the disc of a cone about +z evenly, each for the same area (a sunflower).

    Args:
        half_angle: Half angle [rad], any shape.
        n: How many.

    Returns:
        ``(*half_angle.shape, n, 3)`` in the sensor's frame.

    Raises:
        InputError: ``n`` is less than one.
    """
    if n < 1:
        raise InputError(f"n: expected one ray or more, got {n}. Use 64.")
    k = np.arange(n, dtype=np.float64)
    off = np.asarray(np.tan(half_angle))[..., None] * np.sqrt((k + 0.5) / n)
    return _directions(off, k * _GOLDEN_TURN)


def _directions(off: FloatArray, turn: FloatArray) -> Vectors:
    rays = np.empty((*off.shape, 3))
    rays[..., 0], rays[..., 1], rays[..., 2] = off * np.cos(turn), off * np.sin(turn), 1.0
    return np.asarray(rays / np.sqrt(1 + off * off)[..., None])


def blend(ranges: FloatArray, *, threshold: float = 0.5, nearest: bool = False) -> tuple[FloatArray, FloatArray]:
    """The range that a device makes of all the rays of its cone.

    Args:
        ranges: Along the rays [m], rays on the last axis; not finite where a ray met nothing within range.
        threshold: Share of the spot that must be met for the device to answer.
        nearest: The device answers with the nearest echo (ultrasonic) instead of the mean of them (time of flight).

    Returns:
        The ranges [m], infinite where the share is below the threshold, and the shares, without the last axis.

    Raises:
        InputError: A threshold that is not in (0, 1].
    """
    if not 0 < threshold <= 1:
        raise InputError(f"threshold: expected a share above 0 and up to 1, got {threshold:g}. Use 0.5.")
    met = np.isfinite(ranges)
    share = met.mean(axis=-1)
    if nearest:
        reading = np.min(ranges, axis=-1, where=met, initial=np.inf)
    else:
        reading = np.sum(ranges, axis=-1, where=met) / np.maximum(met.sum(axis=-1), 1)
    return np.where((share >= threshold) & (share > 0), reading, np.inf), share


def edge_shift(threshold: FloatArray | float) -> FloatArray:
    """How far the axis is over the part when a cone that crosses its edge begins to see it, in radii of the spot.

    Zero at half the spot; negative where a smaller share is enough, so that the edge seems to stand out by this many
    radii, from whichever side it is crossed: crossings of two opposite edges, or of one edge coming and going with a
    part and a background that are both seen, cancel it.

    Args:
        threshold: Share of the spot at which the device changes its mind, within (0, 1).
    """
    # the covered share is the distribution function of a uniform disc along one axis: Beta(3/2, 3/2)
    from scipy.special import betaincinv  # slow to import

    return np.asarray(2 * betaincinv(1.5, 1.5, threshold) - 1)


def edge_bias(d: FloatArray | float, half_angle: FloatArray | float, threshold: FloatArray | float) -> FloatArray:
    """Bias of an edge event [m] along the crossing, positive towards the part: ``d tan(gamma) g(threshold)``.

    Args:
        d: Range to the edge [m].
        half_angle: Of the cone [rad].
        threshold: Share of the spot at which the device changes its mind.
    """
    return np.asarray(np.asarray(d) * np.tan(half_angle) * edge_shift(threshold))


def edge_variance(
    d: FloatArray | float, half_angle: FloatArray | float, stride: FloatArray | float = 0.0
) -> FloatArray:
    """Variance of an edge event along the crossing [m^2], at a threshold of half the spot (``math.md`` section 7).

    Args:
        d: Range to the edge [m].
        half_angle: Of the cone [rad].
        stride: Way of the sensor from reading to reading [m]: speed times sampling time.
    """
    return np.asarray(np.asarray(stride) ** 2 / 12 + (0.5 * np.asarray(d) * half_angle) ** 2)
