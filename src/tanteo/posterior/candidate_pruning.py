"""Candidate pruning by successive halving: optimistic bounds of the log-evidence, and one budget for all parts.

Stages in order of cost, each on the parts that the previous stage left active:

1. sizes: the part is wide enough for the points (``_is_wide_enough``),
2. tables: sensed planes and centres against faces and axes, a bound (``_by_tables``),
3. coarse distance fields: an estimate, and initial poses (``evaluate_fields``),
4. first-pass searches: maximization with a few of the points (``_first_pass``),
5. full searches with restarts, while what they may have missed matters (``_restart``).

A part is pruned if its log-evidence gap to the leader, times the weight of the stage, exceeds ``negligible`` nats, or
if the budget ends. Pruned parts stay in the posterior: their largest possible evidence counts for an object that was
not searched (decision 76), :class:`Unsearched`. Stage 5 ends when most of the probability is in maxima to which several
pairs of points led (Good 1953, Turing's estimate of unseen probability).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.catalogue.signatures import widths
from tanteo.factors import ContactPoints
from tanteo.geometry.limits import NOTABLE, SUSPECT
from tanteo.geometry.special import log_sum, softmax
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.posterior.candidates import Candidates
from tanteo.posterior.outliers import beta_binomial_tail
from tanteo.posterior.part_search import (  # fmt: skip
    PartSearch,
    common_random_numbers,
    leader_of,
    spread,
    start_search,
    start_searches,
)
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals import InitialPoses
from tanteo.posterior.proposals.built_in import (  # fmt: skip
    KnownPoses,
    near_assignments,
    planes_at,
    poses_on_planes,
)
from tanteo.posterior.proposals.centre_votes import lacking, on_axes, sensed_centres
from tanteo.posterior.proposals.coarse_field import evaluate_fields
from tanteo.posterior.proposals.plane_votes import competing, cost_margin, on_planes, voted
from tanteo.posterior.proposals.sensed_planes import SensedPlanes, sensed_planes
from tanteo.posterior.settings import POSE_DOF, Effort
from tanteo.threads import for_each

__all__ = ["Active", "PartSearch", "Unsearched", "prune", "screen", "start_search", "still_active"]

_NONE = float(np.finfo(np.float32).min)
"""Log-evidence of a part of which no maximum was found."""

_ROUND_OFF = 1.02
"""Numerical: largest ratio of a mean width over all directions to the mean over 256 of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Active:
    """Active parts, and a bound of the evidence of the pruned parts.

    Attributes:
        rows: rows of the parts that are searched ``(m,)``, the most promising first.
        known: initial poses by row.
        gaps: cost gap of each part to the best, by tables and fields ``(m,)`` [nats].
        unsearched: log of the largest possible evidence of all pruned parts, over that of the best part; -inf for none.
        others: rows of the pruned parts that are wide enough for the points.
        exhaustive: whether the known poses are all poses that planes and centres allow.
        pruned_by_properties: number of parts that were pruned by their global properties alone.
        discount: log of the mean odds of pruned parts by global properties, over that of the less promising active
            half.
        bound: whether the gaps are bounds; otherwise coarse fields estimate them.
    """

    rows: IntArray
    known: dict[int, Transforms] = field(default_factory=dict)
    gaps: FloatArray = field(default_factory=lambda: np.zeros(0))
    unsearched: float = -np.inf
    others: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    exhaustive: bool = False
    pruned_by_properties: int = 0
    discount: float = 0.0
    bound: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Unsearched:
    """Parts that are not searched.

    Attributes:
        count: number of parts that are not searched.
        log_ratio: log of their total evidence over that of the best part; None if the less promising parts estimate it.
        discount: log of their mean odds by global properties, over that of the less promising searched parts.
        similar: function that returns the unsearched parts that are similar to a part.
        untried: whether no pose of these parts was tried, so that they may explain as much as an unknown object.
    """

    count: int = 0
    log_ratio: float | None = None
    discount: float = 0.0
    similar: Callable[[PreparedPart], list[PreparedPart]] = lambda part: []
    untried: bool = False

    def log_evidence(self, best: float, tail: float) -> float:
        """Return the largest log-evidence that these parts have together.

        Args:
            best: log-evidence of the best part.
            tail: log of the mean evidence of less promising parts.
        """
        if not self.count:
            return -np.inf
        return best + self.log_ratio if self.log_ratio is not None else tail + float(np.log(self.count)) + self.discount


