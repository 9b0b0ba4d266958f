"""Compute the constraints of section 4 exactly as the paper prints them, for comparison and for ``--as-published``.

All formulas use the location vector ``x12`` and ``F* J2(+){x12, 0}``. The paper assumes independent features; an
optional ``C12 = E[e1 e2']`` enters as in :func:`tanteo.geometry.relate_arrays`, so that only the printed constraint
differs. ``docs/paper.md`` quantifies the errors of the printed formulas. They also fail where the print fails, such as
(9) for edges in the x-y plane of the first frame. One simplification is made: every ``F*`` has a factor ``cos(theta)``
where ``J2`` divides by it, and the two are cancelled by hand, because the printed form is undefined at theta = +-pi/2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.geometry import SE3, relate_arrays
from tanteo.geometry.location import loc_to_matrix, matrix_to_loc
from tanteo.geometry.typing import Covariances, FloatArray, LocationVectors, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class Published:
    """Printed value with its printed variance.

    Attributes:
        value: values ``(*batch,)`` [m, rad or a cosine].
        variance: variances ``(*batch,)``.
    """

    value: FloatArray
    variance: FloatArray


def _relate(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None
) -> tuple[LocationVectors, Covariances]:
    """Return ``x12`` and ``Cov(F2 e F1)``, (26)."""
    T12, S = relate_arrays(T1, C1, T2, C2, C12)
    return matrix_to_loc(T12), S


def _scalar(value: FloatArray, F: FloatArray, x: LocationVectors, S: Covariances) -> Published:
    """Return a value with variance ``F* J2{x12, 0} Cov(e12) J2' F*'``, as in (12), (15) and (17)."""
    g = _gradient(F, x)
    return Published(value, np.sum(g * (S @ g[..., None])[..., 0], axis=-1))


def _gradient(F: FloatArray, x: LocationVectors) -> FloatArray:
    """Return ``F* J2(+){x12, 0}``, ``J2 = diag(R, K)``, with ``cos(theta)`` times the rows psi and phi of ``K``."""
    s_psi = np.sin(x[..., 3])
    c_psi = np.cos(x[..., 3])
    s_theta = np.sin(x[..., 4])
    c_theta = np.cos(x[..., 4])
    psi = F[..., 3]
    theta = F[..., 4]
    phi = F[..., 5]
    g = np.empty_like(F)
    g[..., :3] = (F[..., None, :3] @ loc_to_matrix(x)[..., :3, :3])[..., 0, :]
    g[..., 3] = psi * c_theta
    g[..., 4] = psi * s_psi * s_theta + theta * c_psi + phi * s_psi
    g[..., 5] = psi * c_psi * s_theta - theta * s_psi + phi * c_psi
    return g


def _rows(like: FloatArray, **entries: FloatArray) -> FloatArray:
    """Return ``F*`` with the named entries of ``(px, py, pz, psi, theta, phi)``, the others zero.

    Entries psi and phi are given without their factor ``cos(theta)``.
    """
    F = np.zeros_like(like)
    for name, entry in entries.items():
        F[..., ("px", "py", "pz", "psi", "theta", "phi").index(name)] = entry
    return F


def coplanarity(
    T_plane: Transforms, C_plane: Covariances, T_edge: Transforms, C_edge: Covariances, C12: FloatArray | None = None
) -> tuple[FloatArray, Covariances]:
    """Return ``(p_z, theta)`` (5) with the third and fifth entries of ``Cov(Ee^S)``, correct only for psi = theta = 0.

    Args:
        T_plane: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C_plane: body covariances of the plane ``(*batch, 6, 6)``.
        T_edge: frames ``T_world_edge``.
        C_edge: body covariances of the edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.
    """
    x, S = _relate(T_plane, C_plane, T_edge, C_edge, C12)
    return x[..., [2, 4]], S[..., [2, 4], :][..., [2, 4]]


def abscissa_z(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> Published:
    """Return the intersection on the second edge by (9), ``p_z / sin(theta)``, with the variance of (12).

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: both edges lie in the x-y plane of the first frame.
    """
    x, S = _relate(T1, C1, T2, C2, C12)
    sine = np.sin(x[..., 4])
    cosine = np.cos(x[..., 4])
    if np.any(sine == 0):
        raise DegenerateError(
            "edge intersection as published: expected n_z other than 0 (equation 9), got 0: both edges lie in the "
            "x-y plane of the first. Turn that frame about its x axis, or use tanteo.features.intersect."
        )
    F = _rows(x, pz=1 / sine, theta=-x[..., 2] * cosine / sine**2)  # (11)
    return _scalar(x[..., 2] / sine, F, x, S)


def abscissa_y(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> Published:
    """Return the intersection on the second edge by the first form of (8), ``-p_y / (sin(phi) cos(theta))``.

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: both edges lie in the x-z plane of the first frame.
    """
    x, S = _relate(T1, C1, T2, C2, C12)
    n_y = np.sin(x[..., 5]) * np.cos(x[..., 4])
    if np.any(n_y == 0):
        raise DegenerateError(
            "edge intersection as published: expected n_y other than 0 (equation 8), got 0: both edges lie in the "
            "x-z plane of the first. Turn that frame about its x axis, or use tanteo.features.intersect."
        )
    d_theta = -np.sin(x[..., 5]) * np.sin(x[..., 4])
    d_phi = np.cos(x[..., 5])
    slope = x[..., 1] / n_y**2
    return _scalar(-x[..., 1] / n_y, _rows(x, py=-1 / n_y, theta=slope * d_theta, phi=slope * d_phi), x, S)


def edge_length(
    T_A: Transforms, C_A: Covariances, T_E: Transforms, C_E: Covariances, T_B: Transforms, C_B: Covariances
) -> Published:
    """Return the length (13) of ``E`` with (15), which adds the variances of both ends as if they were independent.

    Args:
        T_A: frames of one adjacent edge ``(*batch, 4, 4)`` [m].
        C_A: its body covariances ``(*batch, 6, 6)``.
        T_E: frames of the measured edge.
        C_E: its body covariances.
        T_B: frames of the other adjacent edge.
        C_B: its body covariances.
    """
    start = abscissa_z(T_A, C_A, T_E, C_E)
    end = abscissa_z(T_B, C_B, T_E, C_E)
    # P and P' lie on the x axis of E: F* of (13) is (+-1, 0, ..., 0) and selects the variance of each abscissa
    return Published(np.abs(end.value - start.value), start.variance + end.variance)


def edge_length_shared(
    T_A: Transforms, C_A: Covariances, T_E: Transforms, C_E: Covariances, T_B: Transforms, C_B: Covariances
) -> Published:
    """Return the length by (9) with the error of the common edge counted once, to isolate the error of (15).

    Args:
        T_A: frames of one adjacent edge ``(*batch, 4, 4)`` [m].
        C_A: its body covariances ``(*batch, 6, 6)``.
        T_E: frames of the measured edge.
        C_E: its body covariances.
        T_B: frames of the other adjacent edge.
        C_B: its body covariances.
    """
    start = abscissa_z(T_A, C_A, T_E, C_E)
    end = abscissa_z(T_B, C_B, T_E, C_E)
    g_a = _gradient_z(T_A, T_E)
    g_b = _gradient_z(T_B, T_E)
    common = np.sum(g_a * (C_E @ g_b[..., None])[..., 0], axis=-1)
    return Published(np.abs(end.value - start.value), start.variance + end.variance - 2 * common)


def _gradient_z(T1: Transforms, T2: Transforms) -> FloatArray:
    """Return ``F* J2`` of (11) over the error of the second edge."""
    x = matrix_to_loc(SE3.inverse(T1) @ T2)
    sine = np.sin(x[..., 4])
    cosine = np.cos(x[..., 4])
    F = _rows(x, pz=1 / sine, theta=-x[..., 2] * cosine / sine**2)
    return _gradient(F, x)


def angle_edges(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> Published:
    """Return ``arccos(cos(phi) cos(theta))`` (16), with (17) and (18).

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: the directions are parallel.
    """
    return _arccos(T1, C1, T2, C2, C12, "phi")


def angle_planes(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> Published:
    """Return ``arccos(cos(psi) cos(theta))`` (19), with (17) and (18).

    Args:
        T1: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second plane.
        C2: body covariances of the second plane.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: the normals are parallel.
    """
    return _arccos(T1, C1, T2, C2, C12, "psi")


def _arccos(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None, turn: str
) -> Published:
    x, S = _relate(T1, C1, T2, C2, C12)
    k = 5 if turn == "phi" else 3
    cosine = np.cos(x[..., k]) * np.cos(x[..., 4])
    delta = np.sqrt(1 - cosine**2)
    if np.any(delta == 0):
        raise DegenerateError("angle as published: expected directions that are not parallel, got Delta = 0 in (17).")
    F = _rows(
        x,
        theta=np.cos(x[..., k]) * np.sin(x[..., 4]) / delta,
        **{turn: np.sin(x[..., k]) / delta},
    )
    return _scalar(np.arccos(np.clip(cosine, -1, 1)), F, x, S)


def parallel_edges(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> tuple[Published, Published]:
    """Return the cosine of the parallelism condition (21) and the distance of section 4.4, both at the given origins.

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.
    """
    x, S = _relate(T1, C1, T2, C2, C12)
    d = np.hypot(x[..., 1], x[..., 2])
    safe = np.where(d > 0, d, np.nan)
    distance = _scalar(d, _rows(x, py=x[..., 1] / safe, pz=x[..., 2] / safe), x, S)
    return _cosine(x, S, "phi"), distance


def parallel_planes(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> tuple[Published, Published]:
    """Return the cosine of the parallelism condition (23) and ``|p_z|`` (24) with ``F* = (0, 0, 1, 0, 0, 0)``.

    Args:
        T1: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second plane.
        C2: body covariances of the second plane.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.
    """
    x, S = _relate(T1, C1, T2, C2, C12)
    distance = _scalar(np.abs(x[..., 2]), _rows(x, pz=np.ones_like(x[..., 2])), x, S)
    return _cosine(x, S, "psi"), distance


def _cosine(x: LocationVectors, S: Covariances, turn: str) -> Published:
    k = 5 if turn == "phi" else 3
    F = _rows(
        x,
        theta=-np.cos(x[..., k]) * np.sin(x[..., 4]),
        **{turn: -np.sin(x[..., k])},
    )
    return _scalar(np.cos(x[..., k]) * np.cos(x[..., 4]), F, x, S)
