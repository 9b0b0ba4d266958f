"""Goodness of fit of a mode: points on the part, residuals, and motions that nothing constrains."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo import _core
from tanteo.factors import FreeRays
from tanteo.factors.factor import numbered_landmarks
from tanteo.fitting.localization import pose_information, weak_motions
from tanteo.geometry.typing import FloatArray, Tangents
from tanteo.parts import Part
from tanteo.posterior.answers.misfit import Misfit
from tanteo.posterior.answers.part_motions import part_scale, symmetry_motions, without_symmetry
from tanteo.posterior.details import Details, details_at
from tanteo.posterior.sampling.modes import Mode, to_origin


@dataclass(frozen=True, slots=True, eq=False)
class GoodnessOfFit:
    """A mode with the measurements evaluated at its maximum.

    Attributes:
        mode: the mode.
        at: evaluation of the measurements at the maximum (one pose).
        per_stated_sd: one over the stated standard deviation of each point along its normal ``(n,)`` [1/m].
        free: motions that nothing constrains, the part's symmetries first, in units of ``part_scale`` ``(m, 6)``.
    """

    mode: Mode
    at: Details
    per_stated_sd: FloatArray
    free: Tangents

    @property
    def inliers(self) -> np.ndarray:
        """Return which points are on the part ``(n,)``."""
        return np.asarray(self.at.inlier_probability[0] > 0.5)

    @property
    def on_furniture(self) -> np.ndarray:
        """Return which points are on furniture ``(n,)``: neither on the part nor outliers."""
        problem = self.mode.objective.problem
        return np.asarray(~self.inliers & (problem.furniture.over_outlier > problem.priors.outlier_rate))

    @property
    def outliers(self) -> np.ndarray:
        """Return which points nothing explains ``(n,)``."""
        return np.asarray(~self.inliers & ~self.on_furniture)

    def misfit(self) -> Misfit:
        """Return the squared residuals of the points on the part and of their normals."""
        inliers, tilts, factors = self.inliers, self.at.tilts[0], self.mode.objective.problem.points.factors
        points = float(np.sum((self.at.distances[0] * self.per_stated_sd)[inliers] ** 2))
        across = sum(factor.codimension for factor, on in zip(factors, inliers, strict=True) if on)
        tilt_dof = 2 * int(np.count_nonzero(tilts[inliers]))
        tilted = float(np.sum(tilts[inliers] ** 2))
        return Misfit(points, tilted, across + tilt_dof - 6, self.mode.objective.problem.scale_sd, across - 6)

    def states_from_priors(self, rows: FloatArray) -> float:
        """Return the effective number of states that the points do not determine.

        Args:
            rows: whitened derivatives of the prior of the pose ``(m, 6)``.
        """
        objective = self.mode.objective
        states = 6 + objective.problem.points.shared_jacobian.shape[2]
        information = objective.regular(self.mode.information)[:states, :states]
        known = np.eye(states)
        known[:6, :6] = rows.T @ rows
        return len(self.free) - (states - 6) + float(np.trace(np.linalg.solve(information, known)))


def goodness_of_fit(mode: Mode) -> GoodnessOfFit:
    """Evaluate the measurements at the maximum of a mode."""
    part, T = mode.prepared.part, mode.T_peak[None]
    at = details_at(mode.objective, T, mode.z[None])
    information = without_symmetry(part, pose_information(mode.information))
    scaled = mode.objective.problem.scale_sd > 0
    stated = details_at(mode.objective, T, np.r_[mode.z[:-1], 0.0][None]) if scaled else at
    return GoodnessOfFit(mode, at, stated.per_sd[0], _free(mode, information))


def _free(mode: Mode, information: FloatArray) -> Tangents:
    """Return the motions that nothing constrains, except those that ends of faces constrain nearly as well."""
    part, own = mode.prepared.part, mode.objective.problem.settings.samples
    scale, known = part_scale(part), symmetry_motions(part)
    sampled = without_symmetry(part, np.asarray(np.linalg.inv(mode.covariance), dtype=np.float64))
    if mode.maxima > 1 and mode.ess >= own.shape:  # each maximum alone seems to constrain what all together leave free
        return weak_motions(sampled, scale, fixed=known)
    free = weak_motions(information, scale, fixed=known)
    if len(free) == len(known) or mode.ess < own.shape:
        return free
    constrained = weak_motions(sampled, scale, own.edge_sd, fixed=known)
    return constrained if len(constrained) < len(free) else free


def face_names(one: GoodnessOfFit) -> list[str]:
    """Return the name of the face, edge, vertex or furniture that is nearest to each point."""
    part = one.mode.prepared.part
    furniture, on_it = one.mode.objective.problem.furniture, one.on_furniture
    names = [_name_of(part, int(f)) for f in one.at.faces[0]]
    return [furniture.names[furniture.which[k]] if on_it[k] else name for k, name in enumerate(names)]


def _name_of(part: Part, number: int) -> str:
    """Return the name of an element by its number in the core: faces from 0; below -1 edges, vertices, landmarks."""
    k, edges, corners = -2 - number, len(part.edges), len(part.corners)
    if number >= 0:
        return part.faces[number].name
    if k < edges:
        return f"edge {k}"
    if k < edges + corners:
        return f"vertex {k - edges}"
    return next(one.name for _, own, one in numbered_landmarks(part) if own == k - edges - corners)


def information_by_point(mode: Mode) -> FloatArray:
    """Return the information of each point on the pose at the maximum, given shared errors ``(n, 6, 6)``.

    Part frame, right perturbation [m, rad]. Each point is evaluated alone, with the inlier probability that it has
    without the other points.
    """
    objective, problem = mode.objective, mode.objective.problem
    out = np.zeros((len(problem.points), 6, 6))
    priors = replace(problem.priors, pose=None)
    nothing = replace(problem, rays=FreeRays.none(), priors=priors, mixtures={}, pose_factors=())
    own, scale = problem.points.shared_jacobian.shape[2], mode.z[problem.shared_errors :]
    T, z = np.ascontiguousarray(mode.T_peak[None]), np.r_[mode.z[:own], scale][None]
    for k in range(len(out)):
        alone = replace(nothing, points=problem.points.take(np.array([k])))
        information = _core.slopes(objective.prepared.shape, alone.compiled(objective.prepared), T, z)[2][0]
        out[k] = to_origin(objective, information)[:6, :6]
    return out
