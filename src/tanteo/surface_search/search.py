"""Surface search: all poses of a part that explain readings without correspondences, from no first guess."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tanteo.matching.prior import prior_rows, prior_starts
from tanteo.matching.priors import Priors
from tanteo.surface_search.distinct import distinct_maxima
from tanteo.surface_search.polish import HOPELESS, Polished, from_blurred, polish
from tanteo.surface_search.refine import SETTLING, Known, refine
from tanteo.surface_search.regions import bounded
from tanteo.surface_search.shared_start import bend
from tanteo.surface_search.slid import slid_beside
from tanteo.surface_search.starts import (
    bases,
    cells,
    distinct,
    either_way,
    lowest,
    oriented_bases,
    pair_poses,
    score,
    triple_poses,
)
from tanteo.surface_search.target import GRID_SD, Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.surface_search.turned import turned_about
from tanteo.surface_search.within import log_within
from tanteo.typing import FloatArray, IntArray, Transforms

_ENOUGH = 40
"""Readings used to find poses; all are used to polish them."""

_CLEAR = 20
"""Readings from which few first poses are enough."""

LEAST_ORIENTED = 3
"""Sensed normals from which first poses are made of pairs."""

_NOISY = 0.01
"""Noise above this share of the part's diagonal blurs the first scores."""

_WIDEST = 8
"""Later rounds search so many times as widely as the first, and no more: another group of readings tells more then."""

_GLANCE = 4
"""Readings by which most first poses are dismissed before all are looked at."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How widely one round searches.

    Attributes:
        poses: first poses.
        scored: readings that the first score uses.
        rough: poses that are moved until the distances are small beside the spacing of the first ones.
        fine: poses that are moved until they are within the noise.
        astray: whether poses are also kept that fit well but for one reading, and moved without it.
    """

    poses: int
    scored: int
    rough: int
    fine: int
    astray: bool = False

    def cost(self, costs: FloatArray, keep: int) -> FloatArray:
        """By which so many poses are chosen ``(S,)``, of costs :func:`both_ways` ``(S, 2)``."""
        return either_way(costs, keep) if self.astray else costs[:, 0]


def effort_for(touches: Touches, target: Target, round_: int) -> Effort:
    """Effort of a round: less for many clean readings or sensed normals; twice as much in each of the next rounds.

    Args:
        touches: the readings.
        target: the part.
        round_: from 0.
    """
    wider, astray = min(2**round_, _WIDEST), round_ > 0
    noisy = float(np.median(touches.sd)) > _NOISY * target.part.diagonal
    scored = 10 if round_ < 1 else 16
    if touches.oriented.sum() >= LEAST_ORIENTED:
        return Effort(200 * wider, scored, 16 * wider, 6 * wider, astray)
    if len(touches) >= _CLEAR and not noisy:
        return Effort(2000 * wider, 8, 30 * wider, 4 * wider, astray)
    return Effort(12000 if round_ < 2 else 20000, scored, 200 * wider, 40 * wider, astray)


def search(
    touches: Touches,
    free: FreePaths,
    target: Target,
    priors: Priors,
    effort: Effort,
    groups: Sequence[tuple[int, ...]],
    number: int = 0,
    z: FloatArray | None = None,
) -> Polished:
    """The distinct maxima of the likelihood of one part that are found from some groups of readings, best first.

    The groups do not know of each other until their poses are close to maxima. What several led to is climbed once.

    Args:
        touches: three readings or more that met something.
        free: paths on which nothing was met.
        target: the part.
        priors: clutter and workspace.
        effort: how widely to search, for each group.
        groups: readings from which first poses are made: three, or two with normals.
        number: of the first group, for :attr:`Polished.groups`.
        z: whitened shared errors ``(D,)`` that are supposed for the first poses; none if not given.
    """
    supposed = touches if z is None else touches.supposing(z)
    some = supposed.take(np.linspace(0, len(touches) - 1, min(len(touches), _ENOUGH)).astype(np.int64))
    beforehand = partial(prior_rows, priors.pose, target.part) if priors.pose else None
    make = pair_poses if len(groups[0]) == 2 else triple_poses
    raw = [make(supposed, group, target, effort.poses) for group in groups]
    Ts, origin = first_poses(some, raw, target, effort, beforehand)
    bits, start = np.int64(1) << (number + np.arange(len(groups))), prior_starts(priors.pose)
    Ts = np.concatenate([start, Ts])
    origin = np.concatenate([np.full(len(start), bits.sum()), bits[origin]])
    Ts, cost = refine(some, Ts, target, narrowing(some, target), 0.0, beforehand, effort.astray)
    Ts, origin = _met(some, Ts, cost[:, 0], origin, target)
    found = _maxima(polish(touches, free, Ts, target, priors, groups=origin), target)
    if len(groups[0]) == 2:
        found = _maxima(found.join(from_blurred(touches, free, found, target, priors)), target)
    for others in (turned_about, slid_beside, turned_about):
        known = len(found.Ts)
        Ts, origin = others(some, found, target, narrowing(some, target))
        if len(Ts):
            more = polish(touches, free, Ts, target, priors, groups=origin)
            if others is slid_beside:
                more = more.take(np.flatnonzero(bounded(more, target, np.arange(len(more.Ts)))))
            found = _maxima(found.join(more), target, np.repeat([0, -1], [known, len(more.Ts)]))
        if others is slid_beside and len(found.Ts) == known:
            break  # nothing new that could be turned
    return found.take(np.flatnonzero(log_within(priors, target.part, found.Ts, found.information) > -HOPELESS))


