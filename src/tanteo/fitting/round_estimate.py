"""Round features by maximum likelihood, over batches: the best of several starts, and whether another fits as well."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.constraints import chi2_limit
from tanteo.errors import InputError
from tanteo.features import CIRCLE, CONE, CYLINDER, SPHERE, FeatureKind
from tanteo.fitting.estimate import Estimate, check_points
from tanteo.fitting.round_start import axis_starts, circle_start, on_either_side, refuse_flat, sphere_start
from tanteo.fitting.round_steps import Linear, RoundProblem, RoundState, settle
from tanteo.fitting.round_surface import Distance, cone, cylinder, rim, sphere
from tanteo.lie import SE3
from tanteo.limits import SUSPECT
from tanteo.typing import BoolArray, Covariances, FloatArray, Vectors

DISTANCES: dict[str, Distance] = {"circle": rim, "cylinder": cylinder, "cone": cone, "sphere": sphere}
_LARGEST_HALF_ANGLE = 1.5
_TRIAL = 10, 1e-3
"""So many steps from each start, or steps down to that size, show which is the best."""
_IMPOSSIBLE = 1e9
"""Added to the sum of squares of a fit that sides rule out."""
_GRAZING, _SQUARE, _AROUND = 0.5, 0.93, 0.7
"""Of fits that are as good, those whose normals the touches graze (a share of the best mean cosine) are ruled out by
one that they met squarely. Touches from all around (the mean of their directions is short) are made square to a wall:
then less is enough. Touches all from one side say nothing of normals, but on which side the material is."""
_AS_GOOD = 9.21, SUSPECT
"""Another fit whose sum of squares is larger by less than this (1 % of two degrees of freedom), or that the joint test
does not reject at this level, fits as well: sums of squares of two cylinders differ by chance, both being of noise."""
_ELSEWHERE = 0.02
"""Two fits differ if their sizes differ by more than this share, or their axes by more radians, beyond five sd."""


@dataclass(frozen=True, slots=True, eq=False)
class RoundEstimate:
    """Fitted round features over batches.

    Attributes:
        fit: frames, with ``P`` and ``shared_jacobian`` over the kind's rows and then the size: one row more.
        size: radius [m] or half angle [rad] ``(*batch,)``.
        rival: size of another feature that fits about as well ``(*batch,)``; NaN if there is none.
        settled: whether the iteration came to rest ``(*batch,)``.
        condition: least eigenvalue of the information scaled to unit diagonal ``(*batch,)``: zero if the points leave
            something free.
    """

    fit: Estimate
    size: FloatArray
    rival: FloatArray
    settled: BoolArray
    condition: FloatArray


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
            return _finish(kind, problem, state, at, rest, np.full(at.chi2.shape, np.nan))
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
    return _best(kind, problem, *found, (_squareness(found[1], given, side), _grazing(outward)))


def _circle(problem: RoundProblem) -> RoundState:
    if problem.known_frame is None:
        return circle_start(problem.points)
    R, c, _ = problem.known_frame
    start = circle_start(problem.points, R)
    u = R[..., :, 2]
    height = np.sum((c - start.c) * u, axis=-1)
    return replace(start, c=start.c + u * height[..., None])


def _best(
    kind: FeatureKind,
    problem: RoundProblem,
    state: RoundState,
    at: Linear,
    rest: BoolArray,
    sides: tuple[FloatArray, FloatArray],
) -> RoundEstimate:
    """Of the starts' fits the most likely one, brought to rest, and the size of another that is about as likely."""
    squareness, grazing = sides
    score = np.where(np.isfinite(at.chi2), at.chi2, np.inf) + _IMPOSSIBLE * ~(squareness >= 0)
    as_good = score < _as_good(score.min(axis=-1, keepdims=True), _dof(problem, at))
    most = np.max(np.where(as_good, squareness, 0.0), axis=-1, keepdims=True)
    score = score + _IMPOSSIBLE * (as_good & (squareness < grazing[..., None] * most))
    k = np.argmin(score, axis=-1)[..., None]

    def chosen(array: FloatArray) -> FloatArray:
        index = k.reshape(k.shape + (1,) * (array.ndim - k.ndim))
        return np.asarray(np.take_along_axis(array, index, axis=k.ndim - 1).squeeze(k.ndim - 1))

    score = np.where(rest, score, np.inf)  # what did not come to rest is on its way to another
    best, own, rest = settle(problem, RoundState(chosen(state.R), chosen(state.c), chosen(state.s)))
    found = _finish(kind, problem, best, own, rest, np.full(own.chi2.shape, np.nan))
    return replace(found, rival=_rival(kind, found, best, state, score))


