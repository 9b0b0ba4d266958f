"""Evaluation of each measurement at some poses: densities, inlier probability, nearest face, residual."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo import _core
from tanteo.geometry.typing import FloatArray, IntArray, Transforms, Vectors
from tanteo.posterior.outliers import DistantPoints
from tanteo.posterior.sampling.peaks import Objective


@dataclass(frozen=True, slots=True, eq=False)
class Details:
    """Evaluation of ``n`` points at ``S`` poses.

    Attributes:
        log_hit: log density of each point on the part or on furniture ``(S, n)``.
        log_outlier: log density of each point as an outlier or on furniture ``(S, n)``.
        places: index of the place of each point ``(n,)``, equal for readings of one beam; None if all have their own.
        groups: index of the label of each point ``(n,)``; -1 without a label.
        log_groups: log density of the points of each label on the part ``(S, G)``.
        log_elsewhere: log density of the points of each label on a surface of another object ``(G,)``.
        log_points: log density of all points together, with labels and outliers ``(S,)``.
        log_there: log density of each point if its most probable face passed through the point ``(S, n)``.
        inlier_probability: probability that the point is on the part ``(S, n)``.
        distances: signed distance of each point from its most probable face ``(S, n)`` [m].
        per_sd: one over the standard deviation along the normal of that face ``(S, n)`` [1/m].
        tilts: deviation of a sensed normal ``(S, n)`` [standard deviations]; 0 where none was sensed.
        normals: outward normal of that face at the point, part frame ``(S, n, 3)``; zero for edges and corners.
        in_part: the point in the part frame ``(S, n, 3)`` [m].
        faces: index of that face ``(S, n)``; below -1 for edges and corners.
        design_scales: log density of each point over ``log_hit`` for each design of the places: even over the part,
            over a region if that is not the part, over the touched faces ``(D, S, n)``.
        design_groups: ``log_groups`` for each design ``(D, S, G)``.
        log_designs: log of the prior weight of each design ``(D, S)``.
        designs: probability of each design ``(D, S)``.
        distant: points that are on no object of the size of the parts which has the others.
        over_touched: ``design_scales`` of places that are even over the touched faces ``(S, n)``, if the densities are
            those of this design; None for others.
    """

    log_hit: FloatArray
    log_outlier: FloatArray
    places: IntArray | None
    groups: IntArray
    log_groups: FloatArray
    log_elsewhere: FloatArray
    log_points: FloatArray
    log_there: FloatArray
    inlier_probability: FloatArray
    distances: FloatArray
    per_sd: FloatArray
    tilts: FloatArray
    normals: Vectors
    in_part: Vectors
    faces: IntArray
    design_scales: FloatArray
    design_groups: FloatArray
    log_designs: FloatArray
    designs: FloatArray
    distant: DistantPoints
    over_touched: FloatArray | None = None

    def of_design(self, k: int) -> Details:
        """Return the densities if the places have one of the designs.

        Args:
            k: number of the design.
        """
        hit, there = self.log_hit + self.design_scales[k], self.log_there + self.design_scales[k]
        touched = self.design_scales[k] if 0 < k == len(self.design_scales) - 1 else None
        return replace(self, log_hit=hit, log_there=there, log_groups=self.design_groups[k], over_touched=touched)

    @property
    def uneven(self) -> FloatArray:
        """Return the probability that the places are not even over the part ``(S,)``."""
        return np.asarray(1 - self.designs[0])

    @property
    def residuals(self) -> FloatArray:
        """Return the distances in standard deviations ``(S, n)``."""
        return self.distances * self.per_sd


def details_at(objective: Objective, Ts: Transforms, zs: FloatArray) -> Details:
    """Evaluate the measurements at poses ``(S, 4, 4)`` and the other states there ``(S, D)``."""
    points = objective.problem.points
    table, faces, log_points, scales, log_groups, log_designs, designs = _core.details(
        objective.prepared.shape, objective.core, np.ascontiguousarray(Ts), np.ascontiguousarray(zs)
    )
    outlier = objective.problem.log_outlier
    with np.errstate(divide="ignore"):
        on_furniture = outlier + np.log(objective.problem.furniture.over_outlier)
        hit = np.logaddexp(np.log(table[..., 0]) + outlier, on_furniture)
        there = np.log(table[..., 5]) + outlier
    there = np.maximum(there, hit)
    groups = objective.problem.groups
    of_groups = np.array([outlier[groups == g].sum() for g in range(log_groups.shape[2])])
    return Details(
        hit, np.broadcast_to(np.logaddexp(outlier, on_furniture), hit.shape), points.places, groups,
        log_groups[0] + of_groups, objective.problem.label_evidence.log_odds + of_groups, log_points, there,
        table[..., 1], table[..., 2], table[..., 3], table[..., 4],
        table[..., 6:9], table[..., 9:], faces.astype(np.int64), np.log(scales), log_groups + of_groups, log_designs,
        designs, objective.problem.distant,
    )  # fmt: skip
