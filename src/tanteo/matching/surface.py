"""Surface search: all poses of a part that explain readings without correspondences, from no first guess."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.special import bdtrc, chdtrc

from tanteo.localization import pose_information
from tanteo.matching.belief import equivalent
from tanteo.matching.evidence import Priors
from tanteo.matching.polish import HOPELESS, Polished, polish
from tanteo.matching.prior import in_box, prior_rows, prior_starts
from tanteo.matching.refine import Known, refine
from tanteo.matching.starts import bases, distinct, lowest, oriented_bases, pair_poses, score, triple_poses
from tanteo.matching.target import Target
from tanteo.matching.touches import FreePaths, Touches
from tanteo.shapes import signed_distance
from tanteo.typing import FloatArray, Transforms, Vectors

GRID_SD = 0.3
"""Error of the distance grid, in cells."""

_ENOUGH = 40
"""Readings used to find poses; all are used to polish them."""

_NOISY = 0.01
"""Noise above this share of the part's diagonal blurs the first scores."""

_STRAYS, _PLAUSIBLE = 0.03, 1e-3
"""A pose explains the readings if as many strays as it leaves, and their chi-square, are not less likely than this."""

_CROWD, _COMPARABLE = 8, 8.0
"""So many maxima within that log odds of the best: there are more than a search of the usual width finds."""

_TURNED = 4
"""Best poses from which the part is turned over, in search of others that fit nearly as well, and those it gives."""

_GLANCE = 4
"""Readings by which most first poses are dismissed before all are looked at."""

_SAME_MAXIMUM = 6.0
"""Squared Mahalanobis distance within which two polished poses are one maximum.

Near an edge of the part a climb does not settle to a point.
"""


@dataclass(frozen=True, slots=True)
class Effort:
    """How widely to search.

    Attributes:
        bases: groups of readings from which first poses are made; clutter spoils some of them.
        poses: first poses of each base.
        scored: readings that the first score uses.
        rough: poses polished on the grid, first and second round.
        fine: poses polished exactly.
    """

    bases: int
    poses: int
    scored: int
    rough: tuple[int, int]
    fine: int


QUICK = Effort(2, 2000, 8, (60, 20), 6)
"""Many clean readings: almost every start ends at the truth."""

WIDE = Effort(2, 12000, 10, (300, 120), 40)
"""Few or noisy readings: many poses explain them."""

WIDEST = Effort(4, 12000, 16, (800, 300), 60)
"""A last look before giving up, for shapes full of local maxima."""

DEEPEST = Effort(4, 12000, 16, (3000, 800), 160)
"""For readings that the best pose leaves aside: gross strays make good poses look bad until the noise is resolved."""

EXHAUSTIVE = Effort(6, 20000, 16, (6000, 2000), 1000)
"""For so few readings that scores of poses explain them, and each has to be in the answer."""

ORIENTED = Effort(3, 100, 10, (16, 4), 3)
"""Normals were sensed: two readings fix a pose."""


def efforts_for(touches: Touches, target: Target) -> tuple[Effort, ...]:
    """Efforts to try in turn, until a pose explains the readings.

    The fewer and the noisier the readings, the more poses explain them, and the wider the first search.
    """
    if touches.oriented.sum() >= 3:
        return ORIENTED, WIDE
    noisy = float(np.median(touches.sd)) > _NOISY * target.part.diagonal
    if len(touches) >= 20 and not noisy:
        return QUICK, WIDE, WIDEST
    return WIDE, WIDEST


def search(
    touches: Touches,
    free: FreePaths,
    target: Target,
    priors: Priors,
    effort: Effort,
    known: Transforms | None = None,
) -> Polished:
    """The distinct maxima of the likelihood of one part, best first.

    Args:
        touches: three readings or more that met something.
        free: paths on which nothing was met.
        target: the part.
        priors: clutter and workspace.
        effort: how widely to search.
        known: poses ``(S, 4, 4)`` to polish as well.
    """
    some = touches.take(np.linspace(0, len(touches) - 1, min(len(touches), _ENOUGH)).astype(np.int64))
    beforehand = partial(prior_rows, priors.pose, target.part) if priors.pose else None
    Ts = first_poses(some, target, effort, beforehand)
    Ts = np.concatenate([prior_starts(priors.pose), Ts if known is None else np.concatenate([known, Ts])])
    Ts, _ = refine(some, Ts, lambda p: _exact(target, p), _narrowing(some, target), 0.0, beforehand)
    found = polish(touches, free, Ts, target, priors)
    found = found.take(np.flatnonzero(found.log_evidence >= found.log_evidence.max(initial=-np.inf) - HOPELESS))
    found = distinct_maxima(found, target)
    if effort is not ORIENTED:
        turned = _turned_over(some, found.Ts[:_TURNED], target)
        if len(turned):
            found = distinct_maxima(found.join(polish(touches, free, turned, target, priors)), target)
    return found.take(np.flatnonzero(in_box(priors.pose, target.part, found.Ts)))


