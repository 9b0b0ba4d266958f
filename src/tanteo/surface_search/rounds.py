"""How long to search: until every pose that matters was found twice, from different readings.

Each round makes its first poses from another group of readings, so its finds do not depend on those of the rounds
before. What several searches find again and again is likely all there is; what was found once says that more of its
kind was not found at all. The probability that was found only once estimates what is still missing (Good and Turing).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from tanteo.localization import pose_information
from tanteo.matching.belief import equivalent
from tanteo.matching.evidence import Priors
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.search import LEAST_ORIENTED, SAME_MAXIMUM, effort_for, explained, groups, search
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.typing import IntArray

_MISSING = 0.02
"""Probability of poses found only once up to which a part is taken as searched."""

_ROUNDS, _HOPELESS_ROUNDS = 7, 5
"""Rounds at most; and where nothing explains the readings."""

_DETERMINES = 6
"""Readings without normals that can fix a pose; fewer leave a direction free however long one searches."""


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """What was found of one part so far.

    Attributes:
        target: the part.
        bases: groups of readings to start from, one a round.
        maxima: distinct, best first; None before the first round.
        times: rounds in which each was found ``(S,)``.
    """

    target: Target
    bases: tuple[tuple[int, ...], ...]
    maxima: Polished | None = None
    times: IntArray | None = None

    @property
    def log_evidence(self) -> float:
        """Of all maxima together."""
        return self._log_sum(np.array([], dtype=np.int64) if self.maxima is None else np.arange(len(self.maxima.Ts)))

    @property
    def log_once(self) -> float:
        """Of those found in one round only."""
        return self._log_sum(np.array([], dtype=np.int64) if self.times is None else np.flatnonzero(self.times == 1))

    def _log_sum(self, rows: IntArray) -> float:
        if self.maxima is None or not len(rows):
            return -np.inf
        return float(logsumexp(self.maxima.log_evidence[rows]) + np.log(self.target.part.symmetry.order))

    def after(self, found: Polished) -> Search:
        """With the finds of another round."""
        if self.maxima is None or self.times is None:
            return Search(self.target, self.bases, found, np.ones(len(found.Ts), dtype=np.int64))
        joint = self.maxima.join(found)
        times = np.concatenate([self.times, np.zeros(len(found.Ts), dtype=np.int64)])
        new = np.arange(len(times)) >= len(self.times)
        order, kept, counts = np.argsort(-joint.log_evidence, kind="stable"), [], []
        information = pose_information(joint.information)
        while len(order):
            first = order[0]
            same = equivalent(self.target.part, joint.Ts[first], joint.Ts[order], information[order], SAME_MAXIMUM)
            same[0] = True
            kept.append(first)
            counts.append(times[order[same]].max() + bool(new[order[same]].any()))
            order = order[~same]
        return Search(self.target, self.bases, joint.take(np.array(kept, dtype=np.int64)), np.array(counts))


def search_all(
    touches: Touches, free: FreePaths, targets: Sequence[Target], priors: Priors
) -> list[tuple[Target, Polished]]:
    """The maxima of all parts; round by round, each part as long as poses may be missing that matter.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        targets: the parts.
        priors: what is assumed beforehand.
    """
    searches = [Search(target, tuple(groups(touches, target, _ROUNDS))) for target in targets]
    determined = len(touches) >= _DETERMINES or touches.oriented.sum() >= LEAST_ORIENTED
    left = list(range(len(searches)))
    for k in range(_ROUNDS if determined else 2):
        for i in left:
            s = searches[i]
            effort = effort_for(touches, s.target, k)
            searches[i] = s.after(search(touches, free, s.target, priors, effort, s.bases[k % len(s.bases)]))
        if k > 0:
            left = _unfinished(searches, left, k, priors)
        if not left:
            break
    return [(s.target, s.maxima) for s in searches if s.maxima is not None]


def _unfinished(searches: Sequence[Search], left: list[int], k: int, priors: Priors) -> list[int]:
    """Parts to search again after round ``k``."""
    if not any(s.maxima is not None and explained(s.maxima, priors.clutter) for s in searches):
        return left if k + 1 < _HOPELESS_ROUNDS else []
    total = logsumexp([s.log_evidence for s in searches])
    return [i for i in left if searches[i].log_once > total + np.log(_MISSING)]
