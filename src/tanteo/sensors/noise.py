"""Model the errors of a sensed point: range, beam and its cone, mounting and robot (``math.md`` section 7).

There are two models of a cone. :func:`measure` assumes one ray drawn for every reading (:func:`draw_aims`): the hit
point is off the axis by a quarter of the squared half angle per axis, independently. Many rays that fill the cone
(:func:`cone_rays`), blended into one range (:func:`blend`), simulate a real device whose spot is only partly on the
part.
"""

from __future__ import annotations

import math

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


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
    """Return the variance of the range of an intensity sensor, ``I = k rho cos(beta) / d^2`` (``math.md`` section 7).

    Args:
        d: range [m].
        beta: incidence, the angle between beam and surface normal [rad], below pi/2.
        s0: constant standard deviation [m].
        k1: standard deviation proportional to the range.
        k3: standard deviation from constant noise of the intensity, which grows as ``d^3 / cos(beta)`` [1/m^2].
        s_rho: relative standard deviation of the reflectance. It is common to a surface: use it as noise only when
            readings come from different surfaces.
        s_beta: standard deviation of the incidence [rad].

    Returns:
        Variance [m^2], broadcast over ``d`` and ``beta``.

    Raises:
        InputError: an incidence is pi/2 or more, where the beam misses the surface.
    """
    d = np.asarray(d, dtype=np.float64)
    beta = np.asarray(beta, dtype=np.float64)
    cos = np.cos(beta)
    if not (cos > 0).all():
        raise InputError(
            f"beta: expected an incidence below pi/2, got {np.max(np.abs(beta)):g} rad. The beam must face the surface."
        )
    reflectance = 0.5 * d * s_rho
    incidence = 0.5 * d * np.tan(beta) * s_beta
    return np.asarray(s0**2 + (k1 * d) ** 2 + (k3 * d**3 / cos) ** 2 + reflectance**2 + incidence**2)


