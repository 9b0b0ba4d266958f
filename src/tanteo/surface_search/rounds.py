"""How long to search: until every pose that matters was found twice, from different readings.

First poses are made from several groups of readings, which find what they find without each other. What several groups
lead to again and again is likely all there is; what one alone led to says that more of its kind was not found at all.
The probability that was found only once estimates what is still missing (Good and Turing).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.matching.priors import Priors, log_sum
from tanteo.surface_search.distinct import distinct_maxima
from tanteo.surface_search.explained import explained, explains_all, leaves_one_of_few, log_mass, scatter
from tanteo.surface_search.hops import hop
from tanteo.surface_search.likelihood import log_posterior
from tanteo.surface_search.polish import Polished, polish
from tanteo.surface_search.regions import groups_of_regions
from tanteo.surface_search.search import LEAST_ORIENTED, effort_for, groups_of, search
from tanteo.surface_search.shared_start import bend
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import FreePaths, Touches
from tanteo.surface_search.tried import tried_on
from tanteo.typing import FloatArray, IntArray, Transforms

_MISSING = 0.02
"""Probability of poses found only once up to which a part is taken as searched."""

_GROUPS = 2
"""Groups of readings in the first round; one in each later one."""

_ROUNDS, _HOPELESS_ROUNDS = 6, 4
"""Rounds at most; and where nothing explains the readings."""

_BENT = 10.0
"""Shared errors that bend the readings by more standard deviations may hide the right pose from first poses."""

_FEW = 0.02
"""Rate of strays up to which their number tells a right pose: at a tenth many a wrong one explains the readings."""

_DETERMINES = 6
"""Readings without normals that can fix a pose; fewer leave a direction free however long one searches."""


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """What was found of one part so far.

    Attributes:
        target: the part.
        groups: groups of readings to start from.
        maxima: distinct, best first; None before the first round.
    """

    target: Target
    groups: tuple[tuple[int, ...], ...]
    maxima: Polished | None = None

    @property
    def times(self) -> IntArray:
        """Groups of readings from which each maximum was found ``(S,)``."""
        assert self.maxima is not None
        return np.bitwise_count(self.maxima.groups).astype(np.int64)

    @property
    def log_mass(self) -> float:
        """Log evidence of all maxima together."""
        return -np.inf if self.maxima is None else log_mass(self.target, self.maxima)

    @property
    def log_once(self) -> float:
        """Of those found from one group only."""
        return -np.inf if self.maxima is None else log_mass(self.target, self.maxima, np.flatnonzero(self.times < 2))

    def by_regions(self, touches: Touches, free: FreePaths, priors: Priors) -> Search:
        """With each maximum found as often as its region was."""
        if self.maxima is None or np.all(self.times > 1):
            return self

        def log_density(Ts: Transforms, z: FloatArray) -> FloatArray:
            return log_posterior(touches, free, Ts, z, self.target, priors)

        groups = groups_of_regions(self.maxima, self.target, log_density)
        return replace(self, maxima=replace(self.maxima, groups=groups))

    def after(self, found: Polished) -> Search:
        """With the finds of another round, which are distinct."""
        if self.maxima is None:
            return Search(self.target, self.groups, distinct_maxima(found, self.target))
        round_ = np.repeat([0, 1], [len(self.maxima.Ts), len(found.Ts)])
        return Search(self.target, self.groups, distinct_maxima(self.maxima.join(found), self.target, round_))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What a search found.

    Attributes:
        maxima: parts with their maxima.
        ratio: how many times the stated noise the readings have.
        once: of the probability of all poses, the share of those found only once, which is also about that of the poses
            not found at all; 0 if too few readings fix no pose however long one searches.
    """

    maxima: list[tuple[Target, Polished]]
    ratio: float
    once: float


