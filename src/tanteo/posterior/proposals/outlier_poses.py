"""Poses at which an outlier of one of the best maxima is on the face nearest to it.

A pose that many readings leave nearly free in one direction, such as a scan of a flat top, may have a maximum at which
the few readings that determine the direction are outliers. Their distances lead to the maximum that they are on.
"""

from __future__ import annotations

from typing import final

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.posterior.details import details_at
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals.proposer import InitialPoses, Proposer, SearchState


@final
class OutlierPoses(Proposer):
    """Proposer of the poses at which one outlier of one of the best maxima is on the surface."""

    name = "outliers"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose, for each of the best maxima, the poses at which the other readings explain an outlier best.

        The pose moves by the Kalman gain of the outlier's distance from its nearest face, with the covariance of the
        maximum. The outliers with the least squared distance over the variance that the maximum leaves come first.
        """
        best, objective, count = state.best, state.objective, problem.settings.search.moved
        if not len(best) or not len(problem.points):
            return InitialPoses.none()
        best = best.take(np.arange(min(count, len(best))))
        at = details_at(objective, best.Ts, best.zs)
        usable = np.isfinite(at.distances) & (at.per_sd > 0) & at.normals.any(axis=2)
        which, row = np.nonzero((at.inlier_probability < 0.5) & usable)
        if not len(row):
            return InitialPoses.none()
        covariances = np.linalg.inv(objective.of_pose(best.information))
        lever = at.in_part[which, row] - part.centre
        normals, distances = at.normals[which, row], at.distances[which, row]
        J = np.concatenate([normals, np.cross(lever, normals)], axis=1)
        moved = np.einsum("kij,kj->ki", covariances[which], J)
        across = np.sum(J * moved, axis=1)
        order = np.argsort(distances**2 / across, kind="stable")[:count]
        steps = moved[order] * (distances / (across + at.per_sd[which, row] ** -2.0))[order, None]
        steps[:, :3] += steps[:, 3:] @ SO3.hat(part.centre).T
        Ts = best.Ts[which[order]] @ SE3.exp(steps)
        return InitialPoses.refined_poses(np.ascontiguousarray(Ts), best.groups[which[order]])
