"""Compute Jacobians of operations on location vectors, named as in the paper (Appendices 1 and 2).

``E_r`` converts angle rates to body rates, and ``K_r`` is its inverse. ``J1`` and ``J2`` are the derivatives of
``x1 (+) x2`` by its operands, ``J_ominus`` that of ``(-) x``. The differential transformations map an error from one
frame to another. Sources: Smith, Self and Cheeseman (1988); Paul (1981); ``math.md`` section 1. They serve reports in
the paper's variables; estimation uses ``frames.relate``, which has no gimbal lock.
"""

from __future__ import annotations

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.geometry import se3 as SE3
from tanteo.geometry import so3 as SO3
from tanteo.geometry.location import compose_locations, invert_location, loc_to_matrix, sines_cosines
from tanteo.geometry.typing import Adjoints, Covariances, FloatArray, LocationVectors

_GIMBAL_LOCK = 1e-8


def E_r(x: LocationVectors) -> FloatArray:
    """Return ``E_r`` ``(*batch, 3, 3)`` with ``w_body = E_r d(psi, theta, phi)/dt``; singular at ``theta = +-pi/2``.

    Args:
        x: location vectors ``(*batch, 6)``.
    """
    (s_psi, s_theta, _), (c_psi, c_theta, _) = sines_cosines(x)
    E = np.zeros((*s_psi.shape, 3, 3))
    E[..., 0, 0], E[..., 0, 2] = 1.0, -s_theta
    E[..., 1, 1], E[..., 1, 2] = c_psi, s_psi * c_theta
    E[..., 2, 1], E[..., 2, 2] = -s_psi, c_psi * c_theta
    return E


def K_r(x: LocationVectors) -> FloatArray:
    """Return the inverse of :func:`E_r` ``(*batch, 3, 3)``: ``d(psi, theta, phi)/dt = K_r w_body``.

    Args:
        x: location vectors ``(*batch, 6)``.

    Raises:
        DegenerateError: ``x`` is in gimbal lock, ``|cos(theta)| < 1e-8``.
    """
    (s_psi, s_theta, _), (c_psi, c_theta, _) = sines_cosines(x)
    if np.any(np.abs(c_theta) < _GIMBAL_LOCK):
        raise DegenerateError(
            "theta: expected a location vector away from +-pi/2, got one in gimbal lock, where the rates of psi and"
            " phi do not exist. Keep the body covariance, or choose other axes."
        )
    K = np.zeros((*s_psi.shape, 3, 3))
    t_theta = s_theta / c_theta
    K[..., 0, 0], K[..., 0, 1], K[..., 0, 2] = 1.0, s_psi * t_theta, c_psi * t_theta
    K[..., 1, 1], K[..., 1, 2] = c_psi, -s_psi
    K[..., 2, 1], K[..., 2, 2] = s_psi / c_theta, c_psi / c_theta
    return K


def _blocks(vv: FloatArray, vw: FloatArray | float, ww: FloatArray) -> Adjoints:
    """Return block upper triangular matrices."""
    J = np.zeros((*np.broadcast_shapes(vv.shape[:-2], ww.shape[:-2]), 6, 6))
    J[..., :3, :3], J[..., :3, 3:], J[..., 3:, 3:] = vv, vw, ww
    return J


def compose_jacobians(x1: LocationVectors, x2: LocationVectors) -> tuple[Adjoints, Adjoints]:
    """Return ``J1`` and ``J2`` ``(*batch, 6, 6)``, the derivatives of ``x1 (+) x2`` by ``x1`` and by ``x2``.

    Args:
        x1: location vectors ``(*batch, 6)``.
        x2: location vectors ``(*batch, 6)``.

    Raises:
        DegenerateError: the composition is in gimbal lock.
    """
    x1, x2 = np.broadcast_arrays(np.asarray(x1, dtype=np.float64), np.asarray(x2, dtype=np.float64))
    R1 = SE3.rotation(loc_to_matrix(x1))
    R2 = SE3.rotation(loc_to_matrix(x2))
    E1 = E_r(x1)
    K3 = K_r(compose_locations(x1, x2))
    identity = np.broadcast_to(np.eye(3), R1.shape)
    J1 = _blocks(identity, -R1 @ SO3.hat(x2[..., :3]) @ E1, K3 @ SO3.inverse(R2) @ E1)
    return J1, _blocks(R1, 0.0, K3 @ E_r(x2))


