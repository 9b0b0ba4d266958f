"""The paper's location vectors ``(px, py, pz, psi, theta, phi)`` with ``R = Rz(phi) Ry(theta) Rx(psi)`` [m, rad].

They are for the border (teach pendants, the paper's own formulas): inside, frames are matrices. Source: paper,
Appendix 1; ``math.md`` section 0.
"""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3
from tanteo.typing import FloatArray, LocationVectors, Transforms

_GIMBAL_LOCK = 1e-14
"""Below this ``cos(theta)`` the first axis points along z to rounding, and phi is a matter of choice."""


def sines_cosines(x: LocationVectors) -> tuple[FloatArray, FloatArray]:
    """Sines and cosines of ``(psi, theta, phi)``, angle axis first: ``(3, *batch)`` each."""
    angles = np.moveaxis(np.asarray(x, dtype=np.float64)[..., 3:], -1, 0)
    return np.sin(angles), np.cos(angles)


def loc_to_matrix(x: LocationVectors) -> Transforms:
    """Homogeneous matrices ``(*batch, 4, 4)`` of location vectors ``(*batch, 6)`` (paper, Appendix 1)."""
    x = np.asarray(x, dtype=np.float64)
    (s_psi, s_theta, s_phi), (c_psi, c_theta, c_phi) = sines_cosines(x)
    rows = [
        [c_phi * c_theta, c_phi * s_theta * s_psi - s_phi * c_psi, c_phi * s_theta * c_psi + s_phi * s_psi],
        [s_phi * c_theta, s_phi * s_theta * s_psi + c_phi * c_psi, s_phi * s_theta * c_psi - c_phi * s_psi],
        [-s_theta, c_theta * s_psi, c_theta * c_psi],
    ]
    return SE3.from_parts(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2), x[..., :3])


def matrix_to_loc(T: Transforms) -> LocationVectors:
    """Location vectors of homogeneous matrices, with ``theta`` in ``[-pi/2, pi/2]``.

    ``theta`` comes from ``atan2`` (``asin`` loses half the digits near a right angle), and ``psi`` from the matrix
    turned back by ``phi``, so that :func:`loc_to_matrix` returns the matrix to rounding everywhere. In gimbal lock
    (``theta = +-pi/2``) only ``phi -+ psi`` is defined: ``phi`` is set to 0.
    """
    T = np.asarray(T, dtype=np.float64)
    n, o, a = np.moveaxis(T[..., :3, :3], (-1, -2), (0, 1))
    c_theta = np.hypot(n[0], n[1])
    phi = np.where(c_theta > _GIMBAL_LOCK, np.arctan2(n[1], n[0]), 0.0)
    s, c = np.sin(phi), np.cos(phi)
    psi = np.arctan2(s * a[0] - c * a[1], c * o[1] - s * o[0])
    angles = np.stack([psi, np.arctan2(-n[2], c_theta), phi], axis=-1)
    return np.concatenate([T[..., :3, 3], angles], axis=-1)


def compose_locations(x1: LocationVectors, x2: LocationVectors) -> LocationVectors:
    """``x1 (+) x2``: the location of ``T1 T2``; batches broadcast."""
    return matrix_to_loc(loc_to_matrix(x1) @ loc_to_matrix(x2))


def invert_location(x: LocationVectors) -> LocationVectors:
    """``(-) x``: the location of ``T^-1``."""
    return matrix_to_loc(SE3.inverse(loc_to_matrix(x)))


def relate_locations(x1: LocationVectors, x2: LocationVectors) -> LocationVectors:
    """``(-) x1 (+) x2``: the location of frame 2 seen from frame 1; batches broadcast."""
    return matrix_to_loc(SE3.inverse(loc_to_matrix(x1)) @ loc_to_matrix(x2))
