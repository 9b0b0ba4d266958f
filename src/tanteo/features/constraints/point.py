"""Compute distances of vertices to a vertex (13), to a plane, and to an edge; ``math.md`` sections 4.3 and 12."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.relation import PairGroup, PairRelation, register_relation
from tanteo.features.constraints.relative import X_AXIS, ScalarEstimate, relative, scalar_estimate
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class DistanceEstimate:
    """Distance of two points.

    Attributes:
        value: distances ``(*batch,)`` [m].
        variance: first-order variances ``(*batch,)`` [m^2].
        bias: second-order mean errors ``E[value] - truth`` ``(*batch,)`` [m]; below 5 sigma test the vector instead.
    """

    value: FloatArray
    variance: FloatArray
    bias: FloatArray


def point_distance(p1: Vectors, p2: Vectors, S: Covariances) -> DistanceEstimate:
    """Return ``|p2 - p1|`` (13) with variance and bias [m].

    Args:
        p1: points ``(*batch, 3)`` [m].
        p2: points ``(*batch, 3)`` [m].
        S: covariances of the difference ``(*batch, 3, 3)`` [m^2].

    Raises:
        DegenerateError: the points coincide; test the difference itself (3 degrees of freedom) then.
    """
    v = np.asarray(p2, dtype=np.float64) - p1
    value = np.sqrt(np.sum(v * v, axis=-1))
    if np.any(value == 0):
        raise DegenerateError(
            "distance of points: expected two points, got coincident ones. Test their difference (3 dof) instead."
        )
    u = v / value[..., None]
    variance = np.sum(u * (S @ u[..., None])[..., 0], axis=-1)
    return DistanceEstimate(value, variance, (np.trace(S, axis1=-2, axis2=-1) - variance) / (2 * value))


def point_plane_distance(
    T_plane: Transforms, C_plane: Covariances, T_point: Transforms, C_point: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Return the signed height of a vertex over a plane, positive outside [m]; unbiased to second order at the foot.

    Args:
        T_plane: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C_plane: body covariances of the plane ``(*batch, 6, 6)``.
        T_point: frames ``T_world_point``.
        C_point: body covariances of the point.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.
    """
    pair = relative(T_plane, T_point)
    q = np.broadcast_to(np.array([0.0, 0.0, 1.0]), pair.p.shape)
    return scalar_estimate(pair, X_AXIS, pair.p[..., 2], (q, None), (C_plane, C_point, C12))


def point_edge_distance(
    T_edge: Transforms, C_edge: Covariances, T_point: Transforms, C_point: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Return the distance of a vertex from the line of an edge [m].

    Args:
        T_edge: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C_edge: body covariances of the edge ``(*batch, 6, 6)``.
        T_point: frames ``T_world_point``.
        C_point: body covariances of the point.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: the vertex is exactly on the line.
    """
    pair = relative(T_edge, T_point)
    q = pair.p * np.array([0.0, 1.0, 1.0])
    d = np.sqrt(np.sum(q * q, axis=-1))
    if np.any(d == 0):
        raise DegenerateError(
            "distance of a point from an edge: expected a point off the line, got one on it. "
            "Test its two offsets (2 dof) instead."
        )
    return scalar_estimate(pair, X_AXIS, d, (q / d[..., None], None), (C_edge, C_point, C12))


def length_of(v: FloatArray, S: Covariances) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return lengths of vectors, their variances, and the summed variance across them, each ``(N,)``.

    Args:
        v: vectors ``(N, k)``.
        S: covariances ``(N, k, k)``.
    """
    d = np.sqrt((v * v).sum(axis=1))
    u = v / np.where(d > 0, d, 1.0)[:, None]
    variance = (u[:, None] @ S @ u[..., None])[:, 0, 0]
    return d, variance, np.maximum(S.trace(axis1=1, axis2=2) - variance, 0.0)


POINT_PLANE_HEIGHT = ConstraintKind("point_plane_height", ("m",), "height of a vertex over a plane, signed")
POINT_EDGE_DISTANCE = ConstraintKind("point_edge_distance", ("m",), "distance of a vertex from an edge")
POINT_DISTANCE = ConstraintKind("point_distance", ("m",), "distance of two vertices")


def fill_height(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Fill the row height, see :class:`PairRelation`.

    Args:
        p: origins of the second features in the first frames ``(n, 3)`` [m].
        n: axes of the second features in the first frames ``(n, 3)``.
        value: values ``(n, rows)``; written.
        q: derivatives by ``p`` ``(n, rows, 3)``; written.
        r: derivatives by the axis ``(n, rows, 3)``; written.
    """
    value[:, 0] = p[:, 2]
    q[:, 0, 2] = 1.0


def _cut_plane_point(group: PairGroup) -> list[ConstraintColumn]:
    return [group.column(POINT_PLANE_HEIGHT, group.value, group.S)]


def fill_line_offsets(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Fill the rows with the two offsets from a line, see :class:`PairRelation`.

    Args:
        p: origins of the second features in the first frames ``(n, 3)`` [m].
        n: axes of the second features in the first frames ``(n, 3)``.
        value: values ``(n, rows)``; written.
        q: derivatives by ``p`` ``(n, rows, 3)``; written.
        r: derivatives by the axis ``(n, rows, 3)``; written.
    """
    value[:] = p[:, 1:]
    q[:, 0, 1] = q[:, 1, 2] = 1.0


def fill_offsets(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Fill the rows with the three offsets from a point, see :class:`PairRelation`.

    Args:
        p: origins of the second features in the first frames ``(n, 3)`` [m].
        n: axes of the second features in the first frames ``(n, 3)``.
        value: values ``(n, rows)``; written.
        q: derivatives by ``p`` ``(n, rows, 3)``; written.
        r: derivatives by the axis ``(n, rows, 3)``; written.
    """
    value[:] = p
    q[:, 0, 0] = q[:, 1, 1] = q[:, 2, 2] = 1.0


def cut_distance(kind: ConstraintKind, sigmas: float, group: PairGroup) -> list[ConstraintColumn]:
    """Return the length of a group's offsets, present where it exceeds zero by several standard deviations.

    Args:
        kind: kind of the distance.
        sigmas: smallest ratio of the length to its transverse standard deviation.
        group: pairs with their offsets.
    """
    value, variance, across = length_of(group.value, group.S)
    clear = value > sigmas * np.sqrt(across / (group.value.shape[1] - 1))
    reason = f"the distance is below {sigmas:g} sigma, where it is not normal: the features touch, as far as is known."
    bias = across / (2 * np.where(clear, value, 1.0))
    return [group.column(kind, value[:, None], variance[:, None, None], clear, reason, bias=bias[:, None])]


def _cut_line_point(group: PairGroup) -> list[ConstraintColumn]:
    return cut_distance(POINT_EDGE_DISTANCE, 3.0, group)


def _cut_points(group: PairGroup) -> list[ConstraintColumn]:
    return cut_distance(POINT_DISTANCE, 5.0, group)


register_relation(PairRelation((POINT_PLANE_HEIGHT,), ("plane", "point"), 1, fill_height, _cut_plane_point))
register_relation(PairRelation((POINT_EDGE_DISTANCE,), ("line", "point"), 2, fill_line_offsets, _cut_line_point))
register_relation(PairRelation((POINT_DISTANCE,), ("point", "point"), 3, fill_offsets, _cut_points))