def screen(problem: Problem, candidates: Candidates, odds: FloatArray | None = None, *, every: bool = False) -> Active:
    """Prune parts by catalogue data alone, without opening a part: sizes, tables, coarse fields.

    Args:
        problem: measurements and priors.
        candidates: all parts.
        odds: log odds of each by its global properties ``(n,)``.
        every: whether to evaluate the fields of all parts, also of those with low log odds.
    """
    points, few = problem.points.take(problem.furniture.others), problem.settings.pruning.budget
    rows = np.flatnonzero(_is_large_enough(points, candidates))
    too_few_points = len(points) < 3 and not points.centres.any()
    if len(rows) > few and not too_few_points:
        rows = rows[_is_wide_enough(problem, points, candidates, rows)]
    own = np.zeros(len(candidates)) if odds is None else odds
    if len(rows) <= few or too_few_points:
        return _few(problem, points, candidates, rows)
    near = np.ones(len(rows), dtype=bool) if every else _is_probable(problem, own[rows])
    tables = _by_tables(problem, points, candidates, rows)
    # the points on the surface are enough to discriminate parts by their fields
    if not tables.exhaustive and (np.count_nonzero(~points.centres) >= POSE_DOF - 1 or len(tables.planes.triples)):
        _by_fields(problem, points, candidates, rows, near, tables)
    tables.costs = tables.costs - own[rows]
    found = _promising(problem, rows, tables)
    if found.bound or odds is None or not len(found.others):
        return found
    half = found.rows[len(found.rows) // 2 :]
    discount = float(log_sum(odds[found.others]) - log_sum(odds[half]) + np.log(len(half) / len(found.others)))
    return replace(found, pruned_by_properties=int(np.count_nonzero(~near)), discount=discount)


def _few(problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray) -> Active:
    """Keep a handful of parts, and propose poses of each on its coarse field.

    Tables do not prune these. Their costs ignore areas of faces, by which few points discriminate parts, and the
    evidence of a label for an unknown object (decision 88).
    """
    known = dict[int, Transforms]()
    if np.count_nonzero(~points.centres) >= POSE_DOF - 1 and len(rows):
        _, known = evaluate_fields(problem, points, candidates, rows, thorough=True)
    return Active(rows, known, np.zeros(len(rows)))


def _is_probable(problem: Problem, odds: FloatArray) -> BoolArray:
    """Return which parts are evaluated on their fields, by their log odds ``(m,)``."""
    own, order = problem.settings.pruning, np.argsort(odds, kind="stable")
    out = np.ones(len(odds), dtype=bool)
    out[order[np.cumsum(softmax(odds)[order]) <= own.pruned_by_size]] = False
    return out | (odds > odds.max() - own.size_margin)


@dataclass(slots=True, eq=False)
class _Costs:
    """Costs of parts [nats], poses by row, and whether the poses are exhaustive and the costs are bounds."""

    planes: SensedPlanes
    costs: FloatArray
    known: dict[int, Transforms] = field(default_factory=dict)
    exhaustive: bool = False
    bound: bool = True


def _by_tables(problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray) -> _Costs:
    """Return costs and poses by sensed planes and centres against faces and axes."""
    own, planes = problem.settings.pruning, sensed_planes(problem, points)
    found = _Costs(planes, np.zeros(len(rows)))
    if len(planes.triples):
        # keep poses up to the gap beyond which all parts together are negligible
        together = float(np.log(len(rows) / problem.settings.samples.min_probability))
        far = max(cost_margin(problem.settings), together / own.table_weight)
        found.costs, found.known = on_planes(planes, candidates, rows, far)
        found.exhaustive = bool(found.costs.min() < planes.believed)
    else:
        found.costs = voted(planes, candidates, rows)
    if points.centres.any():
        centres = sensed_centres(problem, points, planes)
        found.costs += lacking(centres, candidates, rows)
        if len(centres.seeds):
            on_axes(centres, candidates, rows, found.costs, found.known)
            found.exhaustive |= centres.certain and float(found.costs.min()) < centres.hopeless
    return found


def _by_fields(
    problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray, near: BoolArray, found: _Costs
) -> None:
    """Estimate costs and poses by coarse fields, only of parts that are probable (``near``) by global properties."""
    found.bound = False
    if len(found.planes.triples):
        rough, others = evaluate_fields(problem, points, candidates, rows)  # normals may be on curved faces
        found.costs, found.known = np.minimum(found.costs, rough), others | found.known
        return
    some = near & (found.costs < found.costs[near].min() + cost_margin(problem.settings))
    rough, poses = evaluate_fields(problem, points, candidates, rows[some])
    found.costs[some] = np.maximum(found.costs[some], rough)
    found.costs[~some] += rough.max(initial=0.0)
    found.known = poses | found.known


def _promising(problem: Problem, rows: IntArray, found: _Costs) -> Active:
    """Return the parts near the best, as many as the budget allows, and a bound of the others."""
    own, margin = problem.settings.pruning, problem.settings.search.negligible
    order = np.argsort(found.costs, kind="stable")
    gaps = found.costs[order] - found.costs[order[0]]
    weight, least = (own.table_weight, 1) if found.bound else (own.estimate_weight, own.least)
    rest = np.cumsum(np.exp(-weight * gaps)[::-1])[::-1]  # of each part and all worse ones
    count = min(
        int(np.searchsorted(weight * gaps, margin)),
        int(np.searchsorted(-rest, -problem.settings.samples.min_probability)),
    )
    if found.bound and not found.exhaustive:
        count = count if count <= own.budget else own.unfixed  # the answer will be ambiguous
    elif count > own.first_passes:
        count = own.least if found.bound and rest[own.first_passes] > 1 else own.first_passes
    count = min(max(count, min(least, int(np.searchsorted(gaps, 3 * margin))), 1), len(rows))
    kept, left = rows[order[:count]], float(np.log(rest[count])) if count < len(rows) else -np.inf
    known = {int(row): found.known[int(row)] for row in kept if int(row) in found.known}
    return Active(kept, known, gaps[:count], left, rows[order[count:]], exhaustive=found.exhaustive, bound=found.bound)


def _is_large_enough(points: ContactPoints, candidates: Candidates) -> BoolArray:
    """Return whether each part is at least as large as the spread of three quarters of the points ``(n,)``.

    Centres at any height of an axis do not count.
    """
    points = points.take(np.flatnonzero(points.placed))
    if not len(points):
        return np.ones(len(candidates), dtype=np.bool_)
    centre = np.median(points.points, axis=0)
    reach = np.sort(np.linalg.norm(points.points - centre, axis=1) - 4 * points.sd - points.radii)
    shared = 4 * np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1))
    return np.asarray(reach[int(0.75 * (len(reach) - 1))] - shared <= candidates.diagonals)