def _rival(
    kind: FeatureKind, found: RoundEstimate, best: RoundState, state: RoundState, score: FloatArray
) -> FloatArray:
    """The size of the most likely other fit that the points do not rule out, ``(*batch,)``; NaN without one."""
    sd = np.sqrt(np.maximum(np.diagonal(found.fit.P, axis1=-2, axis2=-1), 0.0))[..., None, :]
    size, u = best.s[..., None], best.R[..., None, :, 2]
    other = np.abs(state.s - size) > np.maximum(_ELSEWHERE * size, 5 * sd[..., -1])
    if kind is not CONE:  # whose place is far from its points
        gap = state.c - best.c[..., None, :]
        gap = gap - np.sum(gap * u, axis=-1, keepdims=True) * u if kind is CYLINDER else gap
        reach = np.maximum(_ELSEWHERE * size, 5 * sd[..., : 2 if kind is CYLINDER else 3].max(axis=-1))
        other |= np.linalg.norm(gap, axis=-1) > reach
    if kind is not SPHERE:
        cosine = np.abs(np.sum(state.R[..., 2] * u, axis=-1))
        other |= np.arccos(np.minimum(cosine, 1.0)) > np.maximum(_ELSEWHERE, 5 * sd[..., -3:-1].max(axis=-1))
    as_good = other & (score < _as_good(found.fit.chi2[..., None], found.fit.dof))
    j = np.argmin(np.where(as_good, score, np.inf), axis=-1)[..., None]
    return np.where(as_good.any(axis=-1), np.take_along_axis(state.s, j, axis=-1)[..., 0], np.nan)


def _as_good(chi2: FloatArray, dof: int) -> FloatArray:
    return np.asarray(np.maximum(chi2 + _AS_GOOD[0], chi2_limit(_AS_GOOD[1], dof) if dof > 0 else 0.0))


def _grazing(outward: Vectors | None) -> FloatArray:
    """The share of the best mean cosine below which a fit is ruled out ``(*batch,)``."""
    if outward is None:
        return np.asarray(_GRAZING)
    count = np.maximum(np.sum(np.linalg.norm(outward, axis=-1), axis=-1), 1e-300)
    return np.where(np.linalg.norm(np.sum(outward, axis=-2), axis=-1) / count < _AROUND, _SQUARE, _GRAZING)


def _squareness(at: Linear, outward: Vectors | None, side: int | None) -> FloatArray:
    """Mean cosine of the known sides to the normals ``(*batch,)``; -1 if they do not all point away, or all towards."""
    if outward is None:
        return np.ones(at.chi2.shape)
    cosines = np.sum(at.G[..., -1, :] * outward, axis=-1) * (side or 1)
    length = np.linalg.norm(outward, axis=-1)
    away = (cosines >= -0.2 * length).all(axis=-1)
    if side is None:
        towards = (cosines <= 0.2 * length).all(axis=-1)
        away, cosines = away | towards, np.abs(cosines)
    mean = np.sum(cosines, axis=-1) / np.maximum(np.sum(length, axis=-1), 1e-300)
    return np.where(away, np.maximum(mean, 0.0), -1.0)


def _finish(
    kind: FeatureKind, problem: RoundProblem, state: RoundState, at: Linear, rest: BoolArray, rival: FloatArray
) -> RoundEstimate:
    d = np.diagonal(at.information, axis1=-2, axis2=-1)
    unit = 1 / np.sqrt(np.where(d > 0, d, 1.0))
    values, vectors = np.linalg.eigh(at.information * unit[..., :, None] * unit[..., None, :])
    inverse = (vectors / np.maximum(values, 1e-14)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    P = inverse * unit[..., :, None] * unit[..., None, :]
    gains = -P[..., None, :, :] @ np.swapaxes(at.h, -1, -2) @ at.W @ at.G
    counts = _counts(problem, at)
    freedom = counts - np.einsum("...nij,...ji->...n", at.spent, P)
    standardised = np.sqrt(counts * at.each / np.maximum(freedom, 1e-9))
    full, gain = _with_row(kind, P, gains)
    T = SE3.from_parts(state.R, state.c)
    fit = Estimate(T, full, at.chi2, _dof(problem, at), at.e, standardised, gain)
    return RoundEstimate(fit, state.s, rival, rest, values[..., 0])


def _counts(problem: RoundProblem, at: Linear) -> FloatArray:
    """Residuals of each point ``(n,)``: one, two on a rim, and two a sensed normal."""
    counts = np.full(at.each.shape[-1], float(at.e.shape[-1]))
    if problem.normal_sds is not None:
        counts += 2 * np.isfinite(problem.normal_sds.reshape(-1, len(counts))[0])  # one of a batch is as the others
    return counts


def _dof(problem: RoundProblem, at: Linear) -> int:
    known = 0
    if problem.known_frame is not None:
        known = int(np.any(problem.known_frame[2] != 0, axis=-1).sum())
    unknown = at.information.shape[-1]
    return int(_counts(problem, at).sum()) - unknown + known + bool(problem.known_size)


def _with_row(kind: FeatureKind, P: Covariances, gains: FloatArray) -> tuple[Covariances, FloatArray]:
    """The row of the size, zero where it is given."""
    m = kind.size + 1
    if P.shape[-1] == m:
        return P, gains
    full, gain = np.zeros((*P.shape[:-2], m, m)), np.zeros((*gains.shape[:-2], m, 3))
    full[..., :-1, :-1], gain[..., :-1, :] = P, gains
    return full, gain
