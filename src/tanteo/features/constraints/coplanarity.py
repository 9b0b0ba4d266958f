"""Test whether an edge lies on a plane: (3)-(5), ``math.md`` section 4.1.

The paper takes the two variances from the third and fifth entries of ``Ee^S``, which are in the edge's frame and depend
on psi, a free rotation of the edge. Here the rows are in the plane's frame, and both conditions are tested together
with their covariance, so the statistic does not depend on the edge's origin.
"""

from __future__ import annotations

import numpy as np

from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.relation import PairGroup, PairRelation, register_relation
from tanteo.features.constraints.relative import X_AXIS, VectorEstimate, relative, vector_estimate
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors

_Q = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
_R = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def coplanarity(
    T_plane: Transforms, C_plane: Covariances, T_edge: Transforms, C_edge: Covariances, C12: FloatArray | None = None
) -> VectorEstimate:
    """Return ``(p_z, n_z)``: height of the edge's origin over the plane [m], and normal component of its direction.

    Zero if the edge lies on the plane; ``value' S^-1 value`` is chi-square with 2 degrees of freedom
    (:func:`tanteo.features.chi2_statistic`), for any origin and rotation of the edge's frame about the edge.

    Args:
        T_plane: frames ``T_world_plane`` ``(*batch, 4, 4)`` [m].
        C_plane: body covariances of the plane ``(*batch, 6, 6)``.
        T_edge: frames ``T_world_edge``.
        C_edge: body covariances of the edge.
        C12: ``E[e_plane e_edge']`` if the errors are correlated; None if independent.
    """
    pair = relative(T_plane, T_edge)
    value = np.stack([pair.p[..., 2], pair.R[..., 2, 0]], axis=-1)  # (4) and (3)
    q = np.broadcast_to(_Q, (*value.shape, 3))
    r = np.broadcast_to(_R, (*value.shape, 3))
    return vector_estimate(pair, X_AXIS, value, (q, r), (C_plane, C_edge, C12))


def height_and_pitch(estimate: VectorEstimate) -> tuple[FloatArray, Covariances]:
    """Return ``(p_z, theta)`` as in (5), with the correct covariance from ``d theta = -d n_z / cos(theta)`` [m, rad].

    It is undefined for an edge along the normal of the plane (theta = +-pi/2), where ``(p_z, n_z)`` is still defined.

    Args:
        estimate: result of :func:`coplanarity`.
    """
    n_z = estimate.value[..., 1]
    cosine = np.sqrt(np.maximum((1 - n_z) * (1 + n_z), 0.0))
    theta = np.arctan2(-n_z, cosine)
    scale = np.stack([np.ones_like(cosine), -1 / np.where(cosine > 0, cosine, np.nan)], axis=-1)
    S = estimate.covariance * scale[..., :, None] * scale[..., None, :]
    return np.stack([estimate.value[..., 0], theta], axis=-1), S


EDGE_PLANE_COPLANARITY = ConstraintKind(
    "edge_plane_coplanarity", ("m", "rad"), "height and rise of an edge over a plane", null=True
)


def _fill(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    value[:, 0], value[:, 1] = p[:, 2], n[:, 2]
    q[:, 0, 2] = r[:, 1, 2] = 1.0


def _cut(group: PairGroup) -> list[ConstraintColumn]:
    return [group.column(EDGE_PLANE_COPLANARITY, group.value, group.S)]


register_relation(PairRelation((EDGE_PLANE_COPLANARITY,), ("plane", "line"), 2, _fill, _cut))