def sensor_error_cov(
    T_robot_sensor: Transforms, T_sensor_feature: Transforms, cov_robot: Covariances, cov_device: Covariances
) -> Covariances:
    """Return the covariance of a sensed feature's location in its own frame (Montano and Sagues 1991, equation (2)).

    ``T_robot_feature = T_robot_sensor T_sensor_feature``, with independent body errors of the robot (at ``robot``) and
    of the device (at ``sensor``): ``C = FJR C_r FJR^T + FJS C_d FJS^T``.

    Args:
        T_robot_sensor: pose of the sensor in the robot frame ``(*batch, 4, 4)`` [m].
        T_sensor_feature: pose of the feature in the sensor frame ``(*batch, 4, 4)`` [m].
        cov_robot: covariance of the robot's body error at ``robot`` ``(6, 6)``, order ``x y z rx ry rz``.
        cov_device: covariance of the device's body error at ``sensor`` ``(6, 6)``.

    Returns:
        Covariance ``(*batch, 6, 6)`` in the feature frame.
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
    """Return the point that a beam along +z of the sensor hits, with its covariance (``math.md`` section 7).

    Args:
        T_world_robot: pose of the robot (or of the hand, if ``cov_robot`` is the hand's) in the world ``(*batch, 4,
            4)`` [m].
        T_robot_sensor: pose of the sensor in that frame ``(*batch, 4, 4)`` [m].
        d: range [m].
        cov_robot: covariance of the body error at ``robot`` ``(6, 6)``.
        cov_sensor: covariance of the body error at ``sensor`` (mounting) ``(6, 6)``.
        var_range: variance of the range [m^2].
        cone_half_angle: half angle of the beam [rad]; the spot is a uniform disc with a quarter of its square per axis.

    Returns:
        Points ``(*batch, 3)`` in the world [m] and their covariances ``(*batch, 3, 3)`` [m^2].
    """
    T_world_sensor = T_world_robot @ T_robot_sensor
    d = np.asarray(d, dtype=np.float64)
    beam = T_world_sensor[..., :3, 2]
    points = T_world_sensor[..., :3, 3] + d[..., None] * beam
    cov = carry(body_jacobian(T_world_robot, points), cov_robot)
    cov = cov + carry(body_jacobian(T_world_sensor, points), cov_sensor)
    return points, cov + beam_cov(beam, var_range, (0.5 * d * cone_half_angle) ** 2)


def body_jacobian(T_world_body: Transforms, points: Vectors) -> FloatArray:
    """Return the derivative of points fixed to a body by the body's error: ``R [I, -[q]x]`` ``(*batch, 3, 6)``.

    Args:
        T_world_body: pose of the body ``(*batch, 4, 4)`` [m]; its error ``e`` acts as ``T exp(e)``.
        points: points in the world ``(*batch, 3)`` [m].
    """
    R = T_world_body[..., :3, :3]
    arms = SE3.apply(SO3.inverse(R), points - T_world_body[..., :3, 3])
    return np.concatenate([np.broadcast_to(R, (*arms.shape[:-1], 3, 3)), -R @ SO3.hat(arms)], axis=-1)


def beam_cov(beam: Vectors, along: FloatArray | float, across: FloatArray | float) -> Covariances:
    """Return ``along a a^T + across (I - a a^T)``, the covariance of a point on a beam ``(*batch, 3, 3)`` [m^2].

    Args:
        beam: unit vectors ``a`` ``(*batch, 3)``.
        along: variance along the beam [m^2].
        across: variance across the beam per axis [m^2].
    """
    along = np.asarray(along, dtype=np.float64)
    across = np.asarray(across, dtype=np.float64)
    outer = beam[..., :, None] * beam[..., None, :]
    return np.asarray(across[..., None, None] * np.eye(3) + (along - across)[..., None, None] * outer)


def carry(J: FloatArray, cov: Covariances) -> Covariances:
    """Return ``J C J^T``, exactly symmetric.

    Args:
        J: Jacobian ``(*batch, m, n)``.
        cov: covariance ``(*batch, n, n)``.
    """
    out = J @ cov @ np.swapaxes(J, -1, -2)
    return np.asarray(0.5 * (out + np.swapaxes(out, -1, -2)))


_GOLDEN_TURN, _GOLDEN = math.pi * (3 - math.sqrt(5)), (math.sqrt(5) - 1) / 2


def draw_aims(rng: np.random.Generator, half_angles: FloatArray | float, batch: tuple[int, ...] = ()) -> Vectors:
    """Draw one unit direction per reading, uniformly in the disc of the cone about +z of the sensor.

    Args:
        rng: random number generator.
        half_angles: half angles of the cones [rad], any shape.
        batch: leading axes of the result.

    Returns:
        Directions ``(*batch, *half_angles.shape, 3)`` in the sensor frame.
    """
    half_angles = np.asarray(half_angles, dtype=np.float64)
    u = rng.random((2, *batch, *half_angles.shape))
    off = np.tan(half_angles) * np.sqrt(u[0])
    return _directions(off, 2 * math.pi * u[1])


def cone_rays(half_angle: FloatArray | float, n: int) -> Vectors:
    """Return ``n`` unit directions that fill the disc of a cone about +z with equal areas (sunflower, Vogel 1979).

    Args:
        half_angle: half angle [rad], any shape.
        n: number of directions.

    Returns:
        Directions ``(*half_angle.shape, n, 3)`` in the sensor frame.

    Raises:
        InputError: ``n`` is less than one.
    """
    if n < 1:
        raise InputError(f"n: expected one ray or more, got {n}. Use 64.")
    k = np.arange(n, dtype=np.float64)
    off = np.asarray(np.tan(half_angle))[..., None] * np.sqrt((k + 0.5) / n)
    return _directions(off, k * _GOLDEN_TURN)


def rectangle_rays(axis: Vectors, half_axes: Vectors, n: int) -> Vectors:
    """Return ``n`` unit directions that fill a rectangular beam with equal areas (lattice of the golden ratio).

    Args:
        axis: direction of the beam ``(3,)``.
        half_axes: half axes of the rectangle at distance one ``(2, 3)``.
        n: number of directions.

    Returns:
        Directions ``(n, 3)`` in the frame of the axes.
    """
    k = np.arange(n) + 0.5
    places = 2 * np.stack([k / n, k * _GOLDEN % 1.0], axis=-1) - 1
    rays = np.asarray(axis) + places @ np.asarray(half_axes)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def square_axes(half_angle: float) -> Vectors:
    """Return the half axes ``(2, 3)`` at distance one of the square whose section is that of a cone about +z.

    Args:
        half_angle: half angle of the cone [rad].
    """
    return np.eye(2, 3) * (0.5 * math.sqrt(math.pi) * math.tan(half_angle))


def equal_cone(half_axes: Vectors) -> float:
    """Return the half angle of the cone whose section is that of a rectangle [rad].

    Args:
        half_axes: half axes of the rectangle at distance one ``(2, 3)``.
    """
    area = 4 * float(np.linalg.norm(np.cross(half_axes[0], half_axes[1])))
    return math.atan(math.sqrt(area / math.pi))


def _directions(off: FloatArray, turn: FloatArray) -> Vectors:
    rays = np.empty((*off.shape, 3))
    rays[..., 0], rays[..., 1], rays[..., 2] = off * np.cos(turn), off * np.sin(turn), 1.0
    return np.asarray(rays / np.sqrt(1 + off * off)[..., None])


def blend(ranges: FloatArray, *, threshold: float = 0.5, nearest: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return the range that a device reports for all rays of its cone.

    Args:
        ranges: ranges along the rays [m], with the rays on the last axis; not finite where a ray hits nothing within
            range.
        threshold: fraction of the spot on a surface above which the device reports a range.
        nearest: whether the device reports the nearest echo (ultrasonic) instead of the mean (time of flight).

    Returns:
        Ranges [m], infinite where the fraction is below the threshold, and the fractions, without the last axis.

    Raises:
        InputError: the threshold is not in (0, 1].
    """
    if not 0 < threshold <= 1:
        raise InputError(f"threshold: expected a share above 0 and up to 1, got {threshold:g}. Use 0.5.")
    hits = np.isfinite(ranges)
    share = hits.mean(axis=-1)
    if nearest:
        reading = np.min(ranges, axis=-1, where=hits, initial=np.inf)
    else:
        reading = np.sum(ranges, axis=-1, where=hits) / np.maximum(hits.sum(axis=-1), 1)
    return np.where((share >= threshold) & (share > 0), reading, np.inf), share


