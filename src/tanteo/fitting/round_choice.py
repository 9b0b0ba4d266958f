"""Which of several fits of a round feature is the one, and whether the points leave it open (``math.md`` section 8)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.constraints import chi2_limit
from tanteo.features import CONE, CYLINDER, SPHERE, FeatureKind
from tanteo.fitting.round_result import RoundEstimate, dof_of, finish
from tanteo.fitting.round_steps import Linear, RoundProblem, RoundState, settle
from tanteo.limits import SUSPECT
from tanteo.typing import BoolArray, FloatArray, Vectors

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


def best_of(
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
    as_good = score < _as_good(score.min(axis=-1, keepdims=True), dof_of(problem, at))
    most = np.max(np.where(as_good, squareness, 0.0), axis=-1, keepdims=True)
    score = score + _IMPOSSIBLE * (as_good & (squareness < grazing[..., None] * most))
    k = np.argmin(score, axis=-1)[..., None]

    def chosen(array: FloatArray) -> FloatArray:
        index = k.reshape(k.shape + (1,) * (array.ndim - k.ndim))
        return np.asarray(np.take_along_axis(array, index, axis=k.ndim - 1).squeeze(k.ndim - 1))

    score = np.where(rest, score, np.inf)  # what did not come to rest is on its way to another
    best, own, rest = settle(problem, RoundState(chosen(state.R), chosen(state.c), chosen(state.s)))
    found = finish(kind, problem, best, own, rest, np.full(own.chi2.shape, np.nan))
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


def grazing_of(outward: Vectors | None) -> FloatArray:
    """The share of the best mean cosine below which a fit is ruled out ``(*batch,)``."""
    if outward is None:
        return np.asarray(_GRAZING)
    count = np.maximum(np.sum(np.linalg.norm(outward, axis=-1), axis=-1), 1e-300)
    return np.where(np.linalg.norm(np.sum(outward, axis=-2), axis=-1) / count < _AROUND, _SQUARE, _GRAZING)


def squareness_of(at: Linear, outward: Vectors | None, side: int | None) -> FloatArray:
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
