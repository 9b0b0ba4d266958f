"""Compute angles between edges (16)-(18), between planes (19), and of an edge over a plane (``math.md`` section 4.4).

The paper's ``arccos`` has an unbounded slope at 0 and pi, and its ``F*`` divides by ``cos(theta)``. Here the angle is
``atan2(|u1 x u2|, u1 . u2)``, with the unit covector of the rotation as gradient.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.relation import RESOLUTION, PairGroup, PairRelation, register_relation
from tanteo.features.constraints.relative import X_AXIS, Z_AXIS, Relative, ScalarEstimate, relative, scalar_estimate
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors


def angle_partials(b: Vectors, axis: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the angle [0, pi] between a coordinate axis and unit ``b``, its sine, and ``d angle / d b``.

    Where the sine is zero the gradient does not exist; the returned one is finite but meaningless, and callers refuse
    it.

    Args:
        b: unit vectors ``(*batch, 3)``.
        axis: coordinate axis 0, 1 or 2.
    """
    along = b[..., axis]
    others = [k for k in range(3) if k != axis]
    sine = np.sqrt(b[..., others[0]] ** 2 + b[..., others[1]] ** 2)
    r = b * (along / np.where(sine > 0, sine, 1.0))[..., None]
    r[..., axis] = -sine
    return np.arctan2(sine, along), sine, r


def _angle(
    T1: Transforms, T2: Transforms, axis: int, covariances: tuple[Covariances, Covariances, FloatArray | None]
) -> ScalarEstimate:
    pair = relative(T1, T2)
    value, sine, r = angle_partials(pair.R[..., :, axis], axis)
    if np.any(sine == 0):
        raise DegenerateError(
            "angle: expected directions that are not parallel, got an angle of exactly 0 or pi, where its variance "
            "does not exist. Test parallelism (2 degrees of freedom) instead."
        )
    return scalar_estimate(pair, axis, value, (None, r), covariances)


