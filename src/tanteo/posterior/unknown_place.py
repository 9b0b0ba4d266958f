"""Where an object can be that is none of the parts, by what is known of the pose of whatever it is."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.posterior.answers.pose_prior import PosePrior


def log_place_of_unknown(
    prior: PosePrior | None, centroid: Vectors, middle: Vectors, radius: float, sd: float
) -> float:
    """Log of how much more probable the prior makes an unknown object where it was sensed than it is anywhere.

    Where the object is was said of whatever it is. Of one that is not known its middle is near its readings, its
    attitude says nothing.

    Args:
        prior: what is known of the pose.
        centroid: of the parts, in their frames ``(3,)`` [m].
        middle: of the readings, in the world ``(3,)`` [m].
        radius: of the workspace [m].
        sd: how far its middle may be from theirs, along each axis [m].
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
    """Log probability that a unit normal draw is between two numbers ``(*batch)``; far out, too."""
    from scipy.special import log_ndtr  # slow to import, and needed with a box only

    upper = low > 0
    near, far = np.where(upper, -low, high), np.where(upper, -high, low)
    top = log_ndtr(near)
    return np.asarray(top + np.log(np.maximum(-np.expm1(np.minimum(log_ndtr(far) - top, 0.0)), 1e-300)))
