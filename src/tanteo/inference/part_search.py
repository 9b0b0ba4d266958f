"""The search for one part, round by round: proposals, maxima, what they were found by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.inference.details import details_at
from tanteo.inference.hole_tuples import from_centres
from tanteo.inference.peaks import Objective, Peaks
from tanteo.inference.plane_votes import plane_poses
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
from tanteo.inference.sensed_planes import SensedPlanes, sensed_planes
from tanteo.inference.symmetry import log_orbit
from tanteo.special import log_sum
from tanteo.typing import BoolArray, Indices, Transforms

_OFTEN = 4
"""Pairs of points that lead to a pose from which it was found often: it is missed in one of sixteen searches."""

_BITS, _CERTAIN = 60, 0b1111
"""Groups of pairs and samples that count as separate; what labels lead to counts as found by several."""

_PAIRS = 12
"""Pairs of points that are proposed from."""

_EXPLAINED = 0.9
"""Share of the points that the leader has to have on it before parts far behind it are out: outliers are fewer."""

_UNUSUAL, _FEW = 2.0, 20
"""Standard deviations of the number of outliers over its mean that are too many; of so few points, any is."""

_MOST = 40
"""Maxima kept of a part."""


@dataclass(slots=True, eq=False)
class PartSearch:
    """The search for one part, round by round.

    Attributes:
        objective: leads from poses to maxima.
        pairs: of points from which proposals are made, a few each round.
        rng: of all draws.
        peaks: maxima so far.
        planes: that labels and normals show.
        restarts: so far.
        along: poses on a ridge of the posterior that are no maxima, as bases of the sampler; None without.
        trusted: whether the region of its maximum was normal before the last measurement.
        hints: poses to begin with; None without.
        certain: whether these are all that labels and normals allow.
        log_odds: of the part by what was measured of the whole object.
    """

    objective: Objective
    pairs: Indices
    rng: np.random.Generator
    peaks: Peaks
    planes: SensedPlanes
    restarts: int = 0
    along: Peaks | None = None
    trusted: bool = False
    hints: Transforms | None = None
    certain: bool = False
    log_odds: float = 0.0

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
        return self.objective.problem.log_pose_density(prepared) + orbit + self.log_odds

    def restart(self, effort: Effort) -> None:
        """Propose from pairs of points, which know nothing of each other; settle, maximize, merge."""
        if self.restarts:  # the points that are farthest apart may be outliers: later rounds take others
            self._take_other_points()
        objective, k, count = self.objective, self.restarts, min(effort.pairs, len(self.pairs))
        each = replace(effort, per_pair=effort.per_pair * effort.pairs // max(count, 1))  # few points have few pairs
        poses, groups = [np.zeros((0, 4, 4))], [0]
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
        self._of_factors()
        self._of_planes(effort.maximize)
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

    def _of_planes(self, count: int) -> None:
        """Maximize from poses that put planes on faces, the nearest to points: once, for they are all there are."""
        objective = self.objective
        if self.restarts:
            return
        if self.hints is not None:
            self.try_poses(self.hints, certain=self.certain)
        if self.certain or not len(objective.rows):
            return
        Ts = np.ascontiguousarray(plane_poses(self.planes, objective.prepared))
        if len(Ts) > count:
            costs = scores_of(objective.core, objective.prepared, objective.rows, Ts, objective.scales)
            Ts = Ts[np.argsort(costs, kind="stable")[:count]]
        self.try_poses(Ts, certain=True)

    def _of_centres(self) -> None:
        """Maximize from poses that put centres on axes of holes and bosses: once, and unblurred, for they are near."""
        objective = self.objective
        if self.restarts:
            return
        Ts = from_centres(objective.problem.points, objective.core, objective.prepared)
        found = objective.maximize(Ts, groups=np.full(len(Ts), _CERTAIN, dtype=np.int64), fine=True)
        self.peaks = objective.merged(self.peaks, found, _MOST)

    def _of_factors(self) -> None:
        """Maximize from poses that factors such as images suggest: once, and unblurred, for they are near."""
        objective = self.objective
        if self.restarts or not objective.problem.pose_factors:
            return
        suggested = [factor.poses(objective.prepared.part) for factor in objective.problem.pose_factors]
        self.try_poses(np.concatenate(suggested), certain=True)

    def sample(self, count: int) -> None:
        """Maximize from samples of the pose prior, each a group of its own; and follow the ridge it lies on."""
        objective = self.objective
        if not objective.named:
            return
        groups = np.left_shift(1, self.rng.integers(_BITS, size=count))
        self.peaks = objective.merged(self.peaks, sample_prior(objective, groups, self.rng), _MOST)
        if self.along is None:
            self.along = along_ridge(objective, from_prior(objective.problem, objective.prepared, RIDGE, self.rng))

    def try_poses(self, Ts: Transforms, *, certain: bool = False) -> None:
        """Maximize from poses that no points proposed.

        What they lead to still has to be found, unless they are all that planes allow, to within the noise.
        """
        if not len(Ts):
            return
        groups = np.full(len(Ts), _CERTAIN * certain, dtype=np.int64)
        if certain:
            found = self.objective.maximize(np.ascontiguousarray(Ts), groups=groups, fine=True)
        else:
            found = self.objective.look(Ts, groups, len(Ts))
        self.peaks = self.objective.merged(self.peaks, found, _MOST)

    def on_the_part(self) -> BoolArray:
        """Which points the best maximum has on the part ``(m,)``, those on furniture aside; none without a maximum."""
        others = self.objective.problem.around.others
        if not len(others) or not len(self.peaks):
            return np.zeros(len(others), dtype=bool)
        best = details_at(self.objective, self.peaks.Ts[:1], self.peaks.zs[:1])
        return np.asarray(best.belongs[0, others] > 0.5)

    def is_good_fit(self) -> bool:
        """Whether the best maximum has nine of ten points on the part, with noise as it is known, or there are none."""
        on = self.on_the_part()
        return not len(on) or (float(on.mean()) > _EXPLAINED and not self.noisy())

    def noisy(self) -> bool:
        """Whether the best maximum takes the noise for larger than the factor to which it is known."""
        scaled = self.objective.problem.scale_sd > 0 and len(self.peaks) > 0
        return scaled and float(self.peaks.zs[0, -1]) > 1

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
    rows, planes = spread(problem, FEW), sensed_planes(problem, problem.points.take(problem.around.others))
    pairs, none = far_pairs(problem.points, rows, _PAIRS), Peaks.none(problem.states)
    out = []
    for part, rng in zip(parts, rngs, strict=True):
        objective = Objective(part, problem.compiled(part), problem, scales_for(problem, part), rows)
        out.append(PartSearch(objective, pairs, rng, none, planes, log_odds=problem.log_odds(part.part)))
    return out


def spread(problem: Problem, count: int) -> Indices:
    """Rows of points far from each other, which are not of furniture."""
    others = problem.around.others
    return others[spread_rows(problem.points.take(others), count)].astype(np.int32)


def alike(rng: np.random.Generator, count: int) -> list[np.random.Generator]:
    """As many generators, all of which draw the same: what tells parts apart is not their luck."""
    seed = int(rng.integers(2**63))
    return [np.random.default_rng(seed) for _ in range(count)]