def _maxima(found: Polished, target: Target, apart: IntArray | None = None) -> Polished:
    """Distinct ones, without those that cannot matter; some may be known to be ``apart``."""
    hopeful = np.flatnonzero(found.log_evidence >= found.log_evidence.max(initial=-np.inf) - HOPELESS)
    return distinct_maxima(found.take(hopeful), target, None if apart is None else apart[hopeful])


def _met(
    touches: Touches, Ts: Transforms, cost: FloatArray, origin: IntArray, target: Target
) -> tuple[Transforms, IntArray]:
    """Poses that have met within the noise as one, with the groups that led to any of them."""
    key = cells(touches, Ts, max(0.2 * float(np.median(touches.sd)), 1e-4 * target.spacing))
    order = np.argsort(cost, kind="stable")
    _, first, which = np.unique(key[order], return_index=True, return_inverse=True)
    groups = np.zeros(len(first), dtype=np.int64)
    np.bitwise_or.at(groups, which.reshape(-1), origin[order])
    return Ts[order[first]], groups


def groups_of(touches: Touches, target: Target, count: int) -> list[tuple[int, ...]]:
    """Groups of readings to make first poses from; clutter spoils some of them."""
    if touches.oriented.sum() >= LEAST_ORIENTED:
        return [*oriented_bases(touches, count)]
    return [*bases(touches, count, target)]


def first_poses(
    touches: Touches, raw: Sequence[Transforms], target: Target, effort: Effort, known: Known | None = None
) -> tuple[Transforms, IntArray]:
    """Poses worth an exact look, of many raw ones ``(S, 4, 4)``: scored on the grid, then moved by exact distances.

    The grid is good enough to tell which poses are worth it, but near edges and in thin walls its gradients lead away.

    Args:
        touches: the readings.
        raw: poses from each group of readings.
        target: the part.
        effort: how many to keep of each group.
        known: what is known of the pose.

    Returns:
        Poses ``(P, 4, 4)``, and the group of each ``(P,)``.
    """
    sd, step = float(np.median(touches.sd)), GRID_SD * target.field.step
    wide = float(np.linalg.norm([sd, target.spacing, bend(touches) * sd]))
    start = wide / np.hypot(sd, step)
    kept = [Ts[_scored(touches, Ts, target, effort, wide, start, known)] for Ts in raw]
    origin = np.repeat(np.arange(len(kept)), [len(Ts) for Ts in kept])
    Ts, costs = refine(touches, np.concatenate(kept), target, start * SETTLING, step, known, effort.astray)
    chosen, cell = [], max(2 * sd, 0.1 * target.spacing)
    for k in range(len(raw)):
        rows = np.flatnonzero(origin == k)
        key = effort.cost(costs[rows], effort.fine)
        chosen.append(rows[distinct(touches, Ts[rows], key, target, effort.fine, cell)])
    rows = np.concatenate(chosen)
    return Ts[rows], origin[rows]


def _scored(
    touches: Touches, Ts: Transforms, target: Target, effort: Effort, wide: float, start: float, known: Known | None
) -> IntArray:
    """Which poses of one group to move, by distances on the grid: first by few readings, then by some."""
    rows = np.linspace(0, len(touches) - 1, min(effort.scored, len(touches))).astype(np.int64)
    index = np.arange(len(Ts))
    if known is None and len(rows) > _GLANCE and len(Ts) > 10 * effort.rough:
        few = score(touches, Ts, target, wide, rows[:: len(rows) // _GLANCE + 1])[:, 0]
        index = lowest(few, max(10 * effort.rough, len(Ts) // 3))
    cost = score(touches, Ts[index], target, wide, rows)
    if known is not None:
        cost += np.minimum((known(Ts[index])[0] / start) ** 2, 9.0).sum(axis=1, keepdims=True)
    return index[
        distinct(touches, Ts[index], effort.cost(cost, effort.rough), target, effort.rough, 1.5 * target.spacing)
    ]


def narrowing(touches: Touches, target: Target) -> FloatArray:
    """Scales of the exact steps after :func:`first_poses`: from the error that the grid leaves down to the noise.

    Halved or so at each; not below what shared errors do to the readings, which settle later.

    Args:
        touches: the readings.
        target: the part.
    """
    end = max(3.0, bend(touches))
    start = max(5 / 3 * end, GRID_SD * target.field.step / float(np.median(touches.sd)))
    return np.geomspace(start, end, max(3, int(np.ceil(np.log2(start / end))) + 1))
