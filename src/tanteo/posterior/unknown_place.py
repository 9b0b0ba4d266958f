"""Density of the place of an unknown object under the prior of the pose."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.posterior.answers.pose_prior import PosePrior


def log_place_of_unknown(
    prior: PosePrior | None, centroid: Vectors, middle: Vectors, radius: float, sd: float
) -> float:
    """Return the log ratio of the prior density of an unknown object at its readings to the uniform density.

    The prior of the pose holds for any object. The middle of an unknown object is near its readings; its attitude is
    unknown.

    Args:
        prior: prior of the pose.
        centroid: mean centroid of the parts, in their frames ``(3,)`` [m].
        middle: middle of the readings in the world ``(3,)`` [m].
        radius: radius of the workspace [m].
        sd: standard deviation of the object's middle from that of the readings, along each axis [m].
    """
    log = 0.0
    if prior is not None and prior.box is not None:
        low, high = (prior.box - middle) / sd
        log += float((log_between(low, high) + np.log(2 * radius / (prior.box[1] - prior.box[0]))).sum())
    if prior is not None and prior.T_world_part is not None and prior.T_world_part.ndim == 2:
        assert prior.covariance is not None
        rows = prior.T_world_part[:3, :3] @ np.concatenate([np.eye(3), -SO3.hat(centroid)], axis=1)
        C = rows @ prior.covariance @ rows.T + sd**2 * np.eye(3)
        off = middle - SE3.apply(prior.T_world_part, centroid)
        log += float(
            3 * np.log(2 * radius) - 0.5 * (np.linalg.slogdet(2 * np.pi * C)[1] + off @ np.linalg.solve(C, off))
        )
    return log


def log_between(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return log probabilities of a standard normal variable between two numbers ``(*batch)``, exact in the tails."""
    from scipy.special import log_ndtr  # slow to import, and needed with a box only

    upper = low > 0
    near, far = np.where(upper, -low, high), np.where(upper, -high, low)
    top = log_ndtr(near)
    return np.asarray(top + np.log(np.maximum(-np.expm1(np.minimum(log_ndtr(far) - top, 0.0)), 1e-300)))
