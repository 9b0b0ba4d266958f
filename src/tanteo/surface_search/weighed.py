"""One search, from readings to the probabilities of what it found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.matching.priors import Priors
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.modes import weigh
from tanteo.surface_search.none_of_these import log_anywhere
from tanteo.surface_search.rounds import search_all
from tanteo.surface_search.target import MOST_SAMPLES, Target, finer
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import Vectors

_PER_SPREAD = 8
"""Samples of the surface across the readings: with fewer a search for places would pass over some that fit."""

_MOST_ORIENTED = 1000
"""Samples for readings with normals, whose table of pairs of samples grows with the square of their number."""


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """What a search found.

    Attributes:
        touches: the readings, with the noise that they have.
        ratio: how many times the stated noise that is.
        once: share of the probability of what was found only once.
        modes: of all parts, best first.
        unknown: probability of "none of these".
        log_total: log density of the readings, whatever it is that they are of.
    """

    touches: Touches
    ratio: float
    once: float
    modes: list[Mode]
    unknown: float
    log_total: float


def search_and_weigh(
    touches: Touches, free: FreePaths, targets: Sequence[Target], count: int, centroid: Vectors, priors: Priors
) -> Weighed:
    """Search and weigh what was found.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        targets: the parts that are large enough.
        count: number of all parts.
        centroid: of the parts, in their frames ``(3,)`` [m].
        priors: what is assumed beforehand.
    """
    if priors.pose is None or priors.pose.T_world_part is None:
        most = _MOST_ORIENTED if touches.oriented.any() else MOST_SAMPLES
        targets = [finer(target, _spread(touches) / _PER_SPREAD, most) for target in targets]
    log_unknown = float(np.log(priors.unknown)) + log_anywhere(touches, centroid, priors)
    found = search_all(touches, free, targets, priors)
    if found.ratio > 1:
        touches = touches.widened(found.ratio)
    modes, unknown, log_total = weigh(touches, free, found.maxima, log_unknown, count, priors)
    return Weighed(touches, found.ratio, found.once, modes, unknown, log_total)


def _spread(touches: Touches) -> float:
    """How far most of the readings reach [m], no less than their noise."""
    off = np.linalg.norm(touches.points - np.median(touches.points, axis=0), axis=1)
    return max(2 * float(np.quantile(off, 0.75)), 4 * _PER_SPREAD * float(np.median(touches.sd)))