def search_all(touches: Touches, free: FreePaths, targets: Sequence[Target], priors: Priors) -> Found:
    """The maxima of all parts; round by round, each part as long as poses may be missing that matter.

    If the first round explains every reading but for their scattering more than stated, the search goes on with the
    noise that they have: with the stated one nothing would ever explain them.

    Args:
        touches: the readings.
        free: paths on which nothing was met.
        targets: the parts.
        priors: what is assumed beforehand.
    """
    searches = [Search(target, tuple(groups_of(touches, target, _ROUNDS + 1))) for target in targets]
    determined = len(touches) >= _DETERMINES or touches.oriented.sum() >= LEAST_ORIENTED
    left, stated, bent = list(range(len(searches))), touches, bend(touches) > _BENT
    for k in range(_ROUNDS if determined else 1):
        for i in left:
            found = _round(touches, free, searches[i], priors, k)
            searches[i] = searches[i].after(found)
            if bent and (best := searches[i].maxima) is not None and len(best.Ts):
                beside = hop(touches, free, best, searches[i].target, priors, k, _number(k))
                searches[i] = searches[i].after(beside)
            searches[i] = searches[i].by_regions(touches, free, priors)
        searches = _tried(touches, free, searches, priors)
        if k == 0:
            wide, again = _widened(touches, free, searches, priors, _scatter(touches, free, searches, priors))
            if any(s.maxima is not None and explains_all(s.maxima) for s in again):
                touches, searches = wide, again
        left = _unfinished(searches, left, k, priors, bent)
        if not left:
            break
    touches, searches = _widened(touches, free, searches, priors, _scatter(touches, free, searches, priors))
    return Found(_found(searches), float(touches.sd[0] / stated.sd[0]), _once(searches) if determined else 0.0)


def _tried(touches: Touches, free: FreePaths, searches: list[Search], priors: Priors) -> list[Search]:
    """With what the best poses of the other parts lead to."""
    if len(searches) < 2:
        return searches
    found = tried_on(touches, free, [(s.target, s.maxima) for s in searches], priors)
    return [
        s if more is None else s.after(distinct_maxima(more, s.target)) for s, more in zip(searches, found, strict=True)
    ]


def _once(searches: Sequence[Search]) -> float:
    total = log_sum([-np.inf, *(s.log_mass for s in searches)])
    return float(np.exp(log_sum([-np.inf, *(s.log_once for s in searches)]) - total)) if np.isfinite(total) else 0.0


def _round(touches: Touches, free: FreePaths, s: Search, priors: Priors, k: int) -> Polished:
    number = _number(k)
    some = s.groups[:_GROUPS] if k == 0 else (s.groups[number % len(s.groups)],)
    effort = effort_for(touches, s.target, k)
    if k == 0 or bend(touches) <= _BENT:
        return search(touches, free, s.target, priors, effort, some, number)
    z = _supposed(touches, k)
    one, other = (search(touches, free, s.target, priors, effort, some, number, way * z) for way in (1.0, -1.0))
    return distinct_maxima(one.join(other), s.target)


def _number(k: int) -> int:
    """Of the first group of readings of round ``k``."""
    return 0 if k == 0 else k + _GROUPS - 1


def _supposed(touches: Touches, k: int) -> FloatArray:
    """Whitened shared errors ``(D,)`` that round ``k`` supposes: another draw of them in each, the same every time."""
    return np.asarray(np.random.default_rng((1991, k)).normal(size=touches.gains.shape[-1]))


def _found(searches: Sequence[Search]) -> list[tuple[Target, Polished]]:
    return [(s.target, s.maxima) for s in searches if s.maxima is not None]


def _scatter(touches: Touches, free: FreePaths, searches: Sequence[Search], priors: Priors) -> float:
    """How many times more the readings scatter than stated: by themselves, not for what was said of the pose."""
    found = _found(searches)
    ratio = scatter(found)
    if ratio == 1.0 or priors.pose is None:
        return ratio
    alone = replace(priors, pose=None)
    return scatter([(t, polish(touches, free, m.Ts[:1], t, alone)) for t, m in found if len(m.Ts)])


def _widened(
    touches: Touches, free: FreePaths, searches: list[Search], priors: Priors, ratio: float
) -> tuple[Touches, list[Search]]:
    """Readings with that many times the noise, and the maxima there."""
    if ratio == 1.0:
        return touches, searches
    wide = touches.widened(ratio)
    again = [
        Search(s.target, s.groups)
        .after(polish(wide, free, s.maxima.Ts, s.target, priors, groups=s.maxima.groups))
        .by_regions(wide, free, priors)
        for s in searches
        if s.maxima is not None
    ]
    return wide, again


def _unfinished(searches: Sequence[Search], left: list[int], k: int, priors: Priors, bent: bool) -> list[int]:
    """Parts to search again after round ``k``; shared errors may bend the readings far more than their noise."""
    if not any(s.maxima is not None and explained(s.maxima, min(priors.clutter, _FEW)) for s in searches):
        return left if k + 1 < _HOPELESS_ROUNDS else []
    mass = np.array([s.log_mass for s in searches])
    best = int(np.argmax(mass))
    # the next round looks for poses that fit but for one; further ones suppose other errors that readings share
    doubtful = (k == 0 or bent) and leaves_one_of_few(searches[best].maxima, *([np.inf] if bent else []))
    total = log_sum(mass)
    return [i for i in left if searches[i].log_once > total + np.log(_MISSING) or (doubtful and i == best)]
