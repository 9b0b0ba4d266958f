"""Parallel edges (20), (21), section 4.4; parallel planes (22)-(24), section 4.5; ``math.md`` sections 4.5 and 4.6.

The paper tests the cosine at its maximum, where its first-order variance is zero: a nominal 5 % test rejects 0.05 %
of parallel pairs and misses large tilts. Here the two components of the second axis across the first are tested
together (2 degrees of freedom), and the distance is conditioned on them, which makes it independent of where the
origins are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.constraints.relative import X_AXIS, Z_AXIS, Relative, VectorEstimate, relative, vector_estimate
from tanteo.errors import DegenerateError
from tanteo.typing import Covariances, FloatArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class ParallelEstimate:
    """Parallelism and distance of pairs of edges or planes.

    Attributes:
        sign: +1 if the axes point the same way, -1 if opposite ``(*batch,)``.
        joint: ``(v1, v2, d)``: tilt components [rad] and distance [m], with their 3 x 3 covariance.
        distance: ``d`` given that the pair *is* parallel ``(*batch,)`` [m].
        variance: of that conditioned distance.
    """

    sign: FloatArray
    joint: VectorEstimate
    distance: FloatArray
    variance: FloatArray

    @property
    def tilt(self) -> FloatArray:
        """``v`` ``(*batch, 2)`` [rad], zero for a parallel pair."""
        return self.joint.value[..., :2]

    @property
    def tilt_covariance(self) -> Covariances:
        """``(*batch, 2, 2)``; ``v' S^-1 v`` is chi-square with 2 degrees of freedom."""
        return self.joint.covariance[..., :2, :2]


def sign_of(x: FloatArray) -> FloatArray:
    """+1 or -1, never 0."""
    return np.where(x < 0, -1.0, 1.0)


def condition_on_parallel(v: FloatArray, d: FloatArray, S: Covariances) -> tuple[FloatArray, Covariances]:
    """Mean and covariance of ``d`` given ``v = 0``, from their joint covariance with the two ``v`` first.

    Args:
        v: ``(*batch, 2)``.
        d: ``(*batch, k)``.
        S: ``(*batch, 2 + k, 2 + k)``; a singular tilt block (a feature known exactly) conditions nothing.
    """
    a, b, c = S[..., 0, 0], S[..., 0, 1], S[..., 1, 1]
    det = a * c - b * b
    usable = det > 1e-14 * a * c  # rank one or none: no information to condition on
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
    q, r = np.zeros((*value.shape, 3)), np.zeros((*value.shape, 3))
    r[..., 0, across[0]] = r[..., 1, across[1]] = sign
    q[..., 2, :] = q_d
    joint = vector_estimate(pair, axis, value, (q, r), covariances)
    distance, variance = condition_on_parallel(value[..., :2], value[..., 2:], joint.covariance)
    return ParallelEstimate(sign, joint, distance[..., 0], variance[..., 0, 0])


def parallel_edges(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ParallelEstimate:
    """Tilts ``sgn(n_x) (n_y, n_z)`` and distance ``|(p_y, p_z)|`` of two edges, (20), (21), section 4.4.

    Re-frame both to nearby origins first (:func:`tanteo.constraints.relate` does).

    Args:
        T1: ``T_world_edge`` ``(*batch, 4, 4)``.
        C1: body covariances ``(*batch, 6, 6)``.
        T2: of the second edge.
        C2: of the second edge.
        C12: ``E[e1 e2']`` if correlated.

    Raises:
        DegenerateError: if two lines coincide exactly; test :func:`collinearity` then. Below 3 sigma the distance is
            Rice distributed (``math.md`` section 12).
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
    """Tilts ``sgn(a_z) (a_x, a_y)`` and *signed* offset ``p_z`` of two planes, (22)-(24).

    The offset of the second plane along the outward normal of the first: a step if the normals agree, minus the
    thickness if they are opposite. The paper's ``|p_z|`` is a folded normal, and its ``F*`` lacks the sign.
    Arguments as :func:`parallel_edges`.
    """
    pair = relative(T1, T2)
    return _parallel(pair, Z_AXIS, (pair.p[..., 2], np.array([0.0, 0.0, 1.0]), (C1, C2, C12)))


def collinearity(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> VectorEstimate:
    """``(n_y, n_z, p_y, p_z)`` of the second edge in the first: zero if they are one line, 4 degrees of freedom."""
    pair = relative(T1, T2)
    sign = sign_of(pair.R[..., 0, 0])
    value, q, r = collinearity_partials(pair, sign)
    return vector_estimate(pair, X_AXIS, value, (q, r), (C1, C2, C12))


def collinearity_partials(pair: Relative, sign: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Values and partials of :func:`collinearity`."""
    n = pair.R[..., 1:, 0] * sign[..., None]
    value = np.concatenate([n, pair.p[..., 1:]], axis=-1)
    q, r = np.zeros((*value.shape, 3)), np.zeros((*value.shape, 3))
    r[..., 0, 1] = r[..., 1, 2] = sign
    q[..., 2, 1] = q[..., 3, 2] = 1.0
    return value, q, r
