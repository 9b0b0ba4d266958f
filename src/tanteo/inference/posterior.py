"""The posterior over parts, poses and the unknown object: modes with samples, weights that sum to one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.inference.details import details_at
from tanteo.inference.near_variants import log_density_of_near_variant
from tanteo.inference.peaks import Climber, Peaks
from tanteo.inference.prepared import PreparedPart
from tanteo.inference.problem import Problem
from tanteo.inference.sampler import Sampler
from tanteo.inference.search import PartSearch, missing, race
from tanteo.inference.symmetry import folded, log_orbit
from tanteo.inference.unknown import log_anywhere, log_unknown
from tanteo.lie import SE3, SO3
from tanteo.matching.evidence import log_sum
from tanteo.typing import Covariances, FloatArray, IntArray, Transforms, Vectors

NEGLIGIBLE = 12.0
"""Log odds below everything else at which a mode is not reported."""

_FIRST, _MORE, _ROUNDS = 64, 200, 5
"""Samples of a mode at first, and in each later round while it has too few."""

_ENOUGH = 150
"""Effective samples of a mode that matters: its covariance is good to a tenth."""

_NORMAL = 0.1
"""Variance of the log of the posterior over the normal density of its curvature up to which one stands for the other."""

_MATTERS, _MUCH = 1e-3, 0.02
"""Probability of a mode from which it is sampled until it has enough, and from which twice as fast."""

_SHARED = 0.15
"""Share of its samples that a mode has in common with another from which both are one."""

_VALLEY = 30.0
"""Squared Mahalanobis distance within which the maximum of one mode is in the region of another: both are one."""


@dataclass(frozen=True, slots=True, eq=False)
class Mode:
    """One region of poses of one part.

    Attributes:
        climber: the part and the problem, compiled.
        T_world_part: mean pose ``(4, 4)``; of several maxima in one region the best.
        covariance: about it, of the samples ``(6, 6)``, order x y z rx ry rz, part frame, right perturbation [m, rad].
        T_peak: the best maximum ``(4, 4)``.
        z: shared errors, and the noise scale where it is a state, there ``(D,)``.
        information: of pose and these at the maximum, part frame ``(6 + D, 6 + D)``.
        log_mass: log evidence, prior of the part included.
        probability: posterior.
        Ts: samples ``(N, 4, 4)``; the maximum alone where the mode was too improbable to be sampled.
        weights: of them, summing to one ``(N,)``.
        ess: effective number of samples.
    """

    climber: Climber
    T_world_part: Transforms
    covariance: Covariances
    T_peak: Transforms
    z: FloatArray
    information: FloatArray
    log_mass: float
    probability: float
    Ts: Transforms
    weights: FloatArray
    ess: float

    @property
    def prepared(self) -> PreparedPart:
        """The part."""
        return self.climber.prepared


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """What is known after the measurements.

    Attributes:
        problem: the question.
        modes: best first.
        unknown: probability of the unknown object.
        log_evidence: of the measurements, whatever they are of.
        missing: share of the probability that the search met only once: about what it did not meet at all.
    """

    problem: Problem
    modes: tuple[Mode, ...]
    unknown: float
    log_evidence: float
    missing: float


def infer(
    problem: Problem, parts: Sequence[PreparedPart], count: int, centroid: Vectors, rng: np.random.Generator
) -> Posterior:
    """The posterior: search, sample, weigh.

    Args:
        problem: the question.
        parts: the parts that are large enough for the measurements.
        count: number of all parts.
        centroid: mean of theirs, in their frames ``(3,)`` [m].
        rng: of all draws.
    """
    prior = float(np.log1p(-problem.priors.unknown) - np.log(max(count, 1)))
    anywhere = float(np.log(problem.priors.unknown)) + log_anywhere(problem.points, centroid, problem.priors)
    searches = race(problem, parts, anywhere - prior, rng)
    return weigh(problem, searches, prior, anywhere, rng)


def weigh(
    problem: Problem, searches: Sequence[PartSearch], prior: float, anywhere: float, rng: np.random.Generator
) -> Posterior:
    """Sample the regions that matter and weigh them all.

    Args:
        problem: the question.
        searches: maxima of each part.
        prior: log of the prior of one part.
        anywhere: log evidence of an unknown object that is like no part, its prior included.
        rng: of all draws.
    """
    found = [s for s in searches if len(s.peaks)]
    variants = np.array([_log_variant(problem, s) for s in found]) + prior - np.log1p(-problem.priors.unknown)
    log_none = log_unknown(anywhere, variants, problem.priors)
    total = float(log_sum([log_none, *(s.log_evidence + prior for s in found)]))
    modes: list[Mode] = []
    best = max((s.log_evidence for s in found), default=-np.inf)
    samplers = []
    for s in found:
        if s.log_evidence + prior > total - NEGLIGIBLE or s.log_evidence == best:
            samplers.append(_sampler(s, prior, max(total, best + prior), rng))
    _sample(samplers, log_none)
    for sampler in samplers:
        modes += _modes_of(sampler)
    total = float(log_sum([log_none, *(mode.log_mass for mode in modes)]))
    modes.sort(key=lambda mode: -mode.log_mass)
    modes = [replace(mode, probability=float(np.exp(mode.log_mass - total))) for mode in modes]
    kept = [mode for k, mode in enumerate(modes) if not k or mode.log_mass > total - NEGLIGIBLE]
    return Posterior(problem, tuple(kept), float(np.exp(log_none - total)), total, missing(found))


def _log_variant(problem: Problem, search: PartSearch) -> float:
    """Log evidence of near variants of a part, about its maxima."""
    peaks = search.peaks.take(np.arange(min(len(search.peaks), 8)))
    at = details_at(search.climber, peaks.Ts, peaks.zs)
    mean = problem.priors.clutter
    variant = log_density_of_near_variant(at, search.climber.prepared.part, mean, problem.points.places)
    from tanteo.inference.outliers import log_density

    own = log_density(at.log_hit, np.array(at.log_outlier), mean)
    rest = search.log_evidence - float(log_sum(search.peaks.evidence))
    return float(log_sum(peaks.evidence + variant - own)) + rest


def _sampler(search: PartSearch, prior: float, total: float, rng: np.random.Generator) -> Sampler:
    climber, peaks = search.climber, search.peaks
    constant = climber.problem.log_pose_density(climber.prepared) + prior
    constant += log_orbit(climber.prepared, named=climber.named)
    some = np.flatnonzero(peaks.evidence + constant > total - NEGLIGIBLE - 2)
    return Sampler(climber, peaks.take(some if len(some) else np.zeros(1, dtype=np.int64)), rng, constant)


def _sample(samplers: Sequence[Sampler], log_none: float) -> None:
    """Rounds of sampling, until every mode that matters has enough."""
    wants = [np.full(len(s.peaks), _FIRST) for s in samplers]
    for k in range(_ROUNDS):
        for sampler, want in zip(samplers, wants, strict=True):
            sampler.draw(want)
        if k == _ROUNDS - 1:
            break
        masses = [_masses(s) for s in samplers]
        total = float(log_sum([log_none, *(float(log_sum(m)) for m, _ in masses)]))
        wants = [_wanted(s, mass - total, ess) for s, (mass, ess) in zip(samplers, masses, strict=True)]
        if not any(want.any() for want in wants):
            break


def _wanted(sampler: Sampler, log_p: FloatArray, ess: FloatArray) -> IntArray:
    """Samples to draw next of each maximum, components adapted; new maxima are added where samples show them."""
    p, few = np.exp(log_p), (ess < _ENOUGH) & ~(sampler.unlike_normal() < _NORMAL)
    want = np.where(few & (p > _MATTERS), _MORE, 0) + np.where(few & (p > _MUCH), _MORE, 0)
    if not want.any():
        return want
    sampler.adapt(np.flatnonzero(want), float(sampler.log_weights.max()))
    found = sampler.climber.climb(sampler.strange(), fine=True)
    new = sampler.climber.unlike(found, sampler.peaks)
    if len(new):
        sampler.add(new)
        want = np.concatenate([want, np.full(len(new), _MORE)])
    return want


def _masses(sampler: Sampler) -> tuple[FloatArray, FloatArray]:
    """Log mass and effective samples of each maximum's region ``(m,)``."""
    top = float(sampler.log_weights.max())
    if not np.isfinite(top):
        return np.full(len(sampler.peaks), -np.inf), np.zeros(len(sampler.peaks))
    W = np.exp(sampler.log_weights - top)[:, None] * sampler.shares
    sums = W.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(sums) + top, np.nan_to_num(sums**2 / np.sum(W * W, axis=0))