def _is_wide_enough(problem: Problem, points: ContactPoints, candidates: Candidates, rows: IntArray) -> BoolArray:
    """Return whether the widths of each part are at least those of the points without possible outliers ``(m,)``.

    Centres do not count: they may be beyond the end of their hole.
    """
    points = points.take(np.flatnonzero(~points.centres))
    own, rate, n = problem.settings, problem.priors.outlier_rate, len(points)
    if n < 3:
        return np.ones(len(rows), dtype=bool)
    outliers = next(k for k in range(n + 1) if beta_binomial_tail(k + 1, n, rate) < SUSPECT)
    if n - outliers < 3:
        return np.ones(len(rows), dtype=bool)
    away = np.linalg.norm(points.points - np.median(points.points, axis=0), axis=1)
    some = np.sort(np.argsort(away, kind="stable")[: n - outliers])
    factor = float(np.exp(problem.scale_sd)) if problem.scale_sd else 1.0
    slack = 2 * float((own.search.gate * factor * points.sd + points.radii)[some].max())
    slack += 8 * float(np.sqrt(np.sum(points.shared_jacobian**2) / n))
    least = widths(points.points[some]) - slack
    diameters, means = np.concatenate([np.asarray(t["numbers"])[:, 3:5] for _, t in candidates.tables])[rows].T
    return np.asarray((diameters >= least[0]) & (_ROUND_OFF * means >= least[1]))


