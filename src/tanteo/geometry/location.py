"""Convert location vectors ``(px, py, pz, psi, theta, phi)`` with ``R = Rz(phi) Ry(theta) Rx(psi)`` [m, rad].

They serve input and output (teach pendants, formulas of the paper); computations use matrices. Source: Montano and
Sagues 1991, Appendix 1; ``math.md`` section 0.
"""

from __future__ import annotations

import numpy as np

from tanteo.geometry import se3 as SE3
from tanteo.geometry.typing import FloatArray, LocationVectors, Transforms

_GIMBAL_LOCK = 1e-14
"""Value of ``cos(theta)`` below which the first axis is parallel to z within rounding and phi is undetermined."""


def sines_cosines(x: LocationVectors) -> tuple[FloatArray, FloatArray]:
    """Return sines and cosines of ``(psi, theta, phi)``, each ``(3, *batch)``.

    Args:
        x: location vectors ``(*batch, 6)``.
    """
    angles = np.moveaxis(np.asarray(x, dtype=np.float64)[..., 3:], -1, 0)
    return np.sin(angles), np.cos(angles)


def loc_to_matrix(x: LocationVectors) -> Transforms:
    """Return homogeneous matrices ``(*batch, 4, 4)`` of location vectors (paper, Appendix 1).

    Args:
        x: location vectors ``(*batch, 6)`` [m, rad].
    """
    x = np.asarray(x, dtype=np.float64)
    (s_psi, s_theta, s_phi), (c_psi, c_theta, c_phi) = sines_cosines(x)
    rows = [
        [c_phi * c_theta, c_phi * s_theta * s_psi - s_phi * c_psi, c_phi * s_theta * c_psi + s_phi * s_psi],
        [s_phi * c_theta, s_phi * s_theta * s_psi + c_phi * c_psi, s_phi * s_theta * c_psi - c_phi * s_psi],
        [-s_theta, c_theta * s_psi, c_theta * c_psi],
    ]
    return SE3.from_parts(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2), x[..., :3])


def matrix_to_loc(T: Transforms) -> LocationVectors:
    """Return location vectors ``(*batch, 6)`` of homogeneous matrices, with ``theta`` in ``[-pi/2, pi/2]``.

    ``theta`` comes from ``atan2``, because ``asin`` loses half the digits near a right angle; ``psi`` comes from the
    matrix rotated back by ``phi``. So :func:`loc_to_matrix` restores the matrix to rounding everywhere. In gimbal lock
    (``theta = +-pi/2``) only ``phi -+ psi`` is defined, and ``phi`` is set to 0.

    Args:
        T: homogeneous matrices ``(*batch, 4, 4)`` [m].
    """
    T = np.asarray(T, dtype=np.float64)
    n, o, a = np.moveaxis(T[..., :3, :3], (-1, -2), (0, 1))
    c_theta = np.hypot(n[0], n[1])
    phi = np.where(c_theta > _GIMBAL_LOCK, np.arctan2(n[1], n[0]), 0.0)
    s = np.sin(phi)
    c = np.cos(phi)
    psi = np.arctan2(s * a[0] - c * a[1], c * o[1] - s * o[0])
    angles = np.stack([psi, np.arctan2(-n[2], c_theta), phi], axis=-1)
    return np.concatenate([T[..., :3, 3], angles], axis=-1)


def compose_locations(x1: LocationVectors, x2: LocationVectors) -> LocationVectors:
    """Return ``x1 (+) x2``, the location of ``T1 T2``; batches broadcast.

    Args:
        x1: location vectors ``(*batch, 6)``.
        x2: location vectors ``(*batch, 6)``.
    """
    return matrix_to_loc(loc_to_matrix(x1) @ loc_to_matrix(x2))


def invert_location(x: LocationVectors) -> LocationVectors:
    """Return ``(-) x``, the location of ``T^-1``.

    Args:
        x: location vectors ``(*batch, 6)``.
    """
    return matrix_to_loc(SE3.inverse(loc_to_matrix(x)))


def relate_locations(x1: LocationVectors, x2: LocationVectors) -> LocationVectors:
    """Return ``(-) x1 (+) x2``, the location of frame 2 in frame 1; batches broadcast.

    Args:
        x1: locations of frame 1 ``(*batch, 6)``.
        x2: locations of frame 2 ``(*batch, 6)``.
    """
    return matrix_to_loc(SE3.inverse(loc_to_matrix(x1)) @ loc_to_matrix(x2))
