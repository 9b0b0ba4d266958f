"""Surface search: all poses of a part that explain readings without correspondences, from no first guess."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import bdtrc, chdtrc

from tanteo.localization import pose_information
from tanteo.matching.belief import equivalent
from tanteo.matching.evidence import Priors
from tanteo.matching.prior import in_box, prior_rows, prior_starts
from tanteo.shapes import signed_distance
from tanteo.surface_search.polish import HOPELESS, Polished, polish
from tanteo.surface_search.refine import Known, refine
from tanteo.surface_search.starts import bases, distinct, lowest, oriented_bases, pair_poses, score, triple_poses
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import FloatArray, Transforms, Vectors

GRID_SD = 0.3
"""Error of the distance grid, in cells."""

_ENOUGH = 40
"""Readings used to find poses; all are used to polish them."""

LEAST_ORIENTED = 3
"""Sensed normals from which first poses are made of pairs."""

_NOISY = 0.01
"""Noise above this share of the part's diagonal blurs the first scores."""

_STRAYS, _PLAUSIBLE = 0.03, 1e-3
"""A pose explains the readings if as many strays as it leaves, and their chi-square, are not less likely than this."""

_TURNED = 4
"""Best poses from which the part is turned over, in search of others that fit nearly as well, and those it gives."""

_SETTLING = np.array([1.0, 1.0, 0.7, 0.5, 0.4])
"""Scales of the first steps, in units of the error of the first poses."""

_GLANCE = 4
"""Readings by which most first poses are dismissed before all are looked at."""

SAME_MAXIMUM = 6.0
"""Squared Mahalanobis distance within which two polished poses are one maximum.

Near an edge of the part a climb does not settle to a point.
"""


@dataclass(frozen=True, slots=True)
class Effort:
    """How widely one round searches.

    Attributes:
        poses: first poses.
        scored: readings that the first score uses.
        rough: poses that are moved until the distances are small beside the spacing of the first ones.
        fine: poses that are moved until they are within the noise.
    """

    poses: int
    scored: int
    rough: int
    fine: int


def effort_for(touches: Touches, target: Target, round_: int) -> Effort:
    """Effort of a round: less for many clean readings or sensed normals; twice as much with every round from the third.

    Args:
        touches: the readings.
        target: the part.
        round_: from 0.
    """
    wider = 2 ** max(0, round_ - 1)
    noisy = float(np.median(touches.sd)) > _NOISY * target.part.diagonal
    scored = 10 if round_ < 2 else 16
    if touches.oriented.sum() >= LEAST_ORIENTED:
        return Effort(100 * wider, scored, 8 * wider, 3 * wider)
    if len(touches) >= 20 and not noisy:
        return Effort(2000 * wider, 8, 30 * wider, 4 * wider)
    return Effort(12000 if round_ < 3 else 20000, scored, 200 * wider, 40 * wider)


def search(
    touches: Touches, free: FreePaths, target: Target, priors: Priors, effort: Effort, base: tuple[int, ...]
) -> Polished:
    """The distinct maxima of the likelihood of one part that are found from one group of readings, best first.

    Args:
        touches: three readings or more that met something.
        free: paths on which nothing was met.
        target: the part.
        priors: clutter and workspace.
        effort: how widely to search.
        base: readings from which the first poses are made: three, or two with normals.
    """
    some = touches.take(np.linspace(0, len(touches) - 1, min(len(touches), _ENOUGH)).astype(np.int64))
    beforehand = partial(prior_rows, priors.pose, target.part) if priors.pose else None
    raw = (pair_poses if len(base) == 2 else triple_poses)(touches, base, target, effort.poses)
    Ts = np.concatenate([prior_starts(priors.pose), first_poses(some, raw, target, effort, beforehand)])
    Ts, _ = refine(some, Ts, lambda p: _exact(target, p), _narrowing(some, target), 0.0, beforehand)
    found = polish(touches, free, Ts, target, priors)
    found = found.take(np.flatnonzero(found.log_evidence >= found.log_evidence.max(initial=-np.inf) - HOPELESS))
    found = distinct_maxima(found, target)
    if len(base) == 3:
        turned = _turned_over(some, found.Ts[:_TURNED], target)
        if len(turned):
            found = distinct_maxima(found.join(polish(touches, free, turned, target, priors)), target)
    return found.take(np.flatnonzero(in_box(priors.pose, target.part, found.Ts)))


def groups(touches: Touches, target: Target, count: int) -> list[tuple[int, ...]]:
    """Groups of readings to make first poses from, one a round; clutter spoils some of them."""
    if touches.oriented.sum() >= LEAST_ORIENTED:
        return [*oriented_bases(touches, count)]
    return [*bases(touches, count, target)]


