"""Evidence of the unknown object: measurements anywhere in its ball, or on a near variant of a part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.posterior.answers.pose_prior import PosePrior
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.joint_surface_model import log_joint_surfaces
from tanteo.posterior.outliers import log_all_outliers
from tanteo.posterior.problem import Problem
from tanteo.posterior.touched_region import LARGER

_BALL_STEPS = 32
"""Numerical: steps to the middle of the smallest ball; its radius errs by less than 1 / 32, which ``LARGER`` covers."""


@dataclass(frozen=True, slots=True, eq=False)
class PossibleCentres:
    """Region in which the middle of an unknown object is if all readings are in its ball.

    Attributes:
        middle: centre of the region ``(3,)`` [m].
        volume: volume of the region [m^3].
        radius: radius of the ball [m].
    """

    middle: Vectors
    volume: float
    radius: float

    @property
    def sd(self) -> float:
        """Return the sd of a normal density with the peak of the uniform density on the region [m]."""
        return float(self.volume ** (1 / 3) / np.sqrt(2 * np.pi))


def possible_centres(points: Vectors, radius: float) -> PossibleCentres:
    """Return the region of the middle of a ball that contains some readings.

    Args:
        points: points of the readings ``(n, 3)`` [m].
        radius: radius of the ball [m]; enlarged if the readings need more.
    """
    middle = points.mean(axis=0)
    for k in range(1, _BALL_STEPS):  # Badoiu and Clarkson 2003
        middle = middle + (points[np.argmax(np.sum((points - middle) ** 2, axis=1))] - middle) / (k + 1)
    off = points - middle
    squared = np.sum(off * off, axis=1)
    outermost = np.argsort(-squared)[: len(_directions())]
    off, squared = off[outermost], squared[outermost]
    radius = max(radius, LARGER * float(np.sqrt(squared[0])))
    along = _directions() @ off.T
    reach = (along + np.sqrt(along**2 + radius**2 - squared)).min(axis=1)  # until a reading leaves the ball
    return PossibleCentres(middle, float(4 / 3 * np.pi * np.mean(reach**3)), radius)


@cache
def _directions() -> Vectors:
    """Return uniform directions on a spiral ``(256, 3)``."""
    k = np.arange(256) + 0.5
    z, turn = 1 - k / 128, np.pi * (1 + np.sqrt(5)) * k
    return np.stack([np.cos(turn) * np.sqrt(1 - z * z), np.sin(turn) * np.sqrt(1 - z * z), z], axis=1)


def log_anywhere(problem: Problem, centroid: Vectors) -> float:
    """Return the log density of all readings if the object is unknown: in a ball whose position follows the prior.

    Points of one label are on one surface of any object, and most of its faces run along three perpendicular axes.
    Otherwise every right angle would be evidence for the parts that have one. Distant readings are outliers, or the
    object is larger than all parts.

    Args:
        problem: measurements and priors.
        centroid: mean centroid of the parts, in their frames ``(3,)`` [m].
    """
    points, priors, labels = problem.points, problem.priors, problem.label_evidence
    if not len(points):
        return problem.log_factors_unknown
    others = problem.furniture.others
    placed = others[points.placed[others]]
    placed = placed if len(placed) else others
    place, distant = _log_placed(points.points[placed], priors, centroid), problem.distant.rows[placed]
    if distant.any():
        near = _log_placed(points.points[placed[~distant]], priors, centroid)
        place = problem.distant.mean(near + log_all_outliers(int(distant.sum()), priors.outlier_rate), place)
    even, chosen = labels.log_designs.sum(axis=1)
    places = np.logaddexp(even, chosen + problem.region.log_gain_of_unknown(problem.typical_area)) - np.log(2)
    shapes = places + log_joint_surfaces(labels.facets, priors.right_angled, priors.radius, problem.settings)
    return float(problem.log_not_on_part.sum() + place + shapes) + problem.log_factors_unknown


def _log_placed(points: Vectors, priors: Priors, centroid: Vectors) -> float:
    """Return the log density of the place of an unknown object that has some readings on it."""
    where = possible_centres(points, priors.radius)
    place = log_place_of_unknown(priors.pose, centroid, where.middle, priors.radius, where.sd)
    known = priors.pose is not None and (priors.pose.box is not None or priors.pose.T_world_part is not None)
    share = np.log(where.volume) - 3 * np.log(2 * (priors.radius if known else where.radius))
    return float(place + share)


def log_unknown(log_anywhere: float, log_variant: FloatArray, priors: Priors) -> float:
    """Return the log-evidence of the unknown object: readings anywhere, or on a near variant of a part.

    Args:
        log_anywhere: log-evidence of readings anywhere, with the prior of the unknown object.
        log_variant: log-evidence of near variants at each mode.
        priors: priors of the inference.
    """
    variant = float(log_sum(log_variant)) if len(log_variant) else -np.inf
    log_near = np.log(priors.unknown) + np.log(priors.near_variant) + variant
    return float(np.logaddexp(np.log1p(-priors.near_variant) + log_anywhere, log_near))


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