def angle_edges(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Return the angle between the x axes of two edges, (16)-(18) [rad].

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m]. First orient the x axes away from the corner
            (:func:`away_from_corner`), because reversing an edge turns alpha into pi - alpha.
        C1: body covariances ``(*batch, 6, 6)``, zero in the free rows.
        T2: frames of the second edge ``(*batch, 4, 4)`` [m].
        C2: body covariances of the second edge ``(*batch, 6, 6)``.
        C12: ``E[e1 e2']`` ``(*batch, 6, 6)`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: a pair is exactly parallel. Below ``sin(alpha) = 5 sigma`` the angle is Rayleigh-like and its 5
            % gate rejects 14.6 % (``math.md`` section 12): use :func:`tanteo.features.parallel_edges` there.
    """
    return _angle(T1, T2, X_AXIS, (C1, C2, C12))


def angle_planes(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Return the angle between the outward normals of two planes, (19) [rad].

    The interior angle of a convex corner is ``pi - value``. Limits are those of :func:`angle_edges`.

    Arguments and limits as :func:`angle_edges`.

    Args:
        T1: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second plane.
        C2: body covariances of the second plane.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: a pair is exactly parallel.
    """
    return _angle(T1, T2, Z_AXIS, (C1, C2, C12))


def edge_plane_partials(n: Vectors) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the elevation of a direction over the plane z = 0, its cosine, and ``d elevation / d n``.

    Args:
        n: unit directions ``(*batch, 3)``.
    """
    cosine = np.sqrt(n[..., 0] ** 2 + n[..., 1] ** 2)
    r = np.zeros_like(n)
    r[..., 2] = 1.0 / np.where(cosine > 0, cosine, 1.0)
    return np.arctan2(n[..., 2], cosine), cosine, r


def angle_edge_plane(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Return the elevation of an edge (second) over a plane (first), positive towards the outward normal [rad].

    This constraint is an addition to the paper (``math.md`` section 4.4).

    Args:
        T1: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C1: body covariances of the plane ``(*batch, 6, 6)``.
        T2: frames ``T_world_edge``.
        C2: body covariances of the edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: the edge is exactly normal to the plane.
    """
    pair = relative(T1, T2)
    value, cosine, r = edge_plane_partials(pair.R[..., :, X_AXIS])
    if np.any(cosine == 0):
        raise DegenerateError(
            "edge over plane: expected an edge that is not normal to the plane, got one at exactly pi/2. "
            "Test the edge's direction against the normal (2 degrees of freedom) instead."
        )
    return scalar_estimate(pair, X_AXIS, value, (None, r), (C1, C2, C12))


def signed_angle(d1: Vectors, d2: Vectors, normal: Vectors) -> FloatArray:
    """Return the angle from ``d1`` to ``d2``, positive about ``normal``, in (-pi, pi] [rad].

    With the outward normal of the face it separates convex from concave corners, which (16) cannot.

    Args:
        d1: directions ``(*batch, 3)``.
        d2: directions ``(*batch, 3)``.
        normal: normals ``(*batch, 3)``.
    """
    turn = np.sum(normal * np.cross(d1, d2), axis=-1)
    return np.arctan2(turn, np.sum(d1 * d2, axis=-1))


def angle_bias(
    pair: Relative, axis: int, covariances: tuple[Covariances, Covariances, FloatArray | None]
) -> FloatArray:
    """Return the second-order mean error of the angle [rad]: ``(s1^2 + s2^2)/2 cot(alpha) - c12 / sin(alpha)``.

    ``s_i`` are the standard deviations of the tilts out of the common plane, and ``c12`` is their covariance
    (``math.md`` sections 4.4 and 12).

    Args:
        pair: relative geometry of the pairs.
        axis: coordinate axis of both features' directions.
        covariances: body covariances of both features, and their cross covariance or None.
    """
    b = pair.R[..., :, axis]
    e = np.eye(3)[axis]
    sine = np.linalg.norm(np.cross(e, b), axis=-1)
    w = np.cross(e, b) / np.where(sine > 0, sine, 1.0)[..., None]
    t1 = np.cross(e, w)
    t2 = np.cross(e, (w[..., None, :] @ pair.R)[..., 0, :])
    C1, C2, C12 = covariances
    both = _quadratic(t1, C1, t1) + _quadratic(t2, C2, t2)
    common = 0.0 if C12 is None else _quadratic(t1, C12, t2)
    safe = np.where(sine > 0, sine, np.inf)
    return 0.5 * both * b[..., axis] / safe - common / safe


def _quadratic(a: FloatArray, C: Covariances, b: FloatArray) -> FloatArray:
    return np.sum(a * (C[..., 3:, 3:] @ b[..., None])[..., 0], axis=-1)


def away_from_corner(direction: Vectors, centroid: Vectors, corner: Vectors) -> BoolArray:
    """Return whether ``direction`` points from the corner to the sensed points of its edge.

    Reverse it where it does not.

    Section 4.2 of the paper requires "both going away the intersection".

    Args:
        direction: directions of the edges, world frame ``(*batch, 3)``.
        centroid: centroids of their sensed points ``(*batch, 3)`` [m].
        corner: corners ``(*batch, 3)`` [m].
    """
    return np.sum(direction * (centroid - corner), axis=-1) >= 0


NEARLY_PARALLEL = "the directions are parallel within 5 sigma, where the angle has no valid variance: see parallelism."


def valid_angles(group: PairGroup, row: int) -> BoolArray:
    """Return the mask of pairs whose angle is a valid linear quantity.

    ``sin(alpha) > 5 sigma`` (``math.md`` section 12).

    Args:
        group: pairs with their values.
        row: row of the angle.
    """
    return np.sin(group.value[:, row]) > 5 * np.sqrt(group.S[:, row, row]) + RESOLUTION


def angle_bias_of(group: PairGroup, axis: int) -> FloatArray:
    """Return the bias of the angles of a group ``(n, 1)`` including shared errors, see :func:`angle_bias`.

    Args:
        group: pairs with their values.
        axis: coordinate axis of both features' directions.
    """
    arrays, (first, second) = group.arrays, group.pairs.T
    C12 = None
    C1 = arrays.C[first]
    C2 = arrays.C[second]
    if arrays.shared_jacobian is not None:
        A1 = arrays.shared_jacobian[first]
        A2 = arrays.shared_jacobian[second]
        A1t = A1.swapaxes(1, 2)
        A2t = A2.swapaxes(1, 2)
        C1 = C1 + A1 @ arrays.shared @ A1t
        C2 = C2 + A2 @ arrays.shared @ A2t
        C12 = A1 @ arrays.shared @ A2t
    return angle_bias(group.pair, axis, (C1, C2, C12))[:, None]


PLANE_ANGLE = ConstraintKind("plane_angle", ("rad",), "angle of two outward normals")


def _fill_planes(p: Vectors, a: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    value[:, 0], _, r[:, 0] = angle_partials(a, Z_AXIS)


def _cut_planes(group: PairGroup) -> list[ConstraintColumn]:
    bias = partial(angle_bias_of, group, Z_AXIS)
    return [group.column(PLANE_ANGLE, group.value, group.S, valid_angles(group, 0), NEARLY_PARALLEL, bias=bias)]


register_relation(PairRelation((PLANE_ANGLE,), ("plane", "plane"), 1, _fill_planes, _cut_planes))

EDGE_PLANE_ANGLE = ConstraintKind("edge_plane_angle", ("rad",), "rise of an undirected edge over a plane, 0 to pi/2")


def _fill_plane_line(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    value[:, 0], _, r[:, 0] = edge_plane_partials(n)


def _cut_plane_line(group: PairGroup) -> list[ConstraintColumn]:
    angle = np.abs(group.value)
    sd = np.sqrt(group.S[:, 0, 0])
    upright = np.cos(angle[:, 0]) > 5 * sd + RESOLUTION
    folded = angle[:, 0] < 2 * sd
    return [
        group.column(
            EDGE_PLANE_ANGLE,
            angle,
            group.S,
            upright,
            "the edge is normal to the plane within 5 sigma, where the angle has no valid variance.",
            (folded, "the angle is within 2 sigma of zero, where its sign is lost: test coplanarity instead."),
        )
    ]


register_relation(PairRelation((EDGE_PLANE_ANGLE,), ("plane", "line"), 1, _fill_plane_line, _cut_plane_line))
