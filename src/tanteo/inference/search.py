"""The search: parts race in rounds of proposals until no pose that matters is likely to be missing.

What several pairs of points lead to again and again is likely all there is; what one pair alone led to says that more
of its kind was not found. The probability of what was found rarely estimates what is missing (Good and Turing 1953).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.inference.crowds import CROWD, GLANCED, after_hints
from tanteo.inference.part_search import PartSearch, alike, spread, start_search, start_searches
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.inference.proposals import Effort
from tanteo.special import log_sum
from tanteo.typing import Transforms

__all__ = ["LeftOut", "PartSearch", "alike", "missing", "race", "start_search"]

_MISSING = 0.02
"""Probability of what fewer pairs of points led to than often, up to which a part is taken as searched."""

_ROUNDS, _DOUBTFUL, _TOGETHER, _LEAST_ROUNDS = 8, 12, 24, 4
"""Rounds of a part at most, and where its best pose leaves points out that it should not: of few precise points a round
finds the right one with a third or more of probability. So many of all parts together that are still in, but no fewer
of each than the last."""

_GLANCE, _HINTED, _LOOK = Effort(6, 16, 3, 8, hard=0), Effort(0, 0, 3, 8, hard=0), Effort(move=3, hard=3)
"""First rounds of many parts; the second where a coarse look, planes or centres proposed poses."""

_BEHIND = (24.0, 12.0)
"""Log evidence behind the leader, the unknown object included, at which a part is out after each of these."""

_BEST = 3
"""Leading parts of which the best pose is tried on the others."""

_FIXED, _ORIENTED = 6, 3
"""So many points fix a pose, of which centres count twice or thrice, or so many sensed normals."""


@dataclass(frozen=True, slots=True, eq=False)
class LeftOut:
    """Parts that are not searched.

    Attributes:
        count: of them.
        behind: log of what they could explain together over what the best part explains; None where that is as much as
            parts that were hardly promising do.
        discount: log odds of them over those of hardly promising ones, by what was measured of the whole object.
        alike: those of them that are like a part.
        untried: whether no poses of them were tried: some may explain as much as an unknown object, whatever was found.
    """

    count: int = 0
    behind: float | None = None
    discount: float = 0.0
    alike: Callable[[PreparedPart], list[PreparedPart]] = lambda part: []
    untried: bool = False

    def log_evidence(self, best: float, tail: float) -> float:
        """Of all of them together, at most: by that of the best part, and the mean of hardly promising ones."""
        if not self.count:
            return -np.inf
        return best + self.behind if self.behind is not None else tail + float(np.log(self.count)) + self.discount


def race(
    problem: Problem,
    parts: Sequence[PreparedPart],
    log_unknown: float,
    rng: np.random.Generator,
    hints: Sequence[Transforms | None],
    *,
    certain: bool,
    left_out: LeftOut | None,
) -> tuple[list[PartSearch], float]:
    """Search all parts, each as long as it may matter.

    Args:
        problem: the question.
        parts: large enough for the measurements.
        log_unknown: log evidence of the unknown object, over the prior of one part.
        rng: of all draws.
        hints: poses of each to begin with, if any are known.
        certain: whether these are all poses that labels and normals allow.
        left_out: what is known of parts that are not searched.

    Returns:
        The searches, and the log evidence of all parts that are none of them, at most.
    """
    left_out, others, dropped, tail = left_out or LeftOut(), list[PartSearch](), -np.inf, -np.inf
    if len(parts) > CROWD:
        crowd = after_hints(problem, parts, hints, rng, left_out.alike, certain=certain)
        parts, hints, others, dropped, tail = crowd.parts, crowd.hints, crowd.others, crowd.dropped, crowd.tail
    searches = start_searches(problem, parts, alike(rng, len(parts)))
    for search, Ts in zip(searches, hints, strict=False):
        search.hints, search.certain = Ts, certain
    hinted = certain or any(Ts is not None for Ts in hints)
    live = _after_a_glance(searches, _HINTED if hinted else _GLANCE) if len(parts) > 1 else list(searches)
    if not certain or not max(searches, key=lambda s: s.log_evidence).is_good_fit():
        for search in sorted(live, key=lambda s: -s.log_evidence):  # once one explains the points, others may be out
            if len(live) == 1 or search in _still_in(live, log_unknown, _BEHIND[0]):
                search.restart(_LOOK)
        _try_on_others(live)
    live = _still_in(live, log_unknown, _BEHIND[1])
    points = problem.points
    if points.held >= _FIXED or int(points.oriented.sum()) >= _ORIENTED:
        _in_rounds(searches, live, log_unknown)
    searches += others
    top = max([log_unknown if left_out.untried else -np.inf, *(s.log_evidence for s in searches)])
    return searches, float(log_sum([dropped, left_out.log_evidence(top, tail)]))


def _in_rounds(searches: Sequence[PartSearch], live: list[PartSearch], log_unknown: float) -> None:
    """More restarts of those that are still in, while what they may have missed matters."""
    while live:
        total = float(log_sum([s.log_evidence for s in searches]))
        best = max(live, key=lambda s: s.log_evidence)
        share = max(_LEAST_ROUNDS, _TOGETHER // len(live))
        left = [
            s
            for s in live
            if (s.restarts < min(_ROUNDS, share) and s.log_rare() > total + np.log(_MISSING))
            or (s is best and s.restarts < min(_DOUBTFUL, share) and s.doubtful())
        ]
        for search in left:
            search.restart(Effort())
        if not left:
            break
        live = [s for s in live if s.log_evidence > max(log_unknown, best.log_evidence) - _BEHIND[1]]


def _after_a_glance(searches: Sequence[PartSearch], effort: Effort) -> list[PartSearch]:
    """Which parts are still in after a glance at each: with a few of many points, which is as fair to all of them.

    The unknown object is no rival yet: a glance misses the pose of the right part often.
    """
    problem = searches[0].objective.problem
    rows = spread(problem, GLANCED)
    glances = list(searches)
    if len(rows) < len(problem.points):
        few = replace(problem, points=problem.points.take(rows.astype(np.int64)))
        glances = start_searches(few, [s.objective.prepared for s in searches], [s.rng for s in searches])
        glances = [
            replace(g, planes=s.planes, hints=s.hints, certain=s.certain)
            for g, s in zip(glances, searches, strict=True)
        ]
    for glance in glances:
        glance.restart(effort)
    _try_on_others(glances)
    kept = {id(glance) for glance in _still_in(glances, -np.inf, _BEHIND[0])}
    live = [(s, glance) for s, glance in zip(searches, glances, strict=True) if id(glance) in kept]
    for search, glance in live:
        if search is not glance:
            found = glance.peaks
            search.peaks, search.restarts = search.objective.maximize(found.Ts, found.zs, found.groups, fine=True), 1
    return [search for search, _ in live]


def _still_in(searches: Sequence[PartSearch], log_unknown: float, behind: float) -> list[PartSearch]:
    """Parts that are so little behind the leader; half of all as long as the leader does not explain the points.

    Many precise points tell poses apart by hundreds of nats: a part that was only glanced at may be far behind.
    """
    order = sorted(searches, key=lambda s: -s.log_evidence)
    lead = max([log_unknown, *(s.log_evidence for s in order)])
    half = 0 if not order or order[0].is_good_fit() else (len(order) + 1) // 2
    kept = {id(s) for k, s in enumerate(order) if k < half or s.log_evidence > lead - behind}
    return [s for s in searches if id(s) in kept]


def _try_on_others(searches: Sequence[PartSearch]) -> None:
    """Try the best poses of the leading parts on the others: twins and variants share their frames."""
    order = sorted(searches, key=lambda s: -s.log_evidence)[:_BEST]
    leading = [(s, s.peaks.Ts[:1]) for s in order if len(s.peaks)]
    for search in searches:
        poses = [Ts for other, Ts in leading if other is not search]
        if poses:
            search.try_poses(np.concatenate(poses))


def missing(searches: Sequence[PartSearch]) -> float:
    """Share of the probability of all parts that was found only once."""
    total = float(log_sum([s.log_evidence for s in searches])) if searches else -np.inf
    once = float(log_sum([s.log_rare(2) for s in searches])) if searches else -np.inf
    return float(np.exp(once - total)) if np.isfinite(total) else 0.0