def edge_shift(threshold: FloatArray | float) -> FloatArray:
    """Return the position of the axis relative to an edge, in spot radii, at which a crossing cone switches the device.

    It is zero for a threshold of half the spot and negative for a smaller one, so that the edge appears displaced
    outwards whichever side the crossing starts from. Crossings of two opposite edges cancel it, and so do crossings of
    one edge in both directions if part and background are both detected.

    Args:
        threshold: fraction of the spot at which the device switches, in (0, 1).
    """
    # the covered share is the distribution function of a uniform disc along one axis: Beta(3/2, 3/2)
    from scipy.special import betaincinv  # slow to import

    return np.asarray(2 * betaincinv(1.5, 1.5, threshold) - 1)


def edge_bias(d: FloatArray | float, half_angle: FloatArray | float, threshold: FloatArray | float) -> FloatArray:
    """Return the bias of an edge event along the crossing [m], positive towards the part.

    ``d tan(gamma) g(threshold)``.

    Args:
        d: range to the edge [m].
        half_angle: half angle ``gamma`` of the cone [rad].
        threshold: fraction of the spot at which the device switches, argument of ``g`` (:func:`edge_shift`).
    """
    return np.asarray(np.asarray(d) * np.tan(half_angle) * edge_shift(threshold))


def edge_variance(
    d: FloatArray | float, half_angle: FloatArray | float, stride: FloatArray | float = 0.0
) -> FloatArray:
    """Return the variance of an edge event along the crossing [m^2] (``math.md`` section 7).

    The threshold is half the spot.

    Args:
        d: range to the edge [m].
        half_angle: half angle of the cone [rad].
        stride: path of the sensor between readings [m], speed times sampling time.
    """
    return np.asarray(np.asarray(stride) ** 2 / 12 + (0.5 * np.asarray(d) * half_angle) ** 2)
