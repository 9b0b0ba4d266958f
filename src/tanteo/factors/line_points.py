"""Two points of a sensed line with the covariance of the line."""

from __future__ import annotations

import numpy as np

from tanteo.features import Feature
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


def line_points(feature: Feature, T: Transforms, jacobian: FloatArray) -> tuple[Vectors, Covariances, FloatArray]:
    """Return two points of a line along the x axis of a frame, about the place where it is known best.

    Points at places x of mean m and mean square q carry the information n (1, m; m, q) (x) inverse of the covariance
    across the line, which is solved for m, q and that covariance.

    Args:
        feature: a sensed edge or cylinder, with perturbations ``(y, z, wy, wz)`` of its frame.
        T: that frame, x along the line ``(4, 4)``.
        jacobian: how the perturbations follow the whitened shared errors ``(4, D)``.

    Returns:
        The points ``(2, 3)`` [m], their covariance ``(3, 3)`` [m^2], their Jacobians ``(2, 3, D)``.
    """
    turn = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, -1], [0, 0, 1, 0]])  # (y, z, wy, wz) of (y, z, wz, -wy)
    information = turn.T @ np.linalg.inv(feature.P) @ turn
    across = np.linalg.inv(information[:2, :2])
    m = float(np.trace(information[2:, :2] @ across)) / 2
    q = float(np.linalg.eigvals(information[2:, 2:] @ across).real.min())
    spread = np.sqrt(max(q - m**2, 0.0))
    if len(feature.support) > 1:
        along = SE3.apply(SE3.inverse(T), feature.support)[:, 0]
        spread = min(spread, float(np.abs(along - m).max()))
    x = m + spread * np.array([-1.0, 1.0])
    cov = np.zeros((3, 3))
    cov[1:, 1:] = 2 * across
    cov[0, 0] = np.trace(across)  # along the line nothing was measured: as across
    lever = np.array([[[0, 0, 0, 0], [1, 0, 0, s], [0, 1, -s, 0]] for s in x])
    points = SE3.apply(T, np.column_stack([x, 0 * x, 0 * x]))
    return points, T[:3, :3] @ cov @ T[:3, :3].T, T[:3, :3] @ lever @ jacobian
