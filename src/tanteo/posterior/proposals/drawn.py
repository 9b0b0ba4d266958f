"""Random initial poses: pairs of points on pairs of surface places, and samples of the pose prior.

Each pair and each sample is an independent source. The number of sources that led to a maximum shows how much may be
missing (Good 1953).
"""

from __future__ import annotations

from dataclasses import replace
from typing import final

import numpy as np

from tanteo import _core
from tanteo.factors import ContactPoints
from tanteo.geometry import SE3
from tanteo.geometry.typing import Indices, IntArray, Transforms
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals.proposer import BITS, InitialPoses, Proposer, SearchState
from tanteo.posterior.sampling.peaks import Objective, Peaks, pair_tilt, scores_of
from tanteo.posterior.settings import POSE_DOF


@final
class PointPairs(Proposer):
    """Proposer of poses with pairs of points on pairs of surface places; each pair is an independent source."""

    name = "pairs"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose poses from the pairs of points of this round."""
        objective, effort, pairs = state.objective, state.effort, state.pairs
        count = min(effort.pairs, len(pairs))
        places = effort.places * effort.pairs // max(count, 1)  # few points have few pairs
        found, sources = [np.zeros((0, 4, 4))], [np.zeros(0, dtype=np.int64)]
        for i in range(state.round * count, (state.round + 1) * count):
            pair = np.ascontiguousarray(pairs[[i % len(pairs)]])
            Ts, _ = _core.propose(
                part.shape, objective.core, objective.rows, pair, places, problem.settings.search.spins,
                objective.scales.blur, objective.scales.blur, pair_tilt(problem), effort.kept,
                int(state.rng.integers(2**63)),
            )  # fmt: skip
            found.append(Ts)
            sources.append(np.full(len(Ts), 1 << (i % BITS), dtype=np.int64))
        return InitialPoses(np.concatenate(found), np.concatenate(sources), keep=effort.maximized)


def far_pairs(points: ContactPoints, rows: Indices, count: int) -> Indices:
    """Return pairs of distant points ``(count, 2)``, no point in many pairs, so that one outlier spoils few."""
    p = points.points[rows]
    gaps = np.linalg.norm(p[:, None] - p, axis=-1)
    first, second = np.triu_indices(len(p), 1)
    order = np.argsort(-gaps[first, second], kind="stable")
    used, most, out = np.zeros(len(p), dtype=int), 1 + 2 * count // max(len(p), 1), []
    for k in order:
        i, j = first[k], second[k]
        if used[i] < most and used[j] < most and gaps[i, j] > 0:
            out.append((rows[i], rows[j]))
            used[[i, j]] += 1
        if len(out) == count:
            break
    return np.array(out, dtype=np.int32).reshape(-1, 2)


@final
class PriorSamples(Proposer):
    """Proposer of the best of many samples of the pose prior, each an independent source.

    A third is refined by all points, the others by subsets. A point near an edge that is matched to the wrong face
    spoils every pose that is refined with it.
    """

    name = "prior"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose samples of the pose prior; none without a prior pose."""
        objective, rng, own = state.objective, state.rng, problem.settings.search
        if not objective.named:
            return InitialPoses.none()
        count = state.effort.maximized
        sources = np.left_shift(1, rng.integers(BITS, size=count))
        Ts = _best_of_prior(objective, count, rng)
        Ts = Ts[rng.permutation(len(Ts))]
        third = len(Ts) // 3 + 1
        subsets = np.array_split(np.arange(third, len(Ts)), max((len(Ts) - third) // own.subset, 1))
        found = [InitialPoses(Ts[:third], sources[:third], keep=third)]
        found += [_refined_by_some(objective, Ts[rows], sources[rows], rng) for rows in subsets]
        return InitialPoses.joined(found)


def _refined_by_some(objective: Objective, Ts: Transforms, sources: IntArray, rng: np.random.Generator) -> InitialPoses:
    """Refine poses by a random subset of the points."""
    n, fraction = len(objective.rows), objective.problem.settings.search.omitted
    rows = np.sort(rng.choice(objective.rows, n - n // fraction if n >= fraction else n, replace=False))
    Ts, sources = replace(objective, rows=rows.astype(np.int32)).refine(Ts, sources, max(len(Ts), 1))
    return InitialPoses.refined_poses(Ts, sources)


def _best_of_prior(objective: Objective, count: int, rng: np.random.Generator) -> Transforms:
    """Return the samples of a widened pose prior at which the points are nearest to the surface, best first."""
    problem, prepared, own = objective.problem, objective.prepared, objective.problem.settings.search
    known = problem.mixture(prepared)
    if known is None:
        return np.zeros((0, 4, 4))
    wider = replace(known, covariances=own.prior_widening**2 * known.covariances)
    wide_problem = replace(problem, mixtures={id(prepared): wider})
    Ts = np.ascontiguousarray(from_prior(wide_problem, prepared, own.prior_draws * count, rng))
    if len(objective.rows):
        costs = scores_of(problem, objective.core, prepared, objective.rows, Ts, objective.scales)
        Ts = Ts[np.argsort(costs, kind="stable")]
    return np.ascontiguousarray(Ts[:count])


def from_prior(problem: Problem, prepared: PreparedPart, count: int, rng: np.random.Generator) -> Transforms:
    """Return means and samples of the pose prior ``(K, 4, 4)``; empty without a prior pose."""
    known = problem.mixture(prepared)
    if known is None:
        return np.zeros((0, 4, 4))
    weights = np.exp(known.log_weights - known.log_weights.max())
    rows = rng.choice(len(weights), size=count, p=weights / weights.sum())
    xi = np.linalg.cholesky(known.covariances)[rows] @ rng.normal(size=(count, 6, 1))
    return np.concatenate([known.Ts[:count], known.Ts[rows] @ SE3.exp(xi[..., 0])])


def along_ridge(objective: Objective, Ts: Transforms) -> Peaks:
    """Return bases of components along a ridge of the posterior: refined poses, each with a small piece of the region.

    Few precise measurements leave a thin bent sheet of poses. The curvature at one maximum describes it only locally.
    Components at many places, each for a piece of its length, describe all of it.

    Args:
        objective: the part and the problem.
        Ts: samples of the ridge before the last measurements ``(S, 4, 4)``.
    """
    own = objective.problem.settings.search
    Ts, _ = objective.refine(Ts, np.zeros(len(Ts), dtype=np.int64), len(Ts))
    zs, shape = np.zeros((len(Ts), objective.problem.states)), objective.prepared.shape
    logs, _, information = _core.slopes(shape, objective.core, Ts, zs)
    some = np.flatnonzero(logs > logs.max() - own.drop_gap)
    if len(some) < 2 * POSE_DOF:
        return Peaks.none(objective.problem.states)
    x = _core.offsets(Ts[some[0]], np.ascontiguousarray(Ts[some]), shape.centre)
    information = np.array(information[some])
    curved = np.linalg.inv(objective.of_pose(information[:1])[0])
    if np.einsum("ni,ij,nj->n", x, np.linalg.inv(curved), x).max() < own.notable_sds**2:
        return Peaks.none(objective.problem.states)
    information[:, :6, :6] += np.linalg.inv(np.cov(x.T) + curved) / own.ridge_piece**2
    rest = np.full(len(some), -np.inf), np.zeros(len(some), dtype=np.int64)
    return Peaks(np.ascontiguousarray(Ts[some]), zs[some], logs[some], information, *rest)