def prune(
    problem: Problem,
    parts: Sequence[PreparedPart],
    log_unknown: float,
    rng: np.random.Generator,
    known: Sequence[Transforms | None],
    *,
    exhaustive: bool,
    unsearched: Unsearched | None,
) -> tuple[list[PartSearch], float]:
    """Search each part while it may still change the posterior.

    Args:
        problem: measurements and priors.
        parts: the parts, the most promising first.
        log_unknown: log-evidence of the unknown object, over the prior of one part.
        rng: generator of all draws.
        known: initial poses of each part; None without initial poses.
        exhaustive: whether the initial poses are all poses that labels and normals allow.
        unsearched: the parts that are not searched; None if all are.

    Returns:
        The searches, and the largest possible log-evidence of all parts without a search.
    """
    unsearched, margin = unsearched or Unsearched(), problem.settings.search.negligible
    start = _first_pass(problem, parts, known, rng, unsearched.similar, exhaustive=exhaustive)
    searches, live = start.searches, list(start.live)
    if not exhaustive or not max(searches, key=lambda s: s.log_evidence).is_good_fit():
        second = problem.settings.second_pass
        wide = margin / problem.settings.pruning.estimate_weight
        for batch in _batches(sorted(live, key=lambda s: -s.log_evidence)):
            # once one explains the points, others may be pruned
            near = batch if len(live) == 1 else [s for s in batch if s in still_active(live, log_unknown, wide)]
            _restart_all(near, searches, second)
    _pass_on(live)
    if not _may_be_missed(problem, searches):
        live = still_active(live, log_unknown, margin)
    elif len(searches) <= problem.settings.pruning.unfixed:
        live = list(searches)
    points = problem.points
    if points.constrained >= POSE_DOF or 2 * int(points.oriented.sum()) >= POSE_DOF:
        _restart(searches, live, log_unknown)
        _pass_on(searches)  # a later round may have found the leader
    searches = searches + start.others
    top = max([log_unknown if unsearched.untried else -np.inf, *(s.log_evidence for s in searches)])
    return searches, float(log_sum([start.dropped, unsearched.log_evidence(top, start.tail)]))


@dataclass(frozen=True, slots=True, eq=False)
class _Start:
    """Result of the first-pass searches.

    Attributes:
        searches: searches of all parts that the budget allows full searches of.
        live: searches of the active parts.
        others: searches of further parts near the best, for which the budget allows no full search.
        dropped: log-evidence of all other parts together.
        tail: log of the mean evidence of the less promising half, an estimate for a part without a search.
    """

    searches: list[PartSearch]
    live: list[PartSearch]
    others: list[PartSearch] = field(default_factory=list)
    dropped: float = -np.inf
    tail: float = -np.inf


