"""Random initial poses: pairs of points on pairs of surface places, and samples of the pose prior.

A prior that is tight in some directions leaves others free, such as the heading of a part on a table. Half of its
samples take the free directions from one point on one place of the surface.

Each pair and each sample is an independent source. The number of sources that led to a maximum shows how much may be
missing (Good 1953).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import final

import numpy as np

from tanteo import _core
from tanteo.factors import ContactPoints
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Indices, IntArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.posterior.answers.pose_prior import Table
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals.proposer import BITS, InitialPoses, Proposer, SearchState
from tanteo.posterior.sampling.peaks import Objective, Peaks, pair_tilt, prior_sds, scores_of
from tanteo.posterior.settings import POSE_DOF
from tanteo.posterior.stable_poses import upward_directions


@final
class PointPairs(Proposer):
    """Proposer of poses with pairs of points on pairs of surface places; each pair is an independent source."""

    name = "pairs"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose poses from the pairs of points of this round."""
        objective, effort, pairs = state.objective, state.effort, state.pairs
        count = min(effort.pairs, len(pairs))
        places = effort.places * effort.pairs // max(count, 1)  # few points have few pairs
        which = np.arange(state.round * count, (state.round + 1) * count)
        blur, seeds = objective.scales.blur, state.rng.integers(2**63, size=count)
        pairs = np.ascontiguousarray(pairs[which % max(len(pairs), 1)])
        Ts, own = _core.propose(
            part.shape, objective.core, objective.rows, pairs, places, problem.settings.search.spins, blur, blur,
            pair_tilt(problem), effort.kept, seeds,
        )  # fmt: skip
        return InitialPoses(Ts, np.left_shift(1, which % BITS)[own], keep=effort.maximized)


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

    The samples are from the prior alone, and from the prior with one point on the surface. A third is refined by all
    points, the others by subsets. A point near an edge that is matched to the wrong face spoils every pose that is
    refined with it.
    """

    name = "prior"

    def propose(self, problem: Problem, part: PreparedPart, state: SearchState) -> InitialPoses:
        """Propose samples of the pose prior; none without a prior pose."""
        objective, rng, own = state.objective, state.rng, problem.settings.search
        count = state.effort.maximized
        Ts = np.concatenate([_best_of_prior(objective, count, rng), _best_of_placed(objective, count, rng)])
        if not len(Ts):
            return InitialPoses.none()
        sources = np.left_shift(1, rng.integers(BITS, size=len(Ts)))
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
    wide_problem = replace(problem, mixtures={prepared: wider})
    return _best(objective, from_prior(wide_problem, prepared, own.prior_draws * count, rng), count)


def _best(objective: Objective, Ts: Transforms, count: int) -> Transforms:
    """Return the poses at which the points are nearest to the surface, best first."""
    Ts = np.ascontiguousarray(Ts)
    if len(objective.rows):
        costs = scores_of(objective.problem, objective.core, objective.prepared, objective.rows, Ts, objective.scales)
        Ts = Ts[np.argsort(costs, kind="stable")]
    return np.ascontiguousarray(Ts[:count])


_PLACED = 8
"""Numerical: samples with a point on the surface over those of the prior alone; one of them costs a microsecond."""

_FITTING = 0.02
"""Numerical: difference of the cosines of the angles of two stable poses and of two planes within which both fit."""

_FACING = 6
"""Numerical: places of the surface from which the one that faces the approach of a point is taken."""


def _best_of_placed(objective: Objective, count: int, rng: np.random.Generator) -> Transforms:
    """Return the best samples of the prior that also put one point on one place of the surface.

    The place, a Gaussian measurement as wide as the spacing of proposals, sets the position where the prior leaves it
    free, and the prior sets the rest.
    """
    problem, prepared = objective.problem, objective.prepared
    points, rows = problem.points, objective.rows[~problem.points.centres[objective.rows]]
    n = _PLACED * problem.settings.search.prior_draws * count
    known = problem.mixture(prepared)
    if not len(rows) or (known is not None and prior_sds(known.covariances, prepared).max() < objective.scales.blur):
        return np.zeros((0, 4, 4))  # no direction is free
    attitudes = _attitudes(problem, prepared, n, rng)
    if attitudes is None:
        return np.zeros((0, 4, 4))
    R, middle, information = attitudes
    which = rows[rng.integers(len(rows), size=n)]
    places = rng.integers(len(prepared.samples), size=(_FACING, n))
    inward = np.einsum("nji,nj->ni", R, points.inward[which])
    facing = -np.einsum("fnj,nj->fn", prepared.normals[places], inward)
    places = places[np.argmax(facing, axis=0), np.arange(n)]
    normals = np.einsum("nij,nj->ni", R, prepared.normals[places])
    there = points.points[which] - points.radii[which, None] * normals
    matched = there - np.einsum("nij,nj->ni", R, prepared.samples[places])
    weight = objective.scales.blur**-2.0
    right = np.einsum("nij,nj->ni", information, middle) + weight * matched
    t = np.linalg.solve(information + weight * np.eye(3), right[..., None])[..., 0]
    return _best(objective, SE3.from_parts(R, t), count)


def _attitudes(
    problem: Problem, prepared: PreparedPart, n: int, rng: np.random.Generator
) -> tuple[FloatArray, Vectors, FloatArray] | None:
    """Return attitudes of the prior ``(n, 3, 3)``, with mean and information of the position at each; None without one.

    A table alone leaves the attitude open: half of the attitudes are stable poses on it, the others are uniform. Of the
    stable poses half also rest on the second plane of a fixture.
    """
    known, pose = problem.mixture(prepared), problem.priors.pose
    planes = () if pose is None else pose.planes
    if known is None and not planes:
        return None
    middle: Vectors = np.zeros((n, 3))
    information: FloatArray = np.zeros((n, 3, 3))
    if known is None:
        R = _resting(prepared.part, planes, n, rng)
    else:
        weights = np.exp(known.log_weights - known.log_weights.max())
        rows = rng.choice(len(weights), size=n, p=weights / weights.sum())
        C, R0 = known.covariances, known.Ts[rows, :3, :3]
        w = (np.linalg.cholesky(C[:, 3:, 3:])[rows] @ rng.normal(size=(n, 3, 1)))[..., 0]
        gain = np.linalg.solve(C[:, 3:, 3:], C[:, 3:, :3]).swapaxes(1, 2)
        v = (gain[rows] @ w[..., None])[..., 0]
        there = known.Ts[rows] @ SE3.exp(np.concatenate([v, w], axis=1))
        of_step = np.linalg.inv(C[:, :3, :3] - gain @ C[:, 3:, :3])[rows]
        back = SO3.right_jacobian_inverse(-w) @ R0.swapaxes(1, 2)
        information = np.asarray(back.swapaxes(1, 2) @ of_step @ back, dtype=np.float64)
        R, middle = there[:, :3, :3], there[:, :3, 3]
    if not planes:
        return R, middle, information
    right, of_planes = np.einsum("nij,nj->ni", information, middle), np.zeros((3, 3))
    for plane in planes:
        z = plane.normal
        low = (np.einsum("nij,i->nj", R, z) @ prepared.part.vertices.T).min(axis=1)
        right = right + ((z @ plane.point - low) / plane.sd**2)[:, None] * z
        of_planes += np.outer(z, z) / plane.sd**2
    information = information + of_planes
    ridge = 1e-9 * np.trace(of_planes) * np.eye(3)
    middle = np.asarray(np.linalg.solve(information + ridge, right[..., None])[..., 0], dtype=np.float64)
    return R, middle, information


def _resting(part: Part, planes: Sequence[Table], n: int, rng: np.random.Generator) -> FloatArray:
    """Return attitudes ``(n, 3, 3)``: half in a stable pose on the first plane, half uniform (Shoemake 1992).

    Half of the first half are turned about the normal of the first plane until they also rest on the second plane.
    """
    q = rng.normal(size=(n, 4))
    R = np.array(SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)))
    (ups, p), normal, half = upward_directions(part), planes[0].normal, n // 2
    first = rng.choice(len(ups), size=half, p=p / p.sum())
    there = np.einsum("nij,nj->ni", R[:half], ups[first])
    axis, cosine = np.cross(there, normal), there @ normal
    sine = np.linalg.norm(axis, axis=1)
    axis = np.where(sine[:, None] > 1e-9, axis / np.maximum(sine, 1e-9)[:, None], np.linalg.svd(normal[None])[2][1])
    R[:half] = SO3.exp(np.arctan2(sine, cosine)[:, None] * axis) @ R[:half]
    if len(planes) > 1:
        rows, wanted = slice(0, half // 2), planes[1].normal
        fit = np.exp(-0.5 * ((ups @ ups.T - wanted @ normal) / _FITTING) ** 2) + np.finfo(float).tiny
        # directions of a part of revolution are circles, of which some point is at the right angle
        weights = np.cumsum(p * (fit if part.symmetry.axis is None else np.ones_like(fit)), axis=1)[first[rows]]
        second = np.argmax(weights > rng.random((len(weights), 1)) * weights[:, -1:], axis=1)
        there = np.einsum("nij,nj->ni", R[rows], ups[second])
        u = wanted - (wanted @ normal) * normal
        v = np.cross(normal, u)
        turn = -np.arctan2(there @ v, there @ u)
        R[rows] = SO3.exp(turn[:, None] * normal) @ R[rows]
    return R


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
