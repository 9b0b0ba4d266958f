"""Measurements that may be on furniture: the table, a vise, a fixture (decision 64)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.factors import ContactPoints, FreeRays
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.posterior.answers.furniture import Furniture
from tanteo.posterior.answers.priors import Priors
from tanteo.posterior.outliers import JEFFREYS
from tanteo.posterior.settings import SearchSettings


@dataclass(frozen=True, slots=True, eq=False)
class FurniturePoints:
    """Points that may be on furniture.

    Attributes:
        names: names of the furniture.
        which: index of the furniture on which each point is most probable ``(n,)``.
        over_outlier: density on furniture over that of an outlier, times the prior odds of furniture ``(n,)``; 0
            without furniture.
        paths: free-space rays to the points on furniture.
    """

    names: tuple[str, ...]
    which: IntArray
    over_outlier: FloatArray
    paths: FreeRays

    @property
    def on_furniture(self) -> BoolArray:
        """Return which points are more probable on furniture than as outliers ``(n,)``."""
        return np.asarray(self.over_outlier >= 1)

    @property
    def others(self) -> IntArray:
        """Return the rows of all other points."""
        return np.flatnonzero(~self.on_furniture)


def weigh_furniture(points: ContactPoints, priors: Priors, settings: SearchSettings) -> FurniturePoints:
    """Return which points may be on furniture, the table included, and with what odds.

    The prior odds of furniture are estimated from the number of points that are more probable there than as outliers.
    Labelled points and those of edges and vertices may be on furniture like all others.
    """
    n, log_outlier = len(points), outlier_log_density(points, priors)
    furniture = without_pose(points, priors).furniture
    if not furniture or not n:
        return FurniturePoints((), np.zeros(n, dtype=np.int64), np.zeros(n), FreeRays.none())
    log = np.stack([f.log_density(points.points, points.covs, points.radii, points.directions) for f in furniture])
    own = [[factor.log_on(f.surface, f.sd) for factor in points.factors] for f in furniture]
    log = np.where([[one is None for one in row] for row in own], log, np.array(own, dtype=np.float64))
    over = log.max(axis=0) - log_outlier - np.where(points.oriented, np.log(4 * np.pi), 0.0)
    over = np.where(points.centres, -np.inf, over)  # nothing measures holes of furniture
    count = int(np.sum(over > 0))
    odds = np.log(count + JEFFREYS) - np.log(n - count + JEFFREYS)
    weighed = np.exp(np.minimum(over + odds, 600.0))
    names = tuple(f.name for f in furniture)
    return FurniturePoints(names, log.argmax(axis=0), weighed, _paths(points, weighed >= 1, settings))


def without_pose(points: ContactPoints, priors: Priors) -> Priors:
    """Return the priors without the prior of the pose; its planes become furniture."""
    planes = priors.pose.planes if priors.pose is not None and len(points) else ()
    there = [Furniture.of_table(plane, np.median(points.points, axis=0), priors.radius) for plane in planes]
    return replace(priors, pose=None, furniture=(*priors.furniture, *there))


def _paths(points: ContactPoints, on_it: BoolArray, own: SearchSettings) -> FreeRays:
    """Return the free-space rays of beams that end on furniture, those nearest to the other points."""
    rows = np.flatnonzero(on_it & points.directed & (points.reach > 0))
    if not len(rows) or on_it.all():
        return FreeRays.none()
    off = points.points[~on_it] - points.points[rows][:, None]
    along = np.sum(off * points.directions[rows][:, None], axis=2, keepdims=True)
    beside = np.linalg.norm(off - along * points.directions[rows][:, None], axis=2).min(axis=1)
    some = points.take(rows[np.argsort(beside, kind="stable")[: own.few_points]])
    margin = np.minimum(own.gate * some.sd, some.reach)
    return FreeRays(
        some.points - some.reach[:, None] * some.directions, some.directions, some.reach, margin,
        shared_jacobian=some.shared_jacobian, turns=np.zeros_like(some.shared_jacobian),
    )  # fmt: skip


def outlier_log_density(points: ContactPoints, priors: Priors) -> FloatArray:
    """Return the log density of each measurement if it is an outlier or on an unknown object ``(n,)``."""
    return np.array([factor.log_outlier(priors.radius) for factor in points.factors], dtype=np.float64)