def _first_pass(
    problem: Problem,
    parts: Sequence[PreparedPart],
    known: Sequence[Transforms | None],
    rng: np.random.Generator,
    similar: Callable[[PreparedPart], list[PreparedPart]],
    *,
    exhaustive: bool,
) -> _Start:
    """Search each part with the same few points, and continue the active parts with all points.

    The unknown object does not compete yet, because a first pass often misses the pose of the right part.
    """
    others, dropped, tail = list[PartSearch](), -np.inf, -np.inf
    if len(parts) > problem.settings.pruning.budget:
        parts, known, others, dropped, tail = _prune_by_known_poses(
            problem, parts, known, rng, similar, exhaustive=exhaustive
        )
    searches = start_searches(problem, parts, common_random_numbers(rng, len(parts)))
    for search, Ts in zip(searches, known, strict=False):
        search.known, search.exhaustive = Ts, exhaustive
    if len(parts) == 1:
        return _Start(searches, searches, others, dropped, tail)
    few, passes = _with_few_points(problem), searches
    if few is not problem:
        passes = start_searches(few, parts, [s.rng for s in searches])
        passes = [replace(p, planes=s.planes, known=s.known, exhaustive=s.exhaustive)
                  for p, s in zip(passes, searches, strict=True)]  # fmt: skip
    effort = problem.settings.first_pass
    if exhaustive or any(Ts is not None for Ts in known):
        effort = replace(effort, pairs=0)
    if not exhaustive and passes and len(passes[0].planes.triples):
        planes = competing(passes[0].planes, parts, problem.settings)
        for one in (*passes, *searches):
            one.planes = planes
    order = np.argsort(for_each(PartSearch.known_cost, passes), kind="stable")
    for batch in _batches([passes[k] for k in order]):  # a leader saves maximizations of others
        _restart_all(batch, passes, effort)
    _pass_on(passes)
    margin = problem.settings.search.negligible / problem.settings.pruning.estimate_weight
    active = {id(one) for one in still_active(passes, -np.inf, margin)}
    kept = [(search, one) for search, one in zip(searches, passes, strict=True) if id(one) in active]
    if few is not problem:
        for_each(lambda both: _continue_with_all(*both), kept)
        for search, one in zip(searches, passes, strict=True):
            if id(one) not in active:
                search.take_tried(one)
    return _Start(searches, [search for search, _ in kept], others, dropped, tail)


def _with_few_points(problem: Problem) -> Problem:
    """Return the problem with a few points that are far from each other."""
    rows = spread(problem, problem.settings.search.few_points).astype(np.int64)
    return replace(problem, points=problem.points.take(rows)) if len(rows) < len(problem.points) else problem


def _continue_with_all(search: PartSearch, few: PartSearch) -> None:
    """Continue with all points from the maxima of a few."""
    found = few.peaks
    search.peaks, search.restarts = search.objective.maximize(found.Ts, found.zs, found.groups, fine=True), 1


_Pruned = tuple[list[PreparedPart], list[Transforms | None], list[PartSearch], float, float]