def J2_at_zero(x: LocationVectors) -> Adjoints:
    """Return ``J2{x, 0} = diag(R, K_r)``, mapping a body error of ``x`` to an error of its six numbers (paper, (28)).

    Args:
        x: location vectors ``(*batch, 6)``.

    Raises:
        DegenerateError: ``x`` is in gimbal lock.
    """
    return _blocks(SE3.rotation(loc_to_matrix(x)), 0.0, K_r(x))


def J2_at_zero_inverse(x: LocationVectors) -> Adjoints:
    """Return ``J2^-1{x, 0} = diag(R', E_r)``, which maps an error of the six numbers to a body error.

    Args:
        x: location vectors ``(*batch, 6)``.
    """
    return _blocks(SO3.inverse(SE3.rotation(loc_to_matrix(x))), 0.0, E_r(x))


def J1_at_zero(x: LocationVectors) -> Adjoints:
    """Return ``J1{0, x} = J2{x, 0} FJW``, mapping an error in the reference frame to one of the six numbers of ``x``.

    Args:
        x: location vectors ``(*batch, 6)``.

    Raises:
        DegenerateError: ``x`` is in gimbal lock.
    """
    return J2_at_zero(x) @ differential_jacobian_inverse(x)


def J_ominus(x: LocationVectors) -> Adjoints:
    """Return the derivative of ``(-) x`` by ``x`` ``(*batch, 6, 6)``.

    Args:
        x: location vectors ``(*batch, 6)``.

    Raises:
        DegenerateError: ``(-) x`` is in gimbal lock.
    """
    T = loc_to_matrix(x)
    inverse = invert_location(x)
    R = SE3.rotation(T)
    E = E_r(x)
    return _blocks(-SO3.inverse(R), SO3.hat(inverse[..., :3]) @ E, -K_r(inverse) @ R @ E)


def differential_jacobian(x: LocationVectors) -> Adjoints:
    """Return ``WJF = Ad(T)`` of ``x = WxF``, which maps an error of frame F to frame W: ``e_W = WJF e_F``.

    Args:
        x: location vectors ``(*batch, 6)``.
    """
    return SE3.adjoint(loc_to_matrix(x))


def differential_jacobian_inverse(x: LocationVectors) -> Adjoints:
    """Return ``FJW = Ad(T^-1)`` of ``x = WxF``, which maps an error of frame W to frame F (paper, (2)).

    Args:
        x: location vectors ``(*batch, 6)``.
    """
    return SE3.adjoint_inverse(loc_to_matrix(x))


def location_covariance(x: LocationVectors, C: Covariances) -> Covariances:
    """Return the covariance of the six numbers of ``x`` from its body covariance (paper, (27)-(28)).

    With these angles it is also the covariance of fixed-axis roll, pitch, yaw.

    Args:
        x: location vectors ``(*batch, 6)``.
        C: body covariances ``(*batch, 6, 6)``.

    Raises:
        DegenerateError: ``x`` is in gimbal lock, where the covariance does not exist.
    """
    J = J2_at_zero(x)
    return J @ C @ np.swapaxes(J, -1, -2)


def body_covariance(x: LocationVectors, C_location: Covariances) -> Covariances:
    """Return the body covariance from that of the six numbers of ``x``, the inverse of :func:`location_covariance`.

    Args:
        x: location vectors ``(*batch, 6)``.
        C_location: covariances of the six numbers ``(*batch, 6, 6)``.
    """
    J = J2_at_zero_inverse(x)
    return J @ C_location @ np.swapaxes(J, -1, -2)