def explained(found: Polished, clutter: float) -> bool:
    """Whether the best pose has the residuals of noise, and no more readings aside than clutter at that rate makes."""
    if not len(found.Ts):
        return False
    belongs = found.belongs[0] > 0.5
    chi2, dof = float(np.sum(found.residuals[0, belongs] ** 2)), int(belongs.sum()) - 6
    return not leaves_many(found, clutter) and bool(dof <= 0 or chdtrc(dof, chi2) > _PLAUSIBLE)


def leaves_many(found: Polished, clutter: float) -> bool:
    """Whether the best pose leaves more readings aside than clutter at that rate makes."""
    strays, n = int(np.sum(found.belongs[0] <= 0.5)), found.belongs.shape[1]
    return strays > 0 and bool(bdtrc(strays - 1, n, clutter) <= _STRAYS)


def first_poses(
    touches: Touches, Ts: Transforms, target: Target, effort: Effort, known: Known | None = None
) -> Transforms:
    """Poses worth an exact look, of many raw ones ``(S, 4, 4)``: scored on the grid, then moved by exact distances.

    The grid is good enough to tell which poses are worth it, but near edges and in thin walls its gradients lead away.
    """
    sd, step = float(np.median(touches.sd)), GRID_SD * target.field.step
    rows = np.linspace(0, len(touches) - 1, min(effort.scored, len(touches))).astype(np.int64)
    wide = float(np.hypot(sd, target.spacing))
    if known is None and len(rows) > _GLANCE and len(Ts) > 10 * effort.rough:
        few = score(touches, Ts, target, wide, rows[:: len(rows) // _GLANCE + 1])
        Ts = Ts[lowest(few, max(10 * effort.rough, len(Ts) // 3))]
    start, cost = wide / np.hypot(sd, step), score(touches, Ts, target, wide, rows)
    if known is not None:
        cost += np.minimum((known(Ts)[0] / start) ** 2, 9.0).sum(axis=1)
    keep = distinct(touches, Ts, cost, target, effort.rough, 1.5 * target.spacing)
    Ts, cost = refine(touches, Ts[keep], lambda p: _exact(target, p), start * _SETTLING, step, known)
    return Ts[distinct(touches, Ts, cost, target, effort.fine, max(2 * sd, 0.1 * target.spacing))]


def _turned_over(touches: Touches, Ts: Transforms, target: Target) -> Transforms:
    """The same places with the part turned over: most parts nearly fit their place that way, and few starts may."""
    sd, step = float(np.median(touches.sd)), GRID_SD * target.field.step

    def exact(points: Vectors) -> tuple[FloatArray, Vectors]:
        return _exact(target, points)

    scales = 0.4 * np.hypot(sd, target.spacing) / np.hypot(sd, step) * _SETTLING
    turned = (Ts[:, None] @ target.turns).reshape(-1, 4, 4)
    turned, cost = refine(touches, turned, exact, np.maximum(scales, 3.0), step)
    least = refine(touches, Ts[:1], exact, np.array([3.0]), step)[1]
    rows = np.flatnonzero(0.5 * len(touches) * (cost - least) < HOPELESS)
    rows = rows[distinct(touches, turned[rows], cost[rows], target, _TURNED, max(2 * sd, 0.1 * target.spacing))]
    if not len(rows):
        return turned[:0]
    return refine(touches, turned[rows], exact, _narrowing(touches, target))[0]


def _narrowing(touches: Touches, target: Target) -> FloatArray:
    """Scales of the exact steps: from the error that the grid leaves down to the noise, halved or so at each."""
    start = max(5.0, GRID_SD * target.field.step / float(np.median(touches.sd)))
    return np.geomspace(start, 3.0, max(3, int(np.ceil(np.log2(start / 3.0))) + 1))


def _exact(target: Target, points: Vectors) -> tuple[FloatArray, Vectors]:
    return signed_distance(target.surface, points)


def distinct_maxima(found: Polished, target: Target) -> Polished:
    """Each maximum once: starts that met at one pose, or at poses that symmetry makes one, are not more evidence."""
    order = np.argsort(-found.log_evidence, kind="stable")
    information = pose_information(found.information)
    kept = []
    while len(order):
        kept.append(order[0])
        same = equivalent(target.part, found.Ts[order[0]], found.Ts[order], information[order], SAME_MAXIMUM)
        same[0] = True
        order = order[~same]
    return found.take(np.array(kept, dtype=np.int64))
