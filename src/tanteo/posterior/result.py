"""Hypotheses from modes: pose, covariance, unobserved directions, outliers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.fitting.localization import SharedGiven
from tanteo.geometry import SE3
from tanteo.geometry.limits import NOTABLE
from tanteo.geometry.typing import Covariances, Transforms
from tanteo.posterior.answers.hypothesis import hypothesis_at
from tanteo.posterior.answers.misfit import Misfit
from tanteo.posterior.answers.part_motions import symmetry_motions
from tanteo.posterior.answers.pose_prior import PosePrior, prior_rows
from tanteo.posterior.answers.results import Hypothesis
from tanteo.posterior.details import details_at
from tanteo.posterior.fit_at_mode import GoodnessOfFit, face_names
from tanteo.posterior.sampling.covariances import common_tolerance, mode_covariances, unstated_moves
from tanteo.posterior.sampling.modes import Mode
from tanteo.sensors.error_states import UnstatedError
from tanteo.words.findings import WorstReading


def as_hypothesis(
    points: ContactPoints, one: GoodnessOfFit, pose: PosePrior | None = None, unstated: Sequence[UnstatedError] = ()
) -> Hypothesis:
    """Return the hypothesis of a mode: its pose with the covariance of its samples.

    Args:
        points: the measurements.
        one: the mode.
        pose: prior of the pose, which the joint test includes; None to exclude it.
        unstated: errors that the measurements may share although they are not stated.
    """
    mode, part, inliers = one.mode, one.mode.prepared.part, one.inliers
    free, distances = one.free, one.at.distances[0]
    covariance, given = mode_covariances(one)
    common, common_given = common_tolerance(points, one)
    shared = _shared_given(mode, covariance + common)
    covariance = unstated_moves(points, one, unstated).widen(covariance)
    misfit = _joint_misfit(one, pose)
    names = face_names(one)
    return hypothesis_at(
        part,
        mode.T_world_part,
        covariance + common,
        free=free,
        probability=mode.probability,
        misfit=misfit,
        rms=float(np.sqrt(np.mean(distances[inliers] ** 2))) if inliers.any() else 0.0,
        outliers=tuple(name for name, off in zip(points.ids, one.outliers, strict=True) if off),
        pairings=tuple((i, f) for i, f, off in zip(points.ids, names, one.outliers, strict=True) if not off),
        outlier_distances=tuple(float(d) for d, off in zip(distances, one.outliers, strict=True) if off),
        covariance_relative=None if given is None else given + common_given,
        shared=shared,
    )


def _joint_misfit(one: GoodnessOfFit, pose: PosePrior | None) -> Misfit:
    """Return the misfit of measurements, shared errors and prior at the maximum, or at a sample that fits better.

    The maximum of a density is not the minimum of the squares. If a prior bends a region, they may be far apart.
    """
    best = _misfit_at(one, pose, one.mode.T_peak)
    if pose is None or best.p_value > NOTABLE:
        return best
    heavy = np.argsort(-one.mode.weights, kind="stable")[: one.mode.objective.problem.settings.samples.heaviest]
    others = []
    for T in one.mode.Ts[heavy]:
        there = replace(one, at=details_at(one.mode.objective, T[None], one.mode.z[None]))
        others.append(_misfit_at(there, pose, T))
    return max([best, *(other for other in others if other.dof == best.dof)], key=lambda misfit: misfit.p_value)


def _misfit_at(one: GoodnessOfFit, pose: PosePrior | None, T: Transforms) -> Misfit:
    part, z = one.mode.prepared.part, one.mode.z
    known, known_rows = (of[0] for of in prior_rows(pose, part, T[None]))
    points = one.mode.objective.problem.points
    errors = np.array(z[: points.shared_jacobian.shape[2]])
    sides = np.flatnonzero(points.one_sided)
    errors[sides] = np.maximum(errors[sides], 0.0)  # no amount is too little
    named = pose is not None and pose.T_world_part is not None  # a prior pose fixes turns of the symmetry, too
    more = len(known) + len(one.free) - (len(symmetry_motions(part)) if named else 0)
    rest = float(np.sum(errors**2) + np.sum(known**2))
    return one.misfit().with_more(rest, more, one.states_from_priors(known_rows))


def _shared_given(mode: Mode, covariance: Covariances) -> SharedGiven | None:
    """Return the shared errors given the pose of the answer, whose covariance is given; None without any."""
    D = mode.objective.problem.points.shared_jacobian.shape[2]
    if not D:
        return None
    given = SharedGiven.at(mode.z[:D], mode.information[: 6 + D, : 6 + D])
    return given.about(SE3.log(SE3.inverse(mode.T_peak) @ mode.T_world_part)).for_pose(covariance)


def worst_reading(points: ContactPoints, one: GoodnessOfFit) -> WorstReading | None:
    """Return the reading on the part with the largest residual, of point or normal; None if none is far off."""
    off = np.stack([np.abs(one.at.residuals[0]), one.at.tilts[0]]) * one.inliers
    tilted, i = np.unravel_index(int(np.argmax(off)), off.shape)
    if off[tilted, i] < one.mode.objective.problem.settings.search.notable_sds:
        return None
    return WorstReading(points.ids[i], float(off[tilted, i]), bool(tilted))
