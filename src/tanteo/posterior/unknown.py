"""Evidence of the unknown object: measurements anywhere in its ball, or on a near variant of a part."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.posterior.answers.pose_prior import PosePrior
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.joint_surface_model import SIZES, log_joint_surfaces
from tanteo.posterior.labels import SMALLEST
from tanteo.posterior.outliers import log_all_outliers
from tanteo.posterior.problem import Problem
from tanteo.posterior.touched_region import LARGER

_BALL_STEPS = 32
"""Numerical: steps to the middle of the smallest ball; its radius errs by less than 1 / 32."""


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


@dataclass(frozen=True, slots=True, eq=False)
class SizesOfUnknown:
    """Sizes that an unknown object may have, with the density of some readings anywhere on it.

    Attributes:
        centres: region of its middle for each radius, smallest first.
        log_densities: log density of the readings, over that of outliers, if their places are even over the object,
            and if they are even over one region of it; times the prior of each radius ``(2, K)``.
    """

    centres: list[PossibleCentres]
    log_densities: FloatArray

    @property
    def log_density(self) -> float:
        """Return the log of the mean density of both designs, times the volume of the possible centres [m^3]."""
        volumes = np.log([one.volume for one in self.centres])
        return float(log_sum(self.log_densities + volumes) - np.log(2))


def sizes_of_unknown(problem: Problem, rows: IntArray) -> SizesOfUnknown:
    """Return the sizes that an unknown object may have, with the density of some readings anywhere on it.

    The radius of its ball is even up to that of the largest part. Its area is in proportion to the square of the
    radius. Points of a label beyond the first count on its own surface (:mod:`tanteo.posterior.labels`).

    Args:
        problem: measurements and priors.
        rows: rows of the readings that are on the object ``(n,)``, at least one.
    """
    points, largest = problem.points, problem.priors.radius
    off, middle = _from_middle(points.points[rows])
    smallest = max(float(np.sqrt(off[0] @ off[0])), SMALLEST * largest)
    most = max(largest, LARGER * smallest)  # the readings may need a larger object
    steps = ((np.arange(SIZES) + 0.5) / SIZES) ** 2
    radii = smallest + (most - smallest) * steps**1.5
    log_priors = np.log(3 * steps * (most - smallest) / (most * SIZES))
    labels = problem.groups[rows]
    alone, of_label = rows[labels < 0], rows[labels >= 0]
    firsts = np.r_[alone, of_label[np.unique(labels[labels >= 0], return_index=True)[1]]]
    in_half = sum(points.factors[k].log_outlier(largest / 2) for k in firsts)
    power = (in_half - problem.log_outlier[firsts].sum()) / np.log(2)  # coordinates that the object bounds
    even = log_priors - power * np.log(radii / largest)
    regions = np.array([problem.region.log_gain_of_unknown(problem.typical_area * (r / largest) ** 2) for r in radii])
    centres = [PossibleCentres(middle, v, r) for v, r in zip(_volumes(off, radii).tolist(), radii, strict=True)]
    return SizesOfUnknown(centres, np.stack([even, even + regions]))


def _from_middle(points: Vectors) -> tuple[Vectors, Vectors]:
    """Return the outermost points relative to the middle of their smallest ball, farthest first, and the middle."""
    middle = points.mean(axis=0)
    for k in range(1, _BALL_STEPS):  # Badoiu and Clarkson 2003
        middle = middle + (points[np.argmax(np.sum((points - middle) ** 2, axis=1))] - middle) / (k + 1)
    off = points - middle
    return off[np.argsort(-np.sum(off * off, axis=1), kind="stable")[: len(_directions())]], middle


def _volumes(off: Vectors, radii: FloatArray) -> FloatArray:
    """Return the volume of the possible centres of balls of some radii ``(K,)`` [m^3]."""
    along, squared = _directions() @ off.T, np.sum(off * off, axis=1)
    reach = [np.sqrt(along**2 + max(radius**2 - squared[0], 0.0) + (squared[0] - squared)) for radius in radii]
    return np.array([4 / 3 * np.pi * np.mean((along + one).min(axis=1) ** 3) for one in reach])


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
    designs, distant = _log_designs(problem, placed, centroid), problem.distant.rows[placed]
    if distant.any():
        near = _log_designs(problem, placed[~distant], centroid)
        designs = problem.distant.mean(near + log_all_outliers(int(distant.sum()), priors.outlier_rate), designs)
    places = float(log_sum(designs + labels.log_designs.sum(axis=1)) - np.log(2))
    shapes = places + log_joint_surfaces(labels.facets, priors.right_angled, priors.radius, problem.settings)
    return float(problem.log_not_on_part.sum() + shapes) + problem.log_factors_unknown


def _log_designs(problem: Problem, rows: IntArray, centroid: Vectors) -> FloatArray:
    """Return the log density of readings on an unknown object over that of outliers, for both designs ``(2,)``.

    Args:
        problem: measurements and priors.
        rows: rows of the readings ``(n,)``.
        centroid: mean centroid of the parts, in their frames ``(3,)`` [m].
    """
    sizes, priors = sizes_of_unknown(problem, rows), problem.priors
    places = np.array([_log_placed(where, priors, centroid) for where in sizes.centres])
    return log_sum(sizes.log_densities + places, axis=1)


def _log_placed(where: PossibleCentres, priors: Priors, centroid: Vectors) -> float:
    """Return the log probability that an unknown object of some radius is at its readings."""
    place = log_place_of_unknown(priors.pose, centroid, where.middle, priors.radius, where.sd)
    known = priors.pose is not None and (priors.pose.box is not None or priors.pose.T_world_part is not None)
    share = np.log(where.volume) - 3 * np.log(2 * (priors.radius if known else max(where.radius, priors.radius)))
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