def explained(found: Polished, clutter: float) -> bool:
    """Whether the best pose has the residuals of noise, and no more readings aside than clutter at that rate makes."""
    if not len(found.Ts):
        return False
    belongs = found.belongs[0] > 0.5
    chi2, dof = float(np.sum(found.residuals[0, belongs] ** 2)), int(belongs.sum()) - 6
    return not leaves_many(found, clutter) and bool(dof <= 0 or chdtrc(dof, chi2) > _PLAUSIBLE)


def crowded(found: Polished) -> bool:
    """Whether so many poses explain the readings that some were surely missed."""
    return int(np.sum(found.log_evidence > found.log_evidence.max(initial=-np.inf) - _COMPARABLE)) >= _CROWD


def leaves_many(found: Polished, clutter: float) -> bool:
    """Whether the best pose leaves more readings aside than clutter at that rate makes."""
    strays, n = int(np.sum(found.belongs[0] <= 0.5)), found.belongs.shape[1]
    return strays > 0 and bool(bdtrc(strays - 1, n, clutter) <= _STRAYS)


def first_poses(touches: Touches, target: Target, effort: Effort, known: Known | None = None) -> Transforms:
    """Poses worth an exact look: triples scored on the grid, then polished there in two rounds."""
    sd, step = float(np.median(touches.sd)), GRID_SD * target.field.step
    Ts = _raw_poses(touches, target, effort)
    rows = np.linspace(0, len(touches) - 1, min(effort.scored, len(touches))).astype(np.int64)
    wide = float(np.hypot(sd, target.spacing))
    if known is None and len(rows) > _GLANCE and len(Ts) > 10 * effort.rough[0]:
        few = score(touches, Ts, target, wide, rows[:: len(rows) // _GLANCE + 1])
        Ts = Ts[lowest(few, max(10 * effort.rough[0], len(Ts) // 3))]
    start, cost = wide / np.hypot(sd, step), score(touches, Ts, target, wide, rows)
    if known is not None:
        cost += np.minimum((known(Ts)[0] / start) ** 2, 9.0).sum(axis=1)
    keep = distinct(touches, Ts, cost, target, effort.rough[0], 1.5 * target.spacing)
    Ts, cost = refine(touches, Ts[keep], target.field, start * np.array([1.0, 1.0, 0.7, 0.5]), step, known)
    Ts = Ts[distinct(touches, Ts, cost, target, effort.rough[1], 0.3 * target.spacing)]
    Ts, cost = refine(touches, Ts, target.field, np.array([0.4 * start, 3.0, 3.0, 3.0, 2.0]), step, known)
    return Ts[distinct(touches, Ts, cost, target, effort.fine, max(2 * sd, 0.1 * target.spacing))]


def _turned_over(touches: Touches, Ts: Transforms, target: Target) -> Transforms:
    """The same places with the part turned over: most parts nearly fit their place that way, and few starts may."""
    sd, step = float(np.median(touches.sd)), GRID_SD * target.field.step
    start = 0.4 * np.hypot(sd, target.spacing) / np.hypot(sd, step)
    turned = (Ts[:, None] @ target.turns).reshape(-1, 4, 4)
    turned, cost = refine(touches, turned, target.field, np.maximum(start, [8.0, 5.0, 4.0, 3.0, 3.0]), step)
    least = refine(touches, Ts[:1], target.field, np.array([3.0]), step)[1]
    rows = np.flatnonzero(0.5 * len(touches) * (cost - least) < HOPELESS)
    rows = rows[distinct(touches, turned[rows], cost[rows], target, _TURNED, max(2 * sd, 0.1 * target.spacing))]
    if not len(rows):
        return turned[:0]
    turned, _ = refine(touches, turned[rows], lambda p: _exact(target, p), _narrowing(touches, target))
    return turned


def _narrowing(touches: Touches, target: Target) -> FloatArray:
    """Scales of the exact steps: from the error that the grid leaves down to the noise, halved or so at each."""
    start = max(5.0, GRID_SD * target.field.step / float(np.median(touches.sd)))
    return np.geomspace(start, 3.0, max(3, int(np.ceil(np.log2(start / 3.0))) + 1))


def _raw_poses(touches: Touches, target: Target, effort: Effort) -> Transforms:
    """Poses that put a few readings on samples; two with normals are enough, three without."""
    if touches.oriented.sum() >= 3:
        pairs = oriented_bases(touches, effort.bases)
        return np.concatenate([pair_poses(touches, base, target, effort.poses) for base in pairs])
    triples = bases(touches, effort.bases, target)
    return np.concatenate([triple_poses(touches, base, target, effort.poses) for base in triples])


def _exact(target: Target, points: Vectors) -> tuple[FloatArray, Vectors]:
    return signed_distance(target.surface, points)


def distinct_maxima(found: Polished, target: Target) -> Polished:
    """Each maximum once: starts that met at one pose, or at poses that symmetry makes one, are not more evidence."""
    order = np.argsort(-found.log_evidence, kind="stable")
    information = pose_information(found.information)
    kept = []
    while len(order):
        kept.append(order[0])
        same = equivalent(target.part, found.Ts[order[0]], found.Ts[order], information[order], _SAME_MAXIMUM)
        same[0] = True
        order = order[~same]
    return found.take(np.array(kept, dtype=np.int64))
