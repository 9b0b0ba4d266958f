"""Compute constraints of parallel edges (20), (21) and parallel planes (22)-(24); ``math.md`` sections 4.5 and 4.6.

The paper tests the cosine at its maximum, where its first-order variance is zero: a nominal 5 % test rejects 0.05 % of
parallel pairs and misses large tilts. Here the two components of the second axis across the first are tested together
(2 degrees of freedom). The distance is conditioned on them, so it does not depend on the position of the origins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.point import length_of
from tanteo.features.constraints.relation import RESOLUTION, PairGroup, PairRelation, register_relation
from tanteo.features.constraints.relative import X_AXIS, Z_AXIS, Relative, VectorEstimate, relative, vector_estimate
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, Transforms, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class ParallelEstimate:
    """Parallelism and distance of pairs of edges or planes.

    Attributes:
        sign: +1 if the axes have the same sense, -1 if opposite ``(*batch,)``.
        joint: ``(v1, v2, d)``: tilt components [rad] and distance [m], with their 3 x 3 covariance.
        distance: distance ``d`` given that the pair is parallel ``(*batch,)`` [m].
        variance: variance of that conditional distance ``(*batch,)`` [m^2].
    """

    sign: FloatArray
    joint: VectorEstimate
    distance: FloatArray
    variance: FloatArray

    @property
    def tilt(self) -> FloatArray:
        """Tilts ``v`` ``(*batch, 2)`` [rad], zero for a parallel pair."""
        return self.joint.value[..., :2]

    @property
    def tilt_covariance(self) -> Covariances:
        """Covariance of the tilts ``(*batch, 2, 2)``; ``v' S^-1 v`` is chi-square with 2 degrees of freedom."""
        return self.joint.covariance[..., :2, :2]


def sign_of(x: FloatArray) -> FloatArray:
    """Return +1 or -1, never 0.

    Args:
        x: numbers ``(*batch,)``.
    """
    return np.where(x < 0, -1.0, 1.0)


def condition_on_parallel(v: FloatArray, d: FloatArray, S: Covariances) -> tuple[FloatArray, Covariances]:
    """Return mean and covariance of ``d`` given ``v = 0``, from their joint covariance with the two ``v`` first.

    Args:
        v: tilts ``(*batch, 2)``.
        d: distances ``(*batch, k)``.
        S: joint covariance ``(*batch, 2 + k, 2 + k)``; a singular tilt block (an exactly known feature) is ignored.
    """
    a = S[..., 0, 0]
    b = S[..., 0, 1]
    c = S[..., 1, 1]
    det = a * c - b * b
    usable = det > 1e-14 * a * c  # a singular block carries no information to condition on
    scale = 1 / np.where(usable, det, np.inf)
    inverse = np.empty((*det.shape, 2, 2))
    inverse[..., 0, 0], inverse[..., 1, 1] = c * scale, a * scale
    inverse[..., 0, 1] = inverse[..., 1, 0] = -b * scale
    K = S[..., 2:, :2] @ inverse
    conditioned = d - (K @ v[..., None])[..., 0]
    return conditioned, S[..., 2:, 2:] - K @ S[..., :2, 2:]


def _parallel(
    pair: Relative, axis: int, parts: tuple[FloatArray, FloatArray, tuple[Covariances, Covariances, FloatArray | None]]
) -> ParallelEstimate:
    d, q_d, covariances = parts
    across = [k for k in range(3) if k != axis]
    b = pair.R[..., :, axis]
    sign = sign_of(b[..., axis])
    value = np.stack([sign * b[..., across[0]], sign * b[..., across[1]], d], axis=-1)
    q = np.zeros((*value.shape, 3))
    r = np.zeros((*value.shape, 3))
    r[..., 0, across[0]] = r[..., 1, across[1]] = sign
    q[..., 2, :] = q_d
    joint = vector_estimate(pair, axis, value, (q, r), covariances)
    distance, variance = condition_on_parallel(value[..., :2], value[..., 2:], joint.covariance)
    return ParallelEstimate(sign, joint, distance[..., 0], variance[..., 0, 0])


