"""Observability gate: measurements that fit any part, because they are too few or all noise."""

from __future__ import annotations

import numpy as np

from tanteo.factors import AxisCentre
from tanteo.posterior.problem import Problem
from tanteo.posterior.settings import FEWEST, POSE_DOF
from tanteo.words import Finding
from tanteo.words.findings import (  # fmt: skip
    AllOnFurniture,
    NoiseTooLarge,
    NothingSensed,
    OneCentre,
    OnOneLine,
    TooFewReadings,
    TwoCentres,
)

_TIGHT = 0.01
"""Standard deviation of a prior at the part's corners, over its radius, up to which it fixes a direction: a reading
then measures the others (row prior of ``benchmarks/few_touches.py``)."""


def open_directions(problem: Problem) -> int:
    """Return the number of directions of the pose that its prior leaves open, 6 without a prior pose."""
    pose = problem.priors.pose
    if pose is None or pose.covariance is None or pose.covariance.ndim != 2:
        return POSE_DOF
    scale = np.r_[np.ones(3), np.full(3, problem.priors.radius)]
    sds = np.sqrt(np.linalg.eigvalsh(pose.covariance * np.outer(scale, scale)))
    return int(np.count_nonzero(sds > _TIGHT * problem.priors.radius))


def observability_gate(problem: Problem) -> Finding | None:
    """Return why the points fit any part: too few, on one line, or all noise; None if there is enough."""
    if problem.pose_factors and len(problem.points):  # an image fixes the pose, too
        return None
    points, named = problem.points.take(problem.furniture.others), problem.priors.pose is not None
    if not len(points) and len(problem.points):
        return AllOnFurniture(len(problem.points), problem.furniture.names[problem.furniture.which[0]])
    if not len(points):
        return NothingSensed()
    slides = any(isinstance(f, AxisCentre) for f in points.factors)
    if len(points) == 1 and points.centres.any():
        return OneCentre(slides)
    if len(points) == 2 and points.centres.all() and not (named or points.oriented.any()):
        return TwoCentres(slides)
    if points.constrained < min(FEWEST, open_directions(problem)):
        return TooFewReadings(len(points))
    if named or points.oriented.any() or np.count_nonzero(points.centres) > 1:
        return None
    along, across = np.linalg.svd(points.points - points.points.mean(axis=0), compute_uv=False)[:2]
    of_ray = np.sqrt(np.einsum("ni,nij,nj->n", points.directions, points.covs, points.directions))
    sd = float(np.median(np.where(points.directed, of_ray, points.sd)))
    if across > sd * np.sqrt(len(points)):
        return None
    if along > problem.settings.search.notable_sds * sd * np.sqrt(len(points)):
        return OnOneLine()
    return NoiseTooLarge(sd, points.tolerance > 0)