def _modes_of(sampler: Sampler) -> list[Mode]:
    """Regions of one part: maxima that share samples, or lie in each other's region, are one."""
    mass, _ = _masses(sampler)
    if not np.isfinite(mass).any():
        return []
    W = np.exp(sampler.log_weights - sampler.log_weights.max())[:, None] * sampler.shares
    sums = W.sum(axis=0)
    common = W.T @ sampler.shares
    together = common > _SHARED * np.minimum(sums[:, None], sums)
    centre = sampler.climber.prepared.shape.centre
    for k in range(len(sums)):
        x = _offsets(sampler.peaks.Ts[k], sampler.peaks.Ts, centre) - sampler.means[k]
        q = np.einsum("ni,ij,nj->n", x, np.linalg.inv(sampler.covariances[k]), x)
        together[k] |= q < _VALLEY
    return [_mode(sampler, rows, W) for rows in _groups(together) if sums[rows].sum() > 0]


def _offsets(T: Transforms, Ts: Transforms, centre: Vectors) -> FloatArray:
    from tanteo import _core

    return _core.offsets(np.ascontiguousarray(T), np.ascontiguousarray(Ts), centre)


def _groups(together: np.ndarray) -> list[IntArray]:
    """Connected sets of a relation ``(m, m)``."""
    label = np.arange(len(together))
    for k, row in enumerate(together):
        for other in np.flatnonzero(row | together[:, k]):
            label[label == label[other]] = label[k]
    return [np.flatnonzero(label == value) for value in dict.fromkeys(label)]