def _prune_by_known_poses(
    problem: Problem,
    parts: Sequence[PreparedPart],
    known: Sequence[Transforms | None],
    rng: np.random.Generator,
    similar: Callable[[PreparedPart], list[PreparedPart]],
    *,
    exhaustive: bool,
) -> _Pruned:
    """Prune parts to the number of full searches in the budget, by maximization from their known poses.

    Returns:
        Parts and known poses that are searched in full; searches of others near the best; log-evidence of all the rest;
        log of the mean evidence of the less promising half.
    """
    own, few = problem.settings.pruning, _with_few_points(problem)
    margin = problem.settings.search.negligible
    found, searches = _from_known_poses(few, parts, known, rng, exhaustive=exhaustive)
    share = len(problem.points) / max(len(few.points), 1)  # gaps grow with the number of points
    top, half = float(found.max()), found[len(found) // 2 :]
    tail = top + float(log_sum(share * (half - top))) - float(np.log(len(half)))
    parts, known = list(parts), list(known)
    for k in np.argsort(-found, kind="stable")[: own.leaders]:
        if int(k) in searches and found[k] > top - margin / own.estimate_weight:
            new = similar(parts[k])
            Ts = searches[int(k)].peaks.Ts[: own.leaders]
            more, found_more = _from_known_poses(few, new, [Ts] * len(new), rng)
            searches |= {len(parts) + i: search for i, search in found_more.items()}
            parts, known, found = parts + new, known + [Ts] * len(new), np.concatenate([found, more])
    order = np.argsort(-found, kind="stable")
    gaps = found[order[0]] - found[order]
    count = min(max(int(np.searchsorted(gaps, margin / own.estimate_weight)), 1), own.budget)
    reported = max(int(np.searchsorted(gaps, margin)), count)
    others = []
    for search in (searches.get(int(k)) for k in order[count:reported]):
        if search is None:
            continue
        if few is problem:
            search.restarts = 1
            others.append(search)
            continue
        (whole,) = start_searches(problem, [search.objective.prepared], [search.rng])
        _continue_with_all(whole, search)
        others.append(whole)
    dropped = float(found[order[0]]) + float(log_sum(-share * gaps[reported:]))
    return [parts[k] for k in order[:count]], [known[k] for k in order[:count]], others, dropped, tail


def _from_known_poses(
    problem: Problem,
    parts: Sequence[PreparedPart],
    known: Sequence[Transforms | None],
    rng: np.random.Generator,
    *,
    exhaustive: bool = False,
) -> tuple[FloatArray, dict[int, PartSearch]]:
    """Return the log-evidence of each part by its known poses ``(n,)``, and the searches of parts near the best."""
    own = problem.settings
    found, kept, proposer = np.full(len(parts), _NONE), dict[int, PartSearch](), KnownPoses()
    together = 4 * own.pruning.budget  # parts that are open at a time, in addition to those near the best
    for begin in range(0, len(parts), together):
        some = [k for k in range(begin, min(begin + together, len(parts))) if known[k] is not None]
        searches = start_searches(problem, [parts[k] for k in some], common_random_numbers(rng, len(some)))
        for k, search in zip(some, searches, strict=True):
            search.known, search.exhaustive = known[k], exhaustive
        for_each(lambda search: search.propose(proposer), searches)
        for k, search in zip(some, searches, strict=True):
            found[k], kept[k] = max(search.log_evidence, _NONE), search
        least = found.max(initial=_NONE) - own.search.negligible / own.pruning.estimate_weight
        for k in [k for k in kept if found[k] < least]:
            kept.pop(k).objective.prepared.close()
    return found, kept


def _restart(searches: Sequence[PartSearch], live: list[PartSearch], log_unknown: float) -> None:
    """Carry out more rounds of active parts, while missed maxima may matter.

    Touches of a small region fit many places of many parts, and a wrong part fits at a larger noise. The search of the
    right one often reaches its maximum only after several rounds, so all parts get as many as a leader. Otherwise the
    parts share a number of rounds, and those with the largest missed evidence get them.
    """
    count, own = len(live), live[0].settings if live else None
    while live and own is not None:
        total = float(log_sum([s.log_evidence for s in searches]))
        best = max(live, key=lambda s: s.log_evidence)
        may_be_missed = _may_be_missed(live[0].objective.problem, live)
        budget = max(own.rounds // 2 * count, own.most_rounds)
        if may_be_missed and count <= best.objective.problem.settings.pruning.unfixed:
            budget = max(budget, own.rounds * count)
        # as long as no part is sure, missed maxima that are less than its uncertainty do not change the answer
        is_sure = best.log_evidence > np.logaddexp(total, log_unknown) + np.log1p(-2 * NOTABLE)
        enough = float(np.log(own.missing if is_sure else own.missing_unsure))
        decisive = [
            s
            for s in live
            if s.restarts < (own.rounds if s.is_ridge() or s.log_evidence < log_unknown else own.most_rounds)
            and s.log_missed(total + enough) > total + enough
        ]
        doubtful = best.restarts < 1.5 * own.rounds and (best.is_doubtful() or best.is_noisy())
        if doubtful and best not in decisive:
            decisive.append(best)
        others = [
            s
            for s in live
            if may_be_missed and s not in decisive and s.restarts < own.rounds
            and (s.log_missed(s.log_evidence + enough) > s.log_evidence + enough or not len(s.peaks))
        ]  # fmt: skip
        spent = sum(min(s.restarts, own.rounds) for s in live) + len(decisive)
        others = sorted(others, key=lambda s: -s.log_missed())[: max(budget - spent, 0)]
        left = decisive + others
        _restart_all(left, searches)
        if not left:
            break
        if not may_be_missed:
            live = [s for s in live if s.log_evidence > max(log_unknown, best.log_evidence) - own.negligible]


def _batches(order: Sequence[PartSearch]) -> Iterator[Sequence[PartSearch]]:
    """Yield parts in batches that double: the first part alone, since a leader saves maximizations of all others."""
    begin, count = 0, 1
    while begin < len(order):
        yield order[begin : begin + count]
        begin, count = begin + count, 2 * count


def _restart_all(batch: Sequence[PartSearch], searches: Sequence[PartSearch], effort: Effort | None = None) -> None:
    """Carry out one more round of some parts, each compared to the leader of all parts before the batch."""
    leader = leader_of(searches)
    for_each(lambda search: search.restart(effort, leader), batch)


def _may_be_missed(problem: Problem, searches: Sequence[PartSearch]) -> bool:
    """Return whether a part that is far behind the leader may have a maximum that its search has missed."""
    best = max(searches, key=lambda s: s.log_evidence, default=None)
    if best is None:
        return False
    region = problem.region.area
    return 0 < region < 0.5 * best.objective.prepared.part.area or best.is_noisy() or not best.is_good_fit()


def still_active(searches: Sequence[PartSearch], log_unknown: float, margin: float) -> list[PartSearch]:
    """Return parts within a margin of the leader; at least half of all if the leader does not explain the points.

    Many precise points discriminate poses by hundreds of nats: after a first pass the gap of the right part may be
    large.
    """
    order = sorted(searches, key=lambda s: -s.log_evidence)
    lead = max([log_unknown, *(s.log_evidence for s in order)])
    half = 0 if not order or order[0].is_good_fit() else (len(order) + 1) // 2
    kept = {id(s) for k, s in enumerate(order) if k < half or s.log_evidence > lead - margin}
    return [s for s in searches if id(s) in kept]


def _pass_on(searches: Sequence[PartSearch]) -> None:
    """Try the best poses of the leading parts on the others, and poses of all with the same planes on other faces.

    Twins and variants share their frames. Mirrored and nearly symmetric ones have the touched planes on other faces. Of
    a thin wall, points without a direction may be on either side. As all such poses are tried, their maxima are found
    as surely as that of the leader.
    """
    order = sorted((s for s in searches if len(s.peaks)), key=lambda s: -s.log_evidence)
    if not order:
        return
    own, top = order[0].objective.problem.settings, order[0].log_evidence
    least = top - own.search.negligible / own.pruning.estimate_weight
    order = [s for s in order[: own.pruning.leaders] if s.log_evidence > least]
    leading = [(s.objective, s.peaks.take(np.zeros(1, dtype=np.int64))) for s in order]
    planes = for_each(lambda one: planes_at(*one), leading)
    leader = leader_of(order)

    def try_on(search: PartSearch) -> None:
        counted, own_objective = search.log_evidence > top - own.search.negligible, search.objective
        left = [k for k, (other, best) in enumerate(leading) if not search.has_tried(other, best, counted=counted)]
        poses = [
            InitialPoses(leading[k][1].Ts, leading[k][1].groups) for k in left if leading[k][0] is not own_objective
        ]
        for k in left:
            Ts = poses_on_planes(planes[k], own_objective)
            poses.append(InitialPoses(Ts, np.full(len(Ts), leading[k][1].groups[0])))
        if poses:
            search.add(InitialPoses.joined(poses), search.most_if_improbable(leader), leader)
        while any(search is one for one in order) and not search.is_ridge() and len(new := search.not_reassigned()):
            search.add(near_assignments(own_objective, new, float(own_objective.scales.refine[-1])), None, leader)

    for_each(try_on, searches)
