"""More parts than can be searched in rounds: what the poses that were proposed for each lead to decides."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.inference.part_search import PartSearch, alike, spread, start_searches
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.special import log_sum
from tanteo.typing import FloatArray, Transforms

CROWD = 64
"""Parts that are searched in rounds at most."""

GLANCED = 24
"""Points of a glance: more of them tell no more about which part it is likely to be."""

_ROUNDS, _TOLD = 24.0, 12.0
"""Log evidence behind the best up to which a part is searched in rounds, and up to which it is told what its hints lead
to where there is no room for rounds."""

_LEADERS, _SHARED = 3, 3
"""Best parts of which others that are alike are looked at, from so many of their poses."""

_NOTHING = -1e9
"""Log evidence of a part that nothing was found of."""

_AT_ONCE = 256
"""Parts that are open at a time, beside those that are near the best."""


@dataclass(frozen=True, slots=True, eq=False)
class Crowd:
    """Very many parts, after a first look at each.

    Attributes:
        parts: those that are searched in rounds.
        hints: poses of each, if any are known.
        others: searches of others that are near the best, with what their hints lead to.
        dropped: log evidence of all the rest together.
        tail: log of the mean evidence of the less promising half: what a part that was not looked at may have.
    """

    parts: list[PreparedPart]
    hints: list[Transforms | None]
    others: list[PartSearch]
    dropped: float
    tail: float


def after_hints(
    problem: Problem,
    parts: Sequence[PreparedPart],
    hints: Sequence[Transforms | None],
    rng: np.random.Generator,
    alike_parts: Callable[[PreparedPart], list[PreparedPart]],
    *,
    certain: bool,
) -> Crowd:
    """Which of very many parts are searched in rounds.

    Args:
        problem: the question.
        parts: the most promising first.
        hints: poses of each, if any are known.
        rng: of all draws.
        alike_parts: others that were not promising, but are like a part: twins of the best are looked at, too.
        certain: whether the hints are all poses that planes allow.
    """
    rows = spread(problem, GLANCED)
    some = rows.astype(np.int64)
    few = replace(problem, points=problem.points.take(some)) if len(some) < len(problem.points) else problem
    found, searches = _tried(few, parts, hints, rng, certain=certain)
    share = len(problem.points) / max(len(some), 1)  # all points tell parts apart by as much more
    top, half = float(found.max()), found[len(found) // 2 :]
    tail = top + float(log_sum(share * (half - top))) - float(np.log(len(half)))
    parts, hints = list(parts), list(hints)
    for k in np.argsort(-found, kind="stable")[:_LEADERS]:
        if int(k) in searches and found[k] > top - _ROUNDS:
            new = alike_parts(parts[k])
            Ts = searches[int(k)].peaks.Ts[:_SHARED]
            more, found_more = _tried(few, new, [Ts] * len(new), rng)
            searches |= {len(parts) + i: search for i, search in found_more.items()}
            parts, hints, found = parts + new, hints + [Ts] * len(new), np.concatenate([found, more])
    order = np.argsort(-found, kind="stable")
    behind = found[order[0]] - found[order]
    count = min(max(int(np.searchsorted(behind, _ROUNDS)), 1), CROWD)
    told = max(int(np.searchsorted(behind, _TOLD)), count)
    others = [_on_all(problem, few, s) for s in (searches.get(int(k)) for k in order[count:told]) if s is not None]
    dropped = float(found[order[0]]) + float(log_sum(-share * behind[told:]))
    return Crowd([parts[k] for k in order[:count]], [hints[k] for k in order[:count]], others, dropped, tail)


def _tried(
    problem: Problem,
    parts: Sequence[PreparedPart],
    hints: Sequence[Transforms | None],
    rng: np.random.Generator,
    *,
    certain: bool = False,
) -> tuple[FloatArray, dict[int, PartSearch]]:
    """Log evidence that the hints of each part lead to, and the searches of those that are near the best."""
    found, kept = np.full(len(parts), _NOTHING), dict[int, PartSearch]()
    for begin in range(0, len(parts), _AT_ONCE):
        own = [k for k in range(begin, min(begin + _AT_ONCE, len(parts))) if hints[k] is not None]
        for k, search in zip(own, start_searches(problem, [parts[k] for k in own], alike(rng, len(own))), strict=True):
            search.try_poses(np.asarray(hints[k]), certain=certain)
            found[k], kept[k] = max(search.log_evidence, _NOTHING), search
        least = found.max(initial=_NOTHING) - _ROUNDS
        for k in [k for k in kept if found[k] < least]:
            kept.pop(k).objective.prepared.close()
    return found, kept


def _on_all(problem: Problem, few: Problem, search: PartSearch) -> PartSearch:
    """A search with all points from what some of them lead to."""
    if few is problem:
        search.restarts = 1
        return search
    (whole,) = start_searches(problem, [search.objective.prepared], [search.rng])
    found = search.peaks
    whole.peaks, whole.restarts = whole.objective.maximize(found.Ts, found.zs, found.groups, fine=True), 1
    return whole
