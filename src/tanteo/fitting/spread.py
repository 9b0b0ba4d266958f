"""Covariance of a feature as displacement and rotation in the world."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


def plane_displacement_covariance(T: Transforms, P: Covariances, points: Vectors) -> Covariances:
    """Return covariances of a plane's displacement along its normal at points ``(*batch, k, 3)`` [m]."""
    local = (points - T[..., None, :3, 3]) @ T[..., :3, :3]
    h = np.stack([np.ones(local.shape[:-1]), local[..., 1], -local[..., 0]], axis=-1)
    return h @ P @ np.swapaxes(h, -1, -2)


def plane_normal_covariance(T: Transforms, P: Covariances) -> Covariances:
    """Return the covariance of (unit normal, displacement of the origin along it) in world axes."""
    J = np.zeros((*T.shape[:-2], 4, 3))
    J[..., :3, 1], J[..., :3, 2] = -T[..., :3, 1], T[..., :3, 0]
    J[..., 3, 0] = 1.0
    return J @ P @ np.swapaxes(J, -1, -2)


def edge_direction_covariance(T: Transforms, P: Covariances) -> Covariances:
    """Return the covariance of (unit direction, lateral displacement of the origin) in world axes; rank 4."""
    J: FloatArray = np.zeros((*T.shape[:-2], 6, 4))
    J[..., :3, 2], J[..., :3, 3] = -T[..., :3, 2], T[..., :3, 1]
    J[..., 3:, 0], J[..., 3:, 1] = T[..., :3, 1], T[..., :3, 2]
    return J @ P @ np.swapaxes(J, -1, -2)
