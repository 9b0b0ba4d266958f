"""Features from other features or from the fewest points, as in the paper; ``math.md`` section 8."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.features import Feature, relate_all
from tanteo.features.kinds import EDGE, PLANE
from tanteo.fitting.estimate import Estimate, SharedReadings, shared_terms
from tanteo.fitting.vertex import inherit
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


def intersect_planes(T1: Transforms, T2: Transforms, near: Vectors) -> tuple[Transforms, FloatArray, FloatArray]:
    """Return the line of intersection of two planes, x along ``n1 x n2``, origin at the foot of ``near``.

    Args:
        T1: ``T_world_plane`` ``(*batch, 4, 4)``.
        T2: ``T_world_plane`` of the second plane.
        near: point near the origin of the line ``(*batch, 3)`` in the world [m].

    Returns:
        ``T_world_edge`` and the gains ``(*batch, 4, 3)`` of both planes' perturbations on ``(y, z, wy, wz)``.

    Raises:
        DegenerateError: if a pair of planes is exactly parallel.
    """
    n1, n2 = T1[..., :3, 2], T2[..., :3, 2]
    d = np.cross(n1, n2)
    sine = np.linalg.norm(d, axis=-1)
    if np.any(sine == 0):
        raise DegenerateError("edge from planes: expected planes that meet, got parallel ones. Sense another plane.")
    u = d / sine[..., None]
    y = n1
    z = np.cross(u, y)
    R = np.stack([u, y, z], axis=-1)
    # lateral offsets of both planes from `near`, solved in the plane across the line
    h1 = np.sum(n1 * (T1[..., :3, 3] - near), axis=-1)
    h2 = np.sum(n2 * (T2[..., :3, 3] - near), axis=-1)
    n2z = np.sum(n2 * z, axis=-1)
    n2y = np.sum(n2 * y, axis=-1)
    point = near + y * h1[..., None] + z * ((h2 - n2y * h1) / n2z)[..., None]
    M = np.zeros((*sine.shape, 2, 2))
    M[..., 0, 0], M[..., 1, 0], M[..., 1, 1] = 1.0, n2y, n2z
    T = SE3.from_parts(R, point)
    return T, _plane_on_line(T1, T, M, 0), _plane_on_line(T2, T, M, 1)


def _plane_on_line(T_plane: Transforms, T_line: Transforms, M: FloatArray, k: int) -> FloatArray:
    """Return the derivatives ``(4, 3)`` of height and tilt of plane ``k`` at the origin of the line."""
    Rt = np.swapaxes(T_plane[..., :3, :3], -1, -2)
    q = (Rt @ (T_line[..., :3, 3] - T_plane[..., :3, 3])[..., None])[..., 0]
    u = (Rt @ T_line[..., :3, 0, None])[..., 0]
    one, zero = np.ones_like(q[..., 0]), np.zeros_like(q[..., 0])
    displacement = np.stack([one, q[..., 1], -q[..., 0]], axis=-1)
    tilt = np.stack([zero, u[..., 1], -u[..., 0]], axis=-1)
    column = np.linalg.inv(M)[..., k]
    moved, turned = column[..., None] * displacement[..., None, :], column[..., None] * tilt[..., None, :]
    # the line rises by wz along y and by -wy along z
    return np.stack([moved[..., 0, :], moved[..., 1, :], -turned[..., 1, :], turned[..., 0, :]], axis=-2)


def edge_from_planes(a: Feature, b: Feature, near: Vectors | None = None, label: str = "") -> Feature:
    """Return the edge of two sensed planes, which is usually more accurate than one from edge events.

    Args:
        a: a plane.
        b: another plane.
        near: point near the origin of the edge [m]; by default halfway between the planes' origins.
        label: name of the edge.

    Raises:
        InputError: if one is no plane.
        DegenerateError: if the planes are parallel within ten standard deviations.
    """
    if a.kind.name != "plane" or b.kind.name != "plane":
        raise InputError(f"edge from planes: expected two planes, got {a.kind.name} and {b.kind.name}.")
    angle = relate_all((a, b)).column("plane_angle")
    if np.sin(angle.value[0, 0]) <= 10 * np.sqrt(angle.covariance[0, 0, 0]):
        raise DegenerateError(
            f"edge from planes: expected planes that meet, got {a.label!r} and {b.label!r}, parallel within 10 sigma. "
            "Sense another plane, or points of the edge itself."
        )
    T1, T2 = a.T_world_feature, b.T_world_feature
    near = 0.5 * (T1[:3, 3] + T2[:3, 3]) if near is None else np.asarray(near, dtype=np.float64)
    T, K1, K2 = intersect_planes(T1, T2, near)
    P = K1 @ a.P @ K1.T + K2 @ b.P @ K2.T
    rows = SE3.adjoint_inverse(T)[list(EDGE.rows)]
    return Feature(EDGE, T, P, label, inherit((a, b), (K1, K2), rows), readings=(*a.readings, *b.readings))


def plane_from_two_directions(
    q1: Vectors,
    q2: Vectors,
    q3: Vectors,
    q4: Vectors,
    C: Covariances,
    *,
    outward: Vectors,
    label: str = "",
    readings: Sequence[str] = (),
    shared: SharedReadings = (),
) -> Feature:
    """Return the paper's plane (section 3): normal along ``(q2 - q1) x (q4 - q3)``, origin at ``q1``.

    :func:`tanteo.fitting.fit_plane` on the same points is two to four times better (``math.md`` section 8).

    Args:
        q1: start of the first scan direction ``(3,)`` [m]; ``q3`` may be the same point.
        q2: end of the first scan direction ``(3,)`` [m].
        q3: start of the second scan direction ``(3,)`` [m].
        q4: end of the second scan direction ``(3,)`` [m].
        C: joint covariance of the four points ``(12, 12)``.
        outward: a vector out of the material.
        label: name of the plane.
        readings: ids of the four readings.
        shared: errors in common, Jacobians ``(4, 3, d)``.

    Raises:
        DegenerateError: if the two directions are parallel.
    """
    q = np.stack([np.asarray(x, dtype=np.float64) for x in (q1, q2, q3, q4)])
    d1, d2 = q[1] - q[0], q[3] - q[2]
    m = np.cross(d1, d2)
    length = np.linalg.norm(m)
    if length <= 1e-9 * np.linalg.norm(d1) * np.linalg.norm(d2):
        raise DegenerateError("plane: expected two directions that are not parallel, got parallel ones. Sense across.")
    sign = 1.0 if m @ np.asarray(outward) > 0 else -1.0
    n = sign * m / length
    R = SO3.frame_from_axis(n, 2)
    across = sign * (np.eye(3) - np.outer(n, n)) / length
    turn1, turn2 = across @ SO3.hat(d1), across @ SO3.hat(d2)
    dn = np.concatenate([turn2, -turn2, -turn1, turn1], axis=1)
    J = np.zeros((3, 12))
    J[0, :3], J[1], J[2] = n, -R[:, 1] @ dn, R[:, 0] @ dn
    T = SE3.from_parts(R, q[0])
    return _from_points(T, q, J, C, (PLANE.name, label, tuple(readings)), shared)


def edge_from_two_points(
    q1: Vectors,
    q2: Vectors,
    C: Covariances,
    *,
    label: str = "",
    readings: Sequence[str] = (),
    shared: SharedReadings = (),
) -> Feature:
    """Return the edge through two points, origin at ``q1``, x towards ``q2`` (paper section 3).

    Args:
        q1: first point ``(3,)`` [m].
        q2: second point ``(3,)`` [m].
        C: their joint covariance ``(6, 6)``.
        label: name of the edge.
        readings: ids of the two readings.
        shared: errors in common, Jacobians ``(2, 3, d)``.

    Raises:
        DegenerateError: if the points coincide.
    """
    q = np.stack([np.asarray(x, dtype=np.float64) for x in (q1, q2)])
    length = np.linalg.norm(q[1] - q[0])
    if length <= 1e-12 * np.abs(q).max():
        raise DegenerateError(
            "edge: expected two points apart, got the same point twice. Sense another along the edge."
        )
    R = SO3.frame_from_axis((q[1] - q[0]) / length, 0)
    J = np.zeros((4, 6))
    J[0, :3], J[1, :3] = R[:, 1], R[:, 2]
    J[2, :3], J[2, 3:] = R[:, 2] / length, -R[:, 2] / length
    J[3, :3], J[3, 3:] = -R[:, 1] / length, R[:, 1] / length
    return _from_points(SE3.from_parts(R, q[0]), q, J, C, (EDGE.name, label, tuple(readings)), shared)


def _from_points(
    T: Transforms,
    q: Vectors,
    J: FloatArray,
    C: Covariances,
    names: tuple[str, str, tuple[str, ...]],
    shared: SharedReadings,
) -> Feature:
    """Return a feature with perturbations ``J`` times the errors of points ``q`` of joint covariance ``C``."""
    kind = {PLANE.name: PLANE, EDGE.name: EDGE}[names[0]]
    C = np.asarray(C, dtype=np.float64)
    if C.shape != (3 * len(q), 3 * len(q)):
        raise InputError(f"{names[0]}, C: expected shape {(3 * len(q), 3 * len(q))}, got {C.shape}.")
    P = J @ C @ J.T
    shared_jacobian = np.moveaxis(J.reshape(kind.size, len(q), 3), 1, 0)
    nothing = np.zeros(0)
    estimate = Estimate(T, P, nothing, 0, nothing, nothing, shared_jacobian)
    terms = shared_terms(q, estimate, SE3.adjoint_inverse(T)[list(kind.rows)], shared)
    return Feature(kind, T, 0.5 * (P + P.T), names[1], terms, q, names[2])
