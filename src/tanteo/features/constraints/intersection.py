"""Compute the intersection of two edges, their angle and their gap: (6)-(12), ``math.md`` sections 4.1 and 4.2.

(8) and (9) each keep one of two redundant equations. (9) is singular when the z axis of the first edge is normal to the
common plane, which is the case that the paper's coplanarity test accepts. The foot of the common perpendicular equals
the intersection if the lines meet, and has a finite variance for every frame.
"""

from __future__ import annotations

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features.constraints.angle import NEARLY_PARALLEL, angle_bias_of, angle_partials
from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.relation import RESOLUTION, PairGroup, PairRelation, register_relation
from tanteo.features.constraints.relative import X_AXIS, ScalarEstimate, relative, scalar_estimate
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors


def abscissa_partials(p: Vectors, n: Vectors) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the abscissa of the common perpendicular's foot on the second line, with partials over ``p`` and ``n``.

    ``s = -(n_perp . p_perp) / |n_perp|^2``: (7) with both equations in least squares.

    Args:
        p: origin of the second line in the first frame ``(*batch, 3)`` [m].
        n: direction of the second line in the first frame ``(*batch, 3)``.
    """
    np_ = n * _PERP
    pp = p * _PERP
    nn = np.maximum(np.sum(np_ * np_, axis=-1), np.finfo(float).tiny)[..., None]
    s = -np.sum(np_ * pp, axis=-1, keepdims=True) / nn
    return s[..., 0], -np_ / nn, -(pp + 2 * s * np_) / nn


def gap_partials(p: Vectors, n: Vectors) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the signed length of the common perpendicular along ``u1 x u2``, with its partials over ``p`` and ``n``.

    Args:
        p: origin of the second line in the first frame ``(*batch, 3)`` [m].
        n: direction of the second line in the first frame ``(*batch, 3)``.
    """
    nn = np.maximum((n[..., 1] ** 2 + n[..., 2] ** 2), np.finfo(float).tiny)[..., None]
    sine = np.sqrt(nn)
    w = n[..., _SWAP] * _TURN / sine  # (0, -n_z, n_y) / sine
    h = (w * p).sum(axis=-1, keepdims=True)
    return h[..., 0], w, -p[..., _SWAP] * _TURN / sine - h * n * _PERP / nn


_PERP = np.array([0.0, 1.0, 1.0])
_SWAP = np.array([0, 2, 1])
_TURN = np.array([0.0, -1.0, 1.0])


def _refuse_parallel(n: Vectors, what: str) -> None:
    if np.any((n[..., 1] == 0) & (n[..., 2] == 0)):
        raise DegenerateError(
            f"{what}: expected lines that are not parallel, got a parallel pair. Use the distance of parallel edges."
        )


def intersect(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Return the abscissa on the second edge of the point nearest to the first edge [m], replacing (9) and (12).

    It is measured from the second edge's origin. Exchange the features for the abscissa on the first edge.

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: the lines are exactly parallel. The result is reliable for ``sin(alpha) > 10 sigma_alpha``.
    """
    pair = relative(T1, T2)
    n = pair.R[..., :, 0]
    _refuse_parallel(n, "edge intersection")
    s, q, r = abscissa_partials(pair.p, n)
    return scalar_estimate(pair, X_AXIS, s, (q, r), (C1, C2, C12))


def gap_edges(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Return the signed distance of two skew lines along ``u1 x u2`` [m], which is zero for coplanar edges.

    It tests coplanarity without a sensed plane: ``value^2 / variance`` is chi-square with one degree of freedom.

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: the lines are exactly parallel, which are always coplanar.
    """
    pair = relative(T1, T2)
    n = pair.R[..., :, 0]
    _refuse_parallel(n, "gap of edges")
    h, q, r = gap_partials(pair.p, n)
    return scalar_estimate(pair, X_AXIS, h, (q, r), (C1, C2, C12))


EDGE_ANGLE = ConstraintKind("edge_angle", ("rad",), "angle of two edges, both pointing away from their corner")
EDGE_GAP = ConstraintKind("edge_gap", ("m",), "distance by which two edges miss each other, signed", null=True)

_NO_CORNER = "the lines are parallel within 10 sigma, so they have no common perpendicular of their own."


def fill_crossing(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Fill the rows angle and gap, see :class:`PairRelation`.

    Args:
        p: origins of the second features in the first frames ``(n, 3)`` [m].
        n: axes of the second features in the first frames ``(n, 3)``.
        value: values ``(n, rows)``; written.
        q: derivatives by ``p`` ``(n, rows, 3)``; written.
        r: derivatives by the axis ``(n, rows, 3)``; written.
    """
    value[:, 0], _, r[:, 0] = angle_partials(n, X_AXIS)
    value[:, 1], q[:, 1], r[:, 1] = gap_partials(p, n)


def _cut(group: PairGroup) -> list[ConstraintColumn]:
    value = group.value
    S = group.S
    sd = np.sqrt(group.S[:, 0, 0])
    sine = np.sqrt(group.b[:, 1] ** 2 + group.b[:, 2] ** 2)
    angle, unsure = _away(group, np.sqrt(S[:, 1, 1]) + 1e-12, np.where(sine > 0, sine, 1.0))
    return [
        group.column(
            EDGE_ANGLE,
            angle,
            S[:, :1, :1],
            sine > 5 * sd + RESOLUTION,
            NEARLY_PARALLEL,
            (unsure, "the corner lies among the sensed points of an edge: the angle may be its supplement."),
            bias=lambda: np.where(angle != value[:, :1], -1.0, 1.0) * angle_bias_of(group, X_AXIS),
        ),
        group.column(EDGE_GAP, value[:, 1:], S[:, 1:, 1:], sine > 10 * sd + RESOLUTION, _NO_CORNER),
    ]


def _away(group: PairGroup, sd: FloatArray, sine: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the angle with both directions pointing away from the corner, and where a direction is undetermined."""
    p = group.pair.p
    n = group.b
    slide = group.pair.slide[:, 0]
    s2 = -(p[:, 1] * n[:, 1] + p[:, 2] * n[:, 2]) / (sine * sine)  # abscissae of the feet
    s = np.empty((len(p), 2))
    s[:, 0], s[:, 1] = p[:, 0] + s2 * n[:, 0], s2 + slide
    extent = group.arrays.extent[group.pairs]
    margin = (3 * sd / sine)[:, None]
    inside = (s >= extent[..., 0] - margin) & (s <= extent[..., 2] + margin)
    turned = (s > extent[..., 1]).sum(axis=1) == 1
    angle = group.value[:, 0]
    return np.where(turned, np.pi - angle, angle)[:, None], np.asarray(inside.any(axis=1))


register_relation(PairRelation((EDGE_ANGLE, EDGE_GAP), ("line", "line"), 2, fill_crossing, _cut))
