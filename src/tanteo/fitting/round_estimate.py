"""Round features by maximum likelihood, over batches: the best of several starts, and whether another fits as well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.features import CIRCLE, CONE, CYLINDER, SPHERE, FeatureKind
from tanteo.fitting.estimate import check_points
from tanteo.fitting.round_choice import best_of, grazing_of, squareness_of
from tanteo.fitting.round_result import RoundEstimate, finish
from tanteo.fitting.round_start import axis_starts, circle_start, on_either_side, refuse_flat, sphere_start
from tanteo.fitting.round_steps import RoundProblem, RoundState, settle
from tanteo.fitting.round_surface import Distance, cone, cylinder, rim, sphere
from tanteo.typing import Covariances, FloatArray, Vectors

DISTANCES: dict[str, Distance] = {"circle": rim, "cylinder": cylinder, "cone": cone, "sphere": sphere}
_LARGEST_HALF_ANGLE = 1.5
_TRIAL = 10, 1e-3
"""So many steps from each start, or steps down to that size, show which is the best."""


def round_ml(
    kind: FeatureKind,
    points: Vectors,
    covs: Covariances,
    *,
    size: float | None = None,
    size_sd: float = 0.0,
    normals: Vectors | None = None,
    normal_sds: FloatArray | None = None,
    outward: Vectors | None = None,
) -> RoundEstimate:
    """Maximum-likelihood circles (rims), cylinders, cones or spheres of ``(*batch, n, 3)`` points.

    ``chi2`` has one degree of freedom a point (two on a rim) and two a sensed normal, less the unknowns. What is not
    observable is not refused here (:func:`fit_cylinder` and its like do): see ``condition``, ``P`` and ``rival``.

    Args:
        kind: circle, cylinder, cone or sphere.
        points: of the surface, or of the rim, in the world [m].
        covs: their independent covariances ``(*batch, n, 3, 3)``, positive definite [m^2].
        size: the radius [m] or half angle [rad], where it is known.
        size_sd: its standard deviation; 0 holds it.
        normals: sensed normals away from the axis (centre) ``(*batch, n, 3)``; zero rows where there is none.
        normal_sds: of these [rad] ``(*batch, n)``; infinite where there is none.
        outward: vectors ``(*batch, n, 3)`` that all point away from the axis, or all towards it; zero if unknown.

    Raises:
        InputError: for too few points, or shapes that do not fit.
        DegenerateError: if the points lie on a line, or in a plane where they must not.
    """
    least = unknowns(kind, size, size_sd)
    points, covs = check_points(points, covs, least, kind.name)
    check_positive(covs, kind.name)
    refuse_flat(points, 2 if kind is CIRCLE else 3, kind.name)
    problem = RoundProblem(
        DISTANCES[kind.name], kind.rows, points, covs, slides=kind is CYLINDER,
        largest=_LARGEST_HALF_ANGLE if kind is CONE else np.inf,
        known_size=None if size is None else size_sd, size=size or 0.0, normals=normals, normal_sds=normal_sds,
        isotropic=_isotropic(covs),
    )  # fmt: skip
    return solved(kind, problem, outward)


def check_positive(covs: Covariances, name: str) -> None:
    """Refuse covariances of points that are not positive definite.

    Raises:
        InputError: if one is.
    """
    try:
        np.linalg.cholesky(covs)
    except np.linalg.LinAlgError:
        raise InputError(
            f"{name}, covs: expected positive definite covariances, got a singular one. Give the noise."
        ) from None


def _isotropic(covs: Covariances) -> bool:
    s2 = covs[..., :1, :1]
    return bool(np.all(np.abs(covs - s2 * np.eye(3)) <= 1e-12 * s2))


def unknowns(kind: FeatureKind, size: float | None, size_sd: float) -> int:
    """How many points it takes."""
    if kind is CIRCLE:
        return 3
    return kind.size + (size is None or size_sd > 0)


def solved(
    kind: FeatureKind, problem: RoundProblem, outward: Vectors | None = None, side: int | None = None
) -> RoundEstimate:
    """The estimate of a problem; ``side`` is 1 where ``outward`` has to point away from the axis, -1 towards it.

    It is solved about the mean of the points: far from the world's origin no digits are lost.
    """
    mean = problem.points.mean(axis=-2)
    near = replace(problem, points=problem.points - mean[..., None, :])
    if problem.known_frame is not None:
        R, c, information = problem.known_frame
        near = replace(near, known_frame=(R, c - mean, information))
    found = _solved(kind, near, outward, side)
    T = found.fit.T.copy()
    T[..., :3, 3] += mean
    return replace(found, fit=replace(found.fit, T=T))


def _solved(kind: FeatureKind, problem: RoundProblem, outward: Vectors | None, side: int | None) -> RoundEstimate:
    if kind in (CYLINDER, CONE):
        starts = axis_starts(kind.name, problem.points, problem.normals)
    else:
        start = sphere_start(problem.points) if kind is SPHERE else _circle(problem)
        if problem.known_size is None:
            state, at, rest = settle(problem, start)
            return finish(kind, problem, state, at, rest, np.full(at.chi2.shape, np.nan))
        starts = RoundState(start.R[..., None, :, :], start.c[..., None, :], start.s[..., None])
    many = replace(
        problem,
        points=problem.points[..., None, :, :],
        covs=problem.covs[..., None, :, :, :],
        normals=None if problem.normals is None else problem.normals[..., None, :, :],
        normal_sds=None if problem.normal_sds is None else problem.normal_sds[..., None, :],
    )
    if problem.known_size is not None:
        starts = starts if kind is CONE else on_either_side(many.points, starts, problem.size, kind is not SPHERE)
        starts = replace(starts, s=np.full(starts.s.shape, problem.size))
    found = settle(many, replace(starts, s=np.minimum(starts.s, problem.largest)), *_TRIAL)
    given = None if outward is None else outward[..., None, :, :]
    return best_of(kind, problem, *found, (squareness_of(found[1], given, side), grazing_of(outward)))


def _circle(problem: RoundProblem) -> RoundState:
    if problem.known_frame is None:
        return circle_start(problem.points)
    R, c, _ = problem.known_frame
    start = circle_start(problem.points, R)
    u = R[..., :, 2]
    height = np.sum((c - start.c) * u, axis=-1)
    return replace(start, c=start.c + u * height[..., None])
