"""Maxima of the posterior of one part: found anew from what the start allows, or climbed to from poses alive."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tanteo.active.start import Start
from tanteo.lie import SE3
from tanteo.localization import pose_information
from tanteo.matching.belief import equivalent
from tanteo.matching.prior import PosePrior, prior_residuals, prior_rows
from tanteo.matching.priors import log_sum
from tanteo.surface_search import FreePaths, Target, Touches
from tanteo.surface_search.distinct import SAME_MAXIMUM
from tanteo.surface_search.none_of_these import NEGLIGIBLE
from tanteo.surface_search.polish import Polished, polish
from tanteo.surface_search.refine import refine
from tanteo.surface_search.search import Effort, first_poses, narrowing
from tanteo.typing import FloatArray, IntArray, Transforms

_CLIMB, _FEW = 6, 2
"""Steps towards the maxima after every reading, of parts that matter and others; those alive go on at the next."""

_EFFORT, _WIDELY = Effort(1000, 10, 24, 8), Effort(3000, 10, 288, 96)
"""How widely a part is looked at anew, and if nothing that was found explains the readings."""


@dataclass(frozen=True, slots=True, eq=False)
class Maxima:
    """Distinct maxima of the posterior of one part.

    Attributes:
        part: index of the part in the start.
        found: the maxima, best first.
        rows: rough pose of the start under which each was found ``(S,)``.
        masses: Laplace's log mass of each ``(S,)``, of all rough poses that lead to it.
    """

    part: int
    found: Polished
    rows: IntArray
    masses: FloatArray


def fresh(start: Start, part: int, touches: Touches, widely: bool = False) -> tuple[Transforms, IntArray]:
    """Poses of a part found anew from what the start allows, whatever was alive, each with the likeliest rough pose."""
    effort = _WIDELY if widely else _EFFORT
    target, raw = start.targets[part], start.drawn(part, effort.poses)
    own = np.flatnonzero(start.part == part)
    rough = partial(prior_rows, PosePrior(start.Ts[own[0]], start.covariances[own[0]]), target.part)
    known = rough if len(own) == 1 else None
    Ts, _ = first_poses(touches, [raw], target, effort, known)
    Ts, _ = refine(touches, Ts, target, narrowing(touches, target), 0.0, known)  # else exact readings look astray
    return Ts, _likeliest(start, part, Ts)


def _likeliest(start: Start, part: int, Ts: Transforms) -> IntArray:
    """Rough pose of the start from which each pose of a part most probably is ``(S,)``."""
    own = np.flatnonzero(start.part == part)
    xi = SE3.log(SE3.inverse(start.Ts[own])[:, None] @ Ts)
    white = np.linalg.solve(np.linalg.cholesky(start.covariances[own])[:, None], xi[..., None])[..., 0]
    log = np.log(np.maximum(start.weights[own], 1e-300)) - 0.5 * np.linalg.slogdet(start.covariances[own])[1]
    return np.asarray(own[np.argmax(log[:, None] - 0.5 * np.sum(white * white, axis=-1), axis=0)])


def climbed(
    start: Start, part: int, Ts: Transforms, rows: IntArray, touches: Touches, free: FreePaths, matters: bool = True
) -> Maxima:
    """The maxima that are reached from poses of a part.

    Args:
        start: what was assumed beforehand.
        part: index of the part.
        Ts: poses ``(S, 4, 4)``.
        rows: rough pose of the start of each ``(S,)``.
        touches: all readings that met something.
        free: all paths on which nothing was met.
        matters: the part may be the one that is sensed; else a few steps do.
    """
    steps = _CLIMB if matters else _FEW
    priors = replace(start.priors, pose=start.prior(rows))
    return _distinct(start, part, polish(touches, free, Ts, start.targets[part], priors, steps), rows)


def more(start: Start, known: Maxima, Ts: Transforms, touches: Touches, free: FreePaths) -> Maxima:
    """The maxima that are known, and those that are reached from further poses of the same part ``(S, 4, 4)``."""
    poses = np.concatenate([known.found.Ts, Ts])
    rows = np.concatenate([known.rows, _likeliest(start, known.part, Ts)])
    return climbed(start, known.part, poses, rows, touches, free)


def _distinct(start: Start, part: int, found: Polished, rows: IntArray) -> Maxima:
    """Each maximum once, with the mass of all rough poses that lead to it."""
    target = start.targets[part]
    log = found.log_evidence + np.log(start.weights[rows]) + _images(start, target, found.Ts, rows)
    order = np.argsort(-log, kind="stable")
    order = order[np.isfinite(log[order]) & (log[order] > log.max() - 2 * NEGLIGIBLE)]
    information = pose_information(found.information)
    kept, masses = [], []
    while len(order):
        first = order[0]
        same = equivalent(target.part, found.Ts[first], found.Ts[order], information[order], SAME_MAXIMUM)
        same[0] = True
        own = order[same]
        best = own[np.unique(rows[own], return_index=True)[1]]  # sorted by mass: the first of every rough pose
        kept.append(first)
        masses.append(log_sum(log[best]))
        order = order[~same]
    index = np.array(kept, dtype=np.int64)
    return Maxima(part, found.take(index), rows[index], np.array(masses))


def _images(start: Start, target: Target, Ts: Transforms, rows: IntArray) -> FloatArray:
    """Log of how many poses that symmetry makes equal the rough pose allows, each by its density ``(S,)``."""
    images = target.part.symmetry.Ts
    if len(images) < 2:
        return np.zeros(len(Ts))
    prior = start.prior(rows)
    log = [-0.5 * np.sum(prior_residuals(prior, target.part, Ts @ S) ** 2, axis=1) for S in images]
    return np.asarray(log_sum(log, axis=0) - log[0])