def _mode(sampler: Sampler, rows: IntArray, W: FloatArray) -> Mode:
    """The region of some maxima, from its samples."""
    climber, peaks = sampler.climber, sampler.peaks
    top = float(sampler.log_weights.max())
    w = W[:, rows].sum(axis=1)
    best = int(rows[np.argmax(peaks.evidence[rows])])
    T_peak = peaks.Ts[best]
    log_mass = float(np.log(w.sum())) + top
    keep = w > 1e-9 * w.max()
    w = w[keep] / w[keep].sum()
    Ts = folded(climber.prepared, np.ascontiguousarray(sampler.Ts[keep]), T_peak[None], named=climber.named)
    xi = SE3.log(SE3.inverse(T_peak) @ Ts)
    mean = w @ xi
    T = T_peak
    if len(rows) == 1:
        T = T_peak @ SE3.exp(mean)
        xi = SE3.log(SE3.inverse(T) @ Ts)
    covariance = (w[:, None] * xi).T @ xi
    if len(rows) == 1 and sampler.unlike_normal()[best] < _NORMAL:
        T, covariance = T_peak, from_centre(climber, np.linalg.inv(climber.of_pose(peaks.information[best])))
    return Mode(
        climber, T, covariance, T_peak, peaks.zs[best], to_origin(climber, peaks.information[best]),
        log_mass, 0.0, Ts, w, float(1 / np.sum(w * w)),
    )  # fmt: skip


def to_origin(climber: Climber, information: FloatArray) -> FloatArray:
    """Information on motions about the part's centre as that on motions of its frame ``(6 + D, 6 + D)``."""
    A = np.eye(len(information))
    A[:3, 3:6] = -SO3.hat(climber.prepared.centre)
    return np.asarray(A.T @ information @ A)


def from_centre(climber: Climber, covariance: Covariances) -> Covariances:
    """Covariance of motions about the part's centre as that of motions of its frame ``(6, 6)``."""
    A = np.eye(6)
    A[:3, 3:] = SO3.hat(climber.prepared.centre)
    return np.asarray(A @ covariance @ A.T)