def parallel_edges(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ParallelEstimate:
    """Return tilts ``sgn(n_x) (n_y, n_z)`` and distance ``|(p_y, p_z)|`` of two edges, (20), (21), section 4.4.

    Re-frame both to nearby origins first (:func:`tanteo.features.constraints.relate` does).

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.

    Raises:
        DegenerateError: two lines coincide exactly; test :func:`collinearity` then. Below 3 sigma the distance is Rice
            distributed (``math.md`` section 12).
    """
    pair = relative(T1, T2)
    q = pair.p * np.array([0.0, 1.0, 1.0])
    d = np.sqrt(np.sum(q * q, axis=-1))
    if np.any(d == 0):
        raise DegenerateError(
            "distance of edges: expected two lines, got coincident ones, where the distance has no variance. "
            "Test collinearity (4 degrees of freedom) instead."
        )
    return _parallel(pair, X_AXIS, (d, q / d[..., None], (C1, C2, C12)))


def parallel_planes(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ParallelEstimate:
    """Return tilts ``sgn(a_z) (a_x, a_y)`` and *signed* offset ``p_z`` of two planes, (22)-(24).

    The offset of the second plane is along the outward normal of the first: a step if the normals agree, minus the
    thickness if they are opposite. The paper's ``|p_z|`` is a folded normal, and its ``F*`` lacks the sign.

    Args:
        T1: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second plane.
        C2: body covariances of the second plane.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.
    """
    pair = relative(T1, T2)
    return _parallel(pair, Z_AXIS, (pair.p[..., 2], np.array([0.0, 0.0, 1.0]), (C1, C2, C12)))


def collinearity(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> VectorEstimate:
    """Return ``(n_y, n_z, p_y, p_z)`` of the second edge in the first frame, zero for one line (4 dof).

    Args:
        T1: frames ``T_world_edge`` ``(*batch, 4, 4)`` [m].
        C1: body covariances ``(*batch, 6, 6)``.
        T2: frames of the second edge.
        C2: body covariances of the second edge.
        C12: ``E[e1 e2']`` if the errors are correlated; None if independent.
    """
    pair = relative(T1, T2)
    sign = sign_of(pair.R[..., 0, 0])
    value, q, r = collinearity_partials(pair, sign)
    return vector_estimate(pair, X_AXIS, value, (q, r), (C1, C2, C12))


def collinearity_partials(pair: Relative, sign: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values and partials of :func:`collinearity`.

    Args:
        pair: relative geometry of the pairs.
        sign: sense of the second direction, +1 or -1 ``(*batch,)``.
    """
    n = pair.R[..., 1:, 0] * sign[..., None]
    value = np.concatenate([n, pair.p[..., 1:]], axis=-1)
    q = np.zeros((*value.shape, 3))
    r = np.zeros((*value.shape, 3))
    r[..., 0, 1] = r[..., 1, 2] = sign
    q[..., 2, 1] = q[..., 3, 2] = 1.0
    return value, q, r


PARALLEL_ALPHA = 1e-4
"""Rejection rate of truly parallel pairs, the pruning level of ``math.md`` section 9."""
_PARALLEL_LIMIT = -2 * float(np.log(PARALLEL_ALPHA))  # of chi-square with two degrees of freedom
_NOT_PARALLEL = f"the pair is not parallel (rejected at {PARALLEL_ALPHA:g}), so it has no one distance."


def parallel_pairs(group: PairGroup) -> BoolArray:
    """Return the mask of pairs whose two tilts pass the parallelism test with 2 degrees of freedom.

    Args:
        group: pairs with their values.
    """
    v1 = group.value[:, 0]
    v2 = group.value[:, 1]
    S = group.S
    a = S[:, 0, 0] + RESOLUTION**2
    b = S[:, 0, 1]
    c = S[:, 1, 1] + RESOLUTION**2
    return c * v1 * v1 - 2 * b * v1 * v2 + a * v2 * v2 <= _PARALLEL_LIMIT * (a * c - b * b)


PLANE_PARALLELISM = ConstraintKind("plane_parallelism", ("rad", "rad"), "tilts of the second plane", null=True)
PLANE_OFFSET = ConstraintKind(
    "plane_offset", ("m",), "offset of a parallel plane along the first normal: a step, or minus a thickness"
)


def _fill_planes(p: Vectors, a: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Fill the rows two tilts and offset."""
    sign = sign_of(a[:, 2])
    value[:, :2], value[:, 2] = a[:, :2] * sign[:, None], p[:, 2]
    r[:, 0, 0] = r[:, 1, 1] = sign
    q[:, 2, 2] = 1.0


def _cut_planes(group: PairGroup) -> list[ConstraintColumn]:
    value = group.value
    S = group.S
    offset, variance = condition_on_parallel(value[:, :2], value[:, 2:], S)
    return [
        group.column(PLANE_PARALLELISM, value[:, :2], S[:, :2, :2]),
        group.column(PLANE_OFFSET, offset, variance, parallel_pairs(group), _NOT_PARALLEL),
    ]


register_relation(PairRelation((PLANE_PARALLELISM, PLANE_OFFSET), ("plane", "plane"), 3, _fill_planes, _cut_planes))

EDGE_PARALLELISM = ConstraintKind("edge_parallelism", ("rad", "rad"), "tilts of the second edge", null=True)
EDGE_DISTANCE = ConstraintKind("edge_distance", ("m",), "distance of two parallel edges")
EDGE_COLLINEARITY = ConstraintKind(
    "edge_collinearity", ("rad", "rad", "m", "m"), "tilts and offsets of the second edge", null=True
)


def fill_lines(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Fill the rows two tilts and two offsets, see :class:`PairRelation`.

    Args:
        p: origins of the second features in the first frames ``(n, 3)`` [m].
        n: axes of the second features in the first frames ``(n, 3)``.
        value: values ``(n, rows)``; written.
        q: derivatives by ``p`` ``(n, rows, 3)``; written.
        r: derivatives by the axis ``(n, rows, 3)``; written.
    """
    sign = sign_of(n[:, 0])
    value[:, :2], value[:, 2:] = n[:, 1:] * sign[:, None], p[:, 1:]
    r[:, 0, 1] = r[:, 1, 2] = sign
    q[:, 2, 1] = q[:, 3, 2] = 1.0


def _cut_lines(group: PairGroup) -> list[ConstraintColumn]:
    value = group.value
    S = group.S
    parallel = parallel_pairs(group)
    distance, variance, across = length_of(*condition_on_parallel(value[:, :2], value[:, 2:], S))
    apart = distance > 3 * np.sqrt(across)
    return [
        group.column(EDGE_PARALLELISM, value[:, :2], S[:, :2, :2]),
        group.column(
            EDGE_DISTANCE,
            distance[:, None],
            variance[:, None, None],
            parallel & apart,
            "the edges are not parallel, or nearer than 3 sigma, where the distance is not normal: see collinearity.",
            bias=(across / (2 * np.where(apart, distance, 1.0)))[:, None],
        ),
        group.column(EDGE_COLLINEARITY, value, S, parallel & ~apart, "the edges are not parallel, or clearly apart."),
    ]


_OF_EDGES = EDGE_PARALLELISM, EDGE_DISTANCE, EDGE_COLLINEARITY
register_relation(PairRelation(_OF_EDGES, ("line", "line"), 4, fill_lines, _cut_lines))
