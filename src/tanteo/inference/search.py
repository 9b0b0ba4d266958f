"""The search: parts race in rounds of proposals until no pose that matters is likely to be missing.

What several pairs of points lead to again and again is likely all there is; what one pair alone led to says that more
of its kind was not found. The probability of what was found rarely estimates what is missing (Good and Turing 1953).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.inference.details import belongs_at
from tanteo.inference.hole_tuples import from_centres
from tanteo.inference.label_tuples import Planes, from_labels, labelled_planes
from tanteo.inference.peaks import Objective, Peaks
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.prior_samples import RIDGE, along_ridge, sample_prior
from tanteo.inference.problem import Problem
from tanteo.inference.proposals import (
    FEW,
    Effort,
    far_pairs,
    from_pairs,
    from_prior,
    moved,
    scales_for,
    scores_of,
    spread_rows,
)
from tanteo.inference.symmetry import log_orbit
from tanteo.special import log_sum
from tanteo.typing import BoolArray, Indices, Transforms

_MISSING, _OFTEN = 0.02, 4
"""Probability of what fewer pairs of points led to up to which a part is taken as searched: a pose as easy to find as
one to which four pairs led is missed in one of sixteen searches."""

_BITS, _CERTAIN = 60, 0b1111
"""Groups of pairs and samples that count as separate; what labels lead to counts as found by several."""

_ROUNDS, _DOUBTFUL, _TOGETHER, _LEAST_ROUNDS = 8, 12, 24, 4
"""Rounds of a part at most, and where its best pose leaves points out that it should not: of few precise points a round
finds the right one with a third or more of probability. So many of all parts together that are still in, but no fewer
of each than the last."""

_PAIRS = 12
"""Pairs of points that are proposed from."""

_GLANCE, _LOOK = Effort(6, 16, 3, 8, hard=0), Effort(move=3, hard=3)
"""First rounds of many parts."""

_GLANCED = 24
"""Points of a glance: more of them tell no more about which part it is likely to be."""

_BEHIND = (24.0, 12.0)
"""Log evidence behind the leader, the unknown object included, at which a part is out after each of these."""

_EXPLAINED = 0.9
"""Share of the points that the leader has to have on it before parts far behind it are out: outliers are fewer."""

_UNUSUAL, _FEW = 2.0, 20
"""Standard deviations of the number of outliers over its mean that are too many; of so few points, any is."""

_MOST = 40
"""Maxima kept of a part."""

_BEST = 3
"""Leading parts of which the best pose is tried on the others."""

_CROWD = 64
"""Parts that are glanced at; of more of them, those whose hints lead farthest."""

_NOTHING = -1e9
"""Log evidence of what was not found."""

_FIXED, _ORIENTED = 6, 3
"""So many points fix a pose, of which centres of circles count twice, or so many sensed normals."""


@dataclass(slots=True, eq=False)
class PartSearch:
    """The search for one part, round by round.

    Attributes:
        objective: leads from poses to maxima.
        pairs: of points from which proposals are made, a few each round.
        rng: of all draws.
        peaks: maxima so far.
        planes: of the labels.
        restarts: so far.
        along: poses on a ridge of the posterior that are no maxima, as bases of the sampler; None without.
        trusted: whether the region of its maximum was normal before the last measurement.
        hints: poses to begin with; None without.
    """

    objective: Objective
    pairs: Indices
    rng: np.random.Generator
    peaks: Peaks
    planes: Planes
    restarts: int = 0
    along: Peaks | None = None
    trusted: bool = False
    hints: Transforms | None = None

    @property
    def log_evidence(self) -> float:
        """Of all maxima, poses that symmetry makes one included, relative to what the core leaves out of the prior."""
        return self._constant + float(log_sum(self.peaks.evidence)) if len(self.peaks) else -np.inf

    def log_rare(self, times: int = _OFTEN) -> float:
        """Of those to which fewer pairs of points led."""
        rare = self.peaks.evidence[self.peaks.times < times]
        return self._constant + float(log_sum(rare)) if len(rare) else -np.inf

    @property
    def _constant(self) -> float:
        prepared = self.objective.prepared
        orbit = log_orbit(prepared, named=self.objective.named)
        return self.objective.problem.log_pose_density(prepared) + orbit

    def restart(self, effort: Effort) -> None:
        """Propose from pairs of points, which know nothing of each other; settle, maximize, merge."""
        if self.restarts:  # the points that are farthest apart may be outliers: later rounds take others
            self._take_other_points()
        objective, k, count = self.objective, self.restarts, min(effort.pairs, len(self.pairs))
        each = replace(effort, per_pair=effort.per_pair * effort.pairs // max(count, 1))  # few points have few pairs
        poses, groups = [self._of_labels(effort.maximize)], [_CERTAIN]
        for i in range(count):
            pair = np.ascontiguousarray(self.pairs[[(k * count + i) % len(self.pairs)]])
            seed = int(self.rng.integers(2**63))
            poses.append(
                from_pairs(objective.core, objective.prepared, objective.rows, pair, objective.scales, each, seed)
            )
            groups.append(1 << ((k * count + i) % _BITS))
        of = np.repeat(np.array(groups, dtype=np.int64), [len(Ts) for Ts in poses])
        self.peaks = objective.merged(self.peaks, objective.look(np.concatenate(poses), of, effort.maximize), _MOST)
        self._of_centres()
        if self.hints is not None and not self.restarts:
            self.try_poses(self.hints)
        self.sample(effort.maximize)
        hard = bool(effort.hard) and (len(objective.scales.blurs) > 1 or self.doubtful())
        move = effort.hard if hard else effort.move
        if len(self.peaks) and move:
            self.try_poses(moved(objective.prepared, self.peaks.Ts[:move], self.rng))
        self.restarts += 1

    def _take_other_points(self) -> None:
        """Propose from other points, settle on them."""
        points, others = self.objective.problem.points, self.objective.problem.around.others
        if len(others) <= FEW:
            return
        rows = np.sort(self.rng.choice(others, FEW, replace=False)).astype(np.int32)
        self.objective, self.pairs = replace(self.objective, rows=rows), far_pairs(points, rows, _PAIRS)

    def _of_labels(self, count: int) -> Transforms:
        """Poses that put labelled planes on faces, those that the points are near: once, for they are all there are."""
        objective = self.objective
        if self.restarts or not len(objective.rows):
            return np.zeros((0, 4, 4))
        Ts = np.ascontiguousarray(from_labels(self.planes, objective.prepared))
        if not len(Ts):
            return Ts
        costs = scores_of(objective.core, objective.prepared, objective.rows, Ts, objective.scales)
        return Ts[np.argsort(costs, kind="stable")[:count]]

    def _of_centres(self) -> None:
        """Maximize from poses that put centres on axes of holes and bosses: once, and unblurred, for they are near."""
        objective = self.objective
        if self.restarts:
            return
        Ts = from_centres(objective.problem.points, objective.core, objective.prepared)
        found = objective.maximize(Ts, groups=np.full(len(Ts), _CERTAIN, dtype=np.int64), fine=True)
        self.peaks = objective.merged(self.peaks, found, _MOST)

    def sample(self, count: int) -> None:
        """Maximize from samples of the pose prior, each a group of its own; and follow the ridge it lies on."""
        objective = self.objective
        if not objective.named:
            return
        groups = np.left_shift(1, self.rng.integers(_BITS, size=count))
        self.peaks = objective.merged(self.peaks, sample_prior(objective, groups, self.rng), _MOST)
        if self.along is None:
            self.along = along_ridge(objective, from_prior(objective.problem, objective.prepared, RIDGE, self.rng))

    def try_poses(self, Ts: Transforms) -> None:
        """Maximize from poses that no points proposed; what they lead to still has to be found."""
        if not len(Ts):
            return
        found = self.objective.look(Ts, np.zeros(len(Ts), dtype=np.int64), len(Ts))
        self.peaks = self.objective.merged(self.peaks, found, _MOST)

    def on_the_part(self) -> BoolArray:
        """Which points the best maximum has on the part ``(m,)``, those on furniture aside; none without a maximum."""
        others = self.objective.problem.around.others
        if not len(others) or not len(self.peaks):
            return np.zeros(len(others), dtype=bool)
        return np.asarray(belongs_at(self.objective, self.peaks, 1)[0, others] > 0.5)

    def is_good_fit(self) -> bool:
        """Whether the best maximum has nine of ten points on the part, or there is nothing to explain."""
        on = self.on_the_part()
        return not len(on) or float(on.mean()) > _EXPLAINED

    def doubtful(self) -> bool:
        """Whether the best maximum calls more points outliers than are expected, which may have hidden a better one."""
        on, rate = self.on_the_part(), self.objective.problem.priors.outlier_rate
        expected = len(on) * rate + _UNUSUAL * np.sqrt(len(on) * rate) if len(on) > _FEW else 0.0
        return len(self.peaks) > 0 and float(np.sum(~on)) > expected


def start_search(problem: Problem, prepared: PreparedPart, rng: np.random.Generator) -> PartSearch:
    """Before the first round."""
    return start_searches(problem, [prepared], [rng])[0]


def start_searches(
    problem: Problem, parts: Sequence[PreparedPart], rngs: Sequence[np.random.Generator]
) -> list[PartSearch]:
    """The same for several parts: what is of the points alone is found once."""
    rows, planes = _spread(problem, FEW), labelled_planes(problem.points)
    pairs, none = far_pairs(problem.points, rows, _PAIRS), Peaks.none(problem.states)
    out = []
    for part, rng in zip(parts, rngs, strict=True):
        objective = Objective(part, problem.compiled(part), problem, scales_for(problem, part), rows)
        out.append(PartSearch(objective, pairs, rng, none, planes))
    return out


def _spread(problem: Problem, count: int) -> Indices:
    """Rows of points far from each other, which are not of furniture."""
    others = problem.around.others
    return others[spread_rows(problem.points.take(others), count)].astype(np.int32)


def race(
    problem: Problem,
    parts: Sequence[PreparedPart],
    log_unknown: float,
    rng: np.random.Generator,
    hints: Sequence[Transforms | None] = (),
) -> tuple[list[PartSearch], float]:
    """Search all parts, each as long as it may matter.

    Args:
        problem: the question.
        parts: large enough for the measurements.
        log_unknown: log evidence of the unknown object, over the prior of one part.
        rng: of all draws.
        hints: poses of each to begin with, if any are known.

    Returns:
        The searches, and the log evidence of all parts that were given up for others after their hints alone.
    """
    begun = list(hints) or [None] * len(parts)
    parts, begun, dropped = _after_hints(problem, parts, begun, rng)
    searches = start_searches(problem, parts, alike(rng, len(parts)))
    for search, Ts in zip(searches, begun, strict=True):
        search.hints = Ts
    live = _after_a_glance(searches) if len(parts) > 1 else list(searches)
    for search in sorted(live, key=lambda s: -s.log_evidence):  # once one explains the points, others may be out
        if len(live) == 1 or search in _still_in(live, log_unknown, _BEHIND[0]):
            search.restart(_LOOK)
    _try_on_others(live)
    live = _still_in(live, log_unknown, _BEHIND[1])
    points = problem.points
    fixed = len(points) + np.count_nonzero(points.centres) >= _FIXED or int(points.oriented.sum()) >= _ORIENTED
    while live and fixed:
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
    return searches, dropped


def _after_hints(
    problem: Problem, parts: Sequence[PreparedPart], hints: Sequence[Transforms | None], rng: np.random.Generator
) -> tuple[list[PreparedPart], list[Transforms | None], float]:
    """Of very many parts those whose hints lead to the best maxima, and what the others explain together."""
    if len(parts) <= _CROWD:
        return list(parts), list(hints), -np.inf
    rows = _spread(problem, _GLANCED)
    few = replace(problem, points=problem.points.take(rows.astype(np.int64)))
    found = np.full(len(parts), -np.inf)
    some = [k for k, Ts in enumerate(hints) if Ts is not None]
    for k, search in zip(some, start_searches(few, [parts[k] for k in some], alike(rng, len(some))), strict=True):
        search.try_poses(np.asarray(hints[k]))
        found[k] = search.log_evidence
    top = max(float(found.max()), _NOTHING)
    order = np.argsort(-found, kind="stable")
    near = int(np.sum(found > top - _BEHIND[0]))
    kept, others = order[: min(max(near, 1), _CROWD)], order[min(max(near, 1), _CROWD) :]
    share = len(problem.points) / max(len(rows), 1)  # all points tell parts apart by as much more
    dropped = top + float(log_sum(share * (found[others] - top))) if len(others) else -np.inf
    return [parts[k] for k in kept], [hints[k] for k in kept], dropped


def _after_a_glance(searches: Sequence[PartSearch]) -> list[PartSearch]:
    """Which parts are still in after a glance at each: with a few of many points, which is as fair to all of them.

    The unknown object is no rival yet: a glance misses the pose of the right part often.
    """
    problem = searches[0].objective.problem
    rows = _spread(problem, _GLANCED)
    glances = list(searches)
    if len(rows) < len(problem.points):
        few = replace(problem, points=problem.points.take(rows.astype(np.int64)))
        glances = start_searches(few, [s.objective.prepared for s in searches], [s.rng for s in searches])
        glances = [replace(g, planes=s.planes, hints=s.hints) for g, s in zip(glances, searches, strict=True)]
    for glance in glances:
        glance.restart(_GLANCE)
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


def alike(rng: np.random.Generator, count: int) -> list[np.random.Generator]:
    """As many generators, all of which draw the same: what tells parts apart is not their luck."""
    seed = int(rng.integers(2**63))
    return [np.random.default_rng(seed) for _ in range(count)]


def missing(searches: Sequence[PartSearch]) -> float:
    """Share of the probability of all parts that was found only once."""
    total = float(log_sum([s.log_evidence for s in searches])) if searches else -np.inf
    once = float(log_sum([s.log_rare(2) for s in searches])) if searches else -np.inf
    return float(np.exp(once - total)) if np.isfinite(total) else 0.0
