"""Other poses in the place of one: the part turned over, or turned about the axis of its round faces.

Most parts nearly fill their place that way, and few first poses may lead there. About a round face all readings of
that face stay on it, and what fixes the turn may be one reading in a bolt hole.
"""

from __future__ import annotations

import numpy as np

from tanteo.surface_search.polish import HOPELESS, Polished
from tanteo.surface_search.refine import SETTLING, refine
from tanteo.surface_search.spins import STEPS
from tanteo.surface_search.starts import distinct, score
from tanteo.surface_search.target import GRID_SD, Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, IntArray, Transforms

_TURNED = 4
"""Best poses from which the part is turned, and poses that this gives."""

_SPUN = 3
"""Turns about one axis that are looked at, those with the least misfit of all around it."""


def turned_about(
    touches: Touches, maxima: Polished, target: Target, narrowing: FloatArray
) -> tuple[Transforms, IntArray]:
    """Poses in the places of the best maxima that fit nearly as well.

    Args:
        touches: the readings.
        maxima: found so far, best first.
        target: the part.
        narrowing: scales of the last steps.

    Returns:
        Poses ``(P, 4, 4)``, and the groups of readings that led to their places ``(P,)``.
    """
    sd, step = float(np.median(touches.sd)), GRID_SD * target.field.step
    scales = 0.4 * np.hypot(sd, target.spacing) / np.hypot(sd, step) * SETTLING
    best, groups = maxima.Ts[:_TURNED], maxima.groups[:_TURNED]
    over = (best[:, None] @ target.turns).reshape(-1, 4, 4)
    spun, of = _spun(touches, best, target, sd)
    turned = np.concatenate([over, spun])
    origin = np.concatenate([np.repeat(groups, len(target.turns)), groups[of]])
    turned, costs = refine(touches, turned, target, np.maximum(scales, 3.0), step)
    cost, least = costs[:, 0], refine(touches, best[:1], target, np.array([3.0]), step)[1][:, 0]
    terms = len(touches) + 3 * touches.oriented.sum()
    rows = np.flatnonzero(0.5 * terms * (cost - least) < HOPELESS)
    keep = _TURNED * (1 + len(target.spins))
    rows = rows[distinct(touches, turned[rows], cost[rows], target, keep, max(2 * sd, 0.1 * target.spacing))]
    if not len(rows):
        return turned[:0], origin[:0]
    return refine(touches, turned[rows], target, narrowing)[0], origin[rows]


def _spun(touches: Touches, best: Transforms, target: Target, sd: float) -> tuple[Transforms, IntArray]:
    """Poses turned about the axes of round faces, the best of all turns about each, and which pose each is of."""
    if not len(target.spins):
        return best[:0], np.zeros(0, dtype=np.int64)
    rings = best[:, None, None] @ target.spins
    wide = float(np.hypot(sd, np.pi / STEPS * target.part.radius))
    cost = score(touches, rings.reshape(-1, 4, 4), target, wide)[:, 0].reshape(rings.shape[:3])
    low = (cost <= np.roll(cost, 1, axis=2)) & (cost < np.roll(cost, -1, axis=2))
    low[..., [0, 1, -1]] = False  # where it is
    cost = np.where(low, cost, np.inf)
    order = np.argsort(cost, axis=2)[..., :_SPUN]
    pose, axis, rank = np.nonzero(np.isfinite(np.take_along_axis(cost, order, axis=2)))
    return rings[pose, axis, order[pose, axis, rank]], pose
