"""Search for one part in rounds: initial poses, maxima, and the sources that led to each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import BoolArray, Indices, Transforms
from tanteo.plugins import guarded
from tanteo.posterior.details import details_at
from tanteo.posterior.outliers import are_unexpected
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals import PROPOSERS, InitialPoses, PriorSamples, Proposer, SearchState, proposers
from tanteo.posterior.proposals.drawn import along_ridge, far_pairs, from_prior
from tanteo.posterior.proposals.sensed_planes import SensedPlanes, sensed_planes
from tanteo.posterior.sampling.peaks import Objective, Peaks, log_missed, point_scales, spread_rows
from tanteo.posterior.sampling.ridges import regions_of_maxima
from tanteo.posterior.settings import Effort, SearchSettings
from tanteo.posterior.symmetry import log_orbit


@dataclass(frozen=True, slots=True, eq=False)
class Leader:
    """Best part when a batch of parts begins; every part of the batch is compared to it.

    Attributes:
        objective: objective of the part.
        Ts: pose of its best maximum ``(1, 4, 4)``.
        log_evidence: log-evidence of the part.
    """

    objective: Objective
    Ts: Transforms
    log_evidence: float


@dataclass(slots=True, eq=False)
class PartSearch:
    """Search for one part in rounds.

    Attributes:
        objective: maximizes the posterior of the part from initial poses.
        pairs: pairs of points from which proposals are made, a few each round.
        rng: generator of all draws.
        peaks: maxima so far.
        planes: planes that labels and sensed normals show.
        restarts: number of rounds so far.
        along: poses on a ridge of the posterior that are no maxima, as bases of the sampler; None without.
        trusted: whether the mode was normal before the last measurement.
        known: poses that earlier stages found; None if there are none.
        exhaustive: whether the known poses are all poses that the measurements allow.
        log_odds: log odds of the part by its global properties (mass, size, outline).
    """

    objective: Objective
    pairs: Indices
    rng: np.random.Generator
    peaks: Peaks
    planes: SensedPlanes
    restarts: int = 0
    along: Peaks | None = None
    trusted: bool = False
    known: Transforms | None = None
    exhaustive: bool = False
    log_odds: float = 0.0
    _tried: dict[PreparedPart, Peaks] = field(default_factory=dict)
    _reassigned: Peaks | None = None
    _evidence: tuple[Peaks, float] | None = None
    _missed: tuple[Peaks, float] | None = None

    @property
    def settings(self) -> SearchSettings:
        """Return the settings of the search."""
        return self.objective.problem.settings.search

    @property
    def log_evidence(self) -> float:
        """Return the log-evidence of all maxima and their symmetric images, without constant factors of the prior."""
        if self._evidence is None or self._evidence[0] is not self.peaks:
            log = self._constant + float(log_sum(self.peaks.evidence)) if len(self.peaks) else -np.inf
            self._evidence = self.peaks, log
        return self._evidence[1]

    def is_ridge(self) -> bool:
        """Return whether the effective number of maxima exceeds the number of rounds: more rounds find more maxima."""
        evidence = self.peaks.evidence
        log_number = float(2 * log_sum(evidence) - log_sum(2 * evidence)) if len(evidence) else 0.0
        return log_number > np.log(self.settings.rounds)

    def log_missed(self, least: float = -np.inf) -> float:
        """Return the log-evidence of the regions that the search is expected to have missed.

        Args:
            least: a bound from above suffices where it is not more than this.
        """
        peaks = self.peaks
        if self._missed is not None and self._missed[0] is peaks:
            return self._missed[1]
        log = self._constant + log_missed(peaks.evidence, peaks.times)  # no less than that of regions
        if log <= max(self.log_evidence + np.log(self.settings.missing), least):
            return log
        rows = regions_of_maxima(self.objective, peaks)  # several maxima may be one region
        masses = np.array([float(log_sum(peaks.evidence[own])) for own in rows])
        sources = np.bitwise_count([np.bitwise_or.reduce(peaks.groups[own]) for own in rows])
        self._missed = peaks, self._constant + log_missed(masses, sources)
        return self._missed[1]

    @property
    def _constant(self) -> float:
        prepared = self.objective.prepared
        orbit = log_orbit(prepared, named=self.objective.named)
        return self.objective.problem.log_pose_density(prepared) + orbit + self.log_odds

    def known_cost(self) -> float:
        """Return the least cost of the known poses by a few points; infinity without known poses."""
        if self.known is None or not len(self.known) or not len(self.objective.rows):
            return np.inf
        return self.objective.refined_cost(self.known, self.objective)

    def restart(self, effort: Effort | None = None, leader: Leader | None = None) -> None:
        """Carry out one more round: all proposers in turn, each of which reads the maxima so far.

        A later round of a part that does not explain the points, or far less than the leader, searches for one missed
        pose. Such a pose is among the best refined ones, so that a round maximizes from these alone.

        Args:
            effort: numbers of poses to propose; None for those of the settings.
            leader: best part so far; None without another part.
        """
        most = self.most_if_improbable(leader)
        if self.restarts:  # the points that are farthest apart may be outliers: later rounds take others
            if effort is None and not self.is_good_fit():
                most = self.settings.points
            self._take_other_points()
        for proposer in proposers():
            self.propose(proposer, effort, most, leader)
        self.restarts += 1

    def most_if_improbable(self, leader: Leader | None) -> int | None:
        """Return the most poses to maximize from of a part far less probable than a leader; None for others.

        Args:
            leader: best part so far; None without another part.
        """
        if leader is None or not self.restarts:
            return None
        gap = leader.log_evidence - self.log_evidence
        return self.settings.points if gap > self.objective.problem.settings.samples.few_gap else None

    def propose(
        self,
        proposer: Proposer,
        effort: Effort | None = None,
        most: int | None = None,
        leader: Leader | None = None,
    ) -> None:
        """Maximize from the poses of one proposer, and merge the maxima with those found before.

        Args:
            proposer: source of initial poses.
            effort: numbers of poses to propose; None for those of the settings.
            most: largest number of refined poses to maximize from; None for the number of the proposer.
            leader: best part so far; None without another part.

        Raises:
            PluginError: a proposer of another distribution fails; the message names it.
        """
        objective = self.objective
        state = SearchState(
            objective, effort or self.settings.effort, self.restarts, self.rng, self.pairs, self.planes, self.known,
            self.exhaustive, self.peaks, self.is_doubtful,
        )  # fmt: skip
        with guarded(PROPOSERS.origin(proposer.name), "a proposer of initial poses"):
            found = proposer.propose(objective.problem, objective.prepared, state)
            if not isinstance(found, InitialPoses):
                raise TypeError(f"expected InitialPoses, got {type(found).__name__}")
        self.add(found, most, leader)
        if isinstance(proposer, PriorSamples) and objective.named and self.along is None:
            count = self.settings.maximized
            self.along = along_ridge(objective, from_prior(objective.problem, objective.prepared, count, self.rng))

    def add(self, found: InitialPoses, most: int | None = None, leader: Leader | None = None) -> None:
        """Refine and maximize initial poses, and merge the maxima with those found before.

        Args:
            found: initial poses.
            most: largest number of refined poses to maximize from; None for the number of the proposer.
            leader: best part so far; poses that explain far fewer points than its best maximum are not maximized. None
                for no such limit.
        """
        if not len(found):
            return
        objective, refined = self.objective, found.refined
        keep = found.keep if found.keep is not None else max(len(found), 1)
        keep = keep if most is None else min(keep, most)
        limit = {} if leader is None or leader.objective.prepared is objective.prepared else {
            "known": leader.objective.refined_cost(leader.Ts, objective)
        }  # fmt: skip
        Ts, sources = objective.refine(found.Ts[~refined], found.sources[~refined], keep, **limit)
        rest = objective.maximize(Ts, groups=sources)
        Ts, sources = objective.without_hopeless(found.Ts[refined], found.sources[refined], **limit)
        near = objective.maximize(Ts, groups=sources, fine=True)
        if len(rest) or len(near):
            self.peaks = objective.merged(self.peaks, rest.join(near), self.settings.maximized)

    def has_tried(self, other: Objective, best: Peaks, *, counted: bool) -> bool:
        """Return whether the best maximum of a part was tried on this part before; if not, note it.

        Args:
            other: objective of that part.
            best: its best maximum.
            counted: whether it has to be tried again once more sources led to it, so that the maxima have them, too.
        """
        known = self._tried.get(other.prepared, Peaks.none(other.problem.states))
        enough = min(float(best.times[0]), -np.log2(self.settings.missing))  # more change no missed probability
        sure = known.take(np.flatnonzero(known.times >= enough)) if counted else known
        if len(sure) and other.starts_at(best.Ts, sure.Ts):
            return True
        self._tried[other.prepared] = known.join(best)
        return False

    def not_reassigned(self) -> Peaks:
        """Return the probable maxima about which other assignments of points to faces were not tried; note them."""
        likely = self.peaks.evidence > self.peaks.evidence[:1] + np.log(self.settings.missing)
        new, tried = self.peaks.take(np.flatnonzero(likely)), self._reassigned
        new = self.objective.unlike(new, tried) if tried is not None else new
        self._reassigned = new if tried is None else tried.join(new)
        return new

    def take_tried(self, few: PartSearch) -> None:
        """Count the poses of other parts as tried that a search with a few of the points tried."""
        self._tried = few._tried

    def _take_other_points(self) -> None:
        """Choose other points for proposals and refinement."""
        points, others = self.objective.problem.points, self.objective.problem.furniture.others
        count = self.settings.points
        if len(others) <= count:
            return
        rows = np.sort(self.rng.choice(others, count, replace=False)).astype(np.int32)
        self.objective, self.pairs = replace(self.objective, rows=rows), far_pairs(points, rows, count)

    def on_the_part(self) -> BoolArray:
        """Return whether each point is on the part at the best maximum ``(m,)``; points on furniture do not count."""
        others = self.objective.problem.furniture.others
        if not len(others) or not len(self.peaks):
            return np.zeros(len(others), dtype=bool)
        best = details_at(self.objective, self.peaks.Ts[:1], self.peaks.zs[:1])
        return np.asarray(best.inlier_probability[0, others] > 0.5)

    def is_good_fit(self) -> bool:
        """Return whether the best maximum explains nearly all points, with at most the noise that the prior expects."""
        on = self.on_the_part()
        return not len(on) or (float(on.mean()) > self.settings.explained and self._log_scale() <= self._scale_sd)

    def is_noisy(self) -> bool:
        """Return whether the noise scale at the best maximum is notably larger than stated: a better one may be missed.

        The log of a noise scale has the information 2 m of m degrees of freedom, less those that fit the pose. Noise
        that is a small part of the variance, as with a ray of a wide cone, has few of them.
        """
        if not self._log_scale() > 0:
            return False
        freedom = max((float(self.peaks.information[0, -1, -1]) - 1) / (2 * self._scale_sd**2), 1.0)
        return self._log_scale() > min(self._scale_sd, self.settings.notable_sds / float(np.sqrt(2 * freedom)))

    @property
    def _scale_sd(self) -> float:
        return self.objective.problem.scale_sd

    def _log_scale(self) -> float:
        """Return the log of the noise scale at the best maximum; 0 where the noise is as stated."""
        return self._scale_sd * float(self.peaks.zs[0, -1]) if self._scale_sd > 0 and len(self.peaks) else 0.0

    def is_doubtful(self) -> bool:
        """Return whether the best maximum has more outliers than expected, which may have hidden a better one."""
        on, rate = self.on_the_part(), self.objective.problem.priors.outlier_rate
        return len(self.peaks) > 0 and are_unexpected(int(np.sum(~on)), len(on), rate, self.settings)


def leader_of(searches: Sequence[PartSearch]) -> Leader | None:
    """Return the part with the most evidence; None without a maximum."""
    found = [s for s in searches if len(s.peaks)]
    best = max(found, key=lambda s: s.log_evidence) if found else None
    return Leader(best.objective, best.peaks.Ts[:1], best.log_evidence) if best is not None else None


def start_search(problem: Problem, prepared: PreparedPart, rng: np.random.Generator) -> PartSearch:
    """Return a search before its first round."""
    return start_searches(problem, [prepared], [rng])[0]


def start_searches(
    problem: Problem, parts: Sequence[PreparedPart], rngs: Sequence[np.random.Generator]
) -> list[PartSearch]:
    """Return searches of several parts before their first round; data of the points is computed once for all."""
    count = problem.settings.search.points
    rows, planes = spread(problem, count), sensed_planes(problem, problem.points.take(problem.furniture.others))
    pairs, none = far_pairs(problem.points, rows, count), Peaks.none(problem.states)
    of_points, out = point_scales(problem), []
    for part, rng in zip(parts, rngs, strict=True):
        objective = Objective.of(problem, part, of_points.on(part), rows)
        out.append(PartSearch(objective, pairs, rng, none, planes, log_odds=problem.log_odds(part.part)))
    return out


def spread(problem: Problem, count: int) -> Indices:
    """Return rows of points that are far from each other, without those on furniture."""
    others = problem.furniture.others
    return others[spread_rows(problem.points.take(others), count)].astype(np.int32)


def common_random_numbers(rng: np.random.Generator, count: int) -> list[np.random.Generator]:
    """Return generators that all draw the same numbers (common random numbers): parts then differ only by their fit."""
    seed = int(rng.integers(2**63))
    return [np.random.default_rng(seed) for _ in range(count)]
