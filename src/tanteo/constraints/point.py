"""Distances of points (vertices): to a point (13), to a plane, to an edge; ``math.md`` sections 4.3 and 12."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.constraints.relative import X_AXIS, ScalarEstimate, relative, scalar_estimate
from tanteo.errors import DegenerateError
from tanteo.typing import Covariances, FloatArray, Transforms, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class DistanceEstimate:
    """Distance of two points.

    Attributes:
        value: ``(*batch,)`` [m].
        variance: ``(*batch,)``, first order.
        bias: second-order mean error ``E[value] - truth`` [m]; subtract it, or test the vector below 5 sigma.
    """

    value: FloatArray
    variance: FloatArray
    bias: FloatArray


def point_distance(p1: Vectors, p2: Vectors, S: Covariances) -> DistanceEstimate:
    """``|p2 - p1|`` (13) with the covariance ``S`` of the difference ``(*batch, 3, 3)`` [m].

    Raises:
        DegenerateError: if the points coincide; test the difference itself (3 degrees of freedom) then.
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
    """Signed height of a vertex over a plane, positive outside [m]; unbiased to second order at the foot."""
    pair = relative(T_plane, T_point)
    q = np.broadcast_to(np.array([0.0, 0.0, 1.0]), pair.p.shape)
    return scalar_estimate(pair, X_AXIS, pair.p[..., 2], (q, None), (C_plane, C_point, C12))


def point_edge_distance(
    T_edge: Transforms, C_edge: Covariances, T_point: Transforms, C_point: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Distance of a vertex from an edge's line [m].

    Raises:
        DegenerateError: if the vertex is exactly on the line.
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
