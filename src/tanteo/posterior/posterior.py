"""Posterior over parts, poses and the unknown object: modes with samples and probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.factors.factor import leaf_columns
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.posterior.candidate_pruning import Unsearched, prune
from tanteo.posterior.details import details_at
from tanteo.posterior.joint_surface_model import SharedPlanes, log_gain_of_planes, shared_planes, without_plane
from tanteo.posterior.near_variants import log_density_of_near_variant
from tanteo.posterior.part_search import PartSearch, common_random_numbers, start_search, start_searches
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals import BITS, InitialPoses
from tanteo.posterior.sampling.modes import Mode, modes_of
from tanteo.posterior.sampling.peaks import Objective, Peaks, log_missed
from tanteo.posterior.sampling.placements import Placements, are_placeable, integrate
from tanteo.posterior.sampling.sampler import Sampler
from tanteo.posterior.sampling.sampling import sample
from tanteo.posterior.symmetry import log_orbit
from tanteo.posterior.unknown import log_anywhere, log_unknown, sizes_of_unknown


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Posterior after the measurements.

    Attributes:
        problem: measurements and priors.
        modes: modes, best first.
        unknown: probability of the unknown object.
        log_evidence: log-evidence of the measurements over all parts and the unknown object.
        missing: probability of missed maxima, estimated from the numbers of sources that led to those found.
            The modes share what it leaves of their probability.
        searches: searches of the parts.
        log_priors: log of the prior probability of the searched parts ``(P,)``.
        log_anywhere: log-evidence of an unknown object that is like no part, its prior included.
        unsearched: largest part of ``unknown`` for which parts without a search may account.
    """

    problem: Problem
    modes: tuple[Mode, ...]
    unknown: float
    log_evidence: float
    missing: float
    searches: tuple[PartSearch, ...] = field(repr=False)
    log_priors: FloatArray
    log_anywhere: float
    unsearched: float = 0.0


def infer(
    problem: Problem,
    parts: Sequence[PreparedPart],
    count: int,
    centroid: Vectors,
    rng: np.random.Generator,
    *,
    known: Sequence[Transforms | None] = (),
    exhaustive: bool = False,
    unsearched: Unsearched | None = None,
) -> Posterior:
    """Search the parts, sample their maxima, and return the posterior.

    Args:
        problem: measurements and priors.
        parts: parts to search.
        count: number of all candidates, pruned ones included.
        centroid: mean of the centroids of all parts, in their frames ``(3,)`` [m].
        rng: generator of all draws.
        known: initial poses of each searched part; None without initial poses.
        exhaustive: whether the initial poses are all poses that labels and normals allow.
        unsearched: the parts that are not searched; None if all are.
    """
    prior = float(np.log1p(-problem.priors.unknown) - np.log(max(count, 1)))
    anywhere = float(np.log(problem.priors.unknown)) + log_anywhere(problem, centroid)
    whole = unsearched is None or not unsearched.count
    if whole and are_placeable(problem) and not any(problem.may_fix(part.part) for part in parts):
        placed = _integrated(problem, parts, prior, anywhere, rng)
        if placed is not None:
            return placed
    searches, unseen = prune(problem, parts, anywhere - prior, rng, known, exhaustive=exhaustive, unsearched=unsearched)
    return weigh(problem, searches, np.full(len(searches), prior), anywhere, rng, log_left_out=unseen + prior)


def _integrated(
    problem: Problem, parts: Sequence[PreparedPart], prior: float, anywhere: float, rng: np.random.Generator
) -> Posterior | None:
    """Return the posterior of few touches by an integral over all poses; None if no part can be placed on them."""
    searches = start_searches(problem, parts, common_random_numbers(rng, len(parts)))
    placed = []
    for search in searches:
        constant = problem.log_pose_density(search.objective.prepared) + prior + search.log_odds
        placed.append(Placements(search.objective, search.rng, constant))
    integrate(placed, anywhere)
    if max((one.ess for one in placed), default=0.0) < problem.settings.samples.shape:
        return None
    modes, like, bare = [], [], _log_bare(problem)
    for search, one in zip(searches, placed, strict=True):
        search.peaks = one.maxima() if len(one.Ts) else search.peaks
        if len(search.peaks):
            modes.append(one.mode(search.peaks))
            best = search.peaks.take(np.zeros(1, dtype=np.int64))
            like.append(_like(one.objective, best, np.array([one.log_mass]), bare))
    priors = np.full(len(searches), prior)
    return _posterior(problem, searches, priors, anywhere, modes, like, followed=True)


def search_about(
    problem: Problem, proposals: Sequence[tuple[PreparedPart, Transforms]], rng: np.random.Generator
) -> list[PartSearch]:
    """Maximize the posterior of parts from proposed poses alone, and return the searches.

    Args:
        problem: measurements and priors.
        proposals: parts with poses ``(S, 4, 4)`` from which maximizations start.
        rng: generator of all draws.
    """
    searches = []
    for (prepared, Ts), own in zip(proposals, common_random_numbers(rng, len(proposals)), strict=True):
        search = start_search(problem, prepared, own)
        search.add(InitialPoses.exhaustive(Ts))
        searches.append(search)
    return searches


def posterior_of_factors(
    problem: Problem, parts: Sequence[PreparedPart], log_priors: FloatArray, known: Sequence[Transforms]
) -> Posterior:
    """Return the posterior of the factors of the pose alone, from the poses that they suggest and known ones.

    Args:
        problem: priors and pose factors, without points.
        parts: parts, all of which have a suggested pose or no evidence.
        log_priors: log of the prior of each part ``(P,)``.
        known: poses near maxima of each part, such as those of an answer from an image ``(K, 4, 4)``.
    """
    rng = np.random.default_rng(0)
    starts = [np.concatenate([_suggested(problem, part), Ts]) for part, Ts in zip(parts, known, strict=True)]
    searches = search_about(problem, list(zip(parts, starts, strict=True)), rng)
    for search, Ts in zip(searches, known, strict=True):
        _add_maxima_of_groups(search, Ts, rng)
    anywhere = float(np.log(problem.priors.unknown)) + problem.log_factors_unknown
    return weigh(problem, searches, log_priors, anywhere, rng)


def _suggested(problem: Problem, part: PreparedPart) -> Transforms:
    """Return the poses of a part that its factors suggest ``(K, 4, 4)``."""
    return np.concatenate([one.poses(part.part) for one in problem.pose_factors])


def _add_maxima_of_groups(search: PartSearch, Ts: Transforms, rng: np.random.Generator) -> None:
    """Maximize from the maxima of each group of a factor alone, with its shared errors.

    The errors are zero at a suggested pose. There another group may be more probable, although it is not at the
    maximum: two images agree only if the error of their camera is estimated.
    """
    objective, problem = search.objective, search.objective.problem
    own, known = problem.points.shared_jacobian.shape[2], problem.pose_factors
    columns = leaf_columns(known, own)
    for k, factor in enumerate(known):
        for group in factor.alternatives():
            alone = replace(problem, pose_factors=(*known[:k], *group, *known[k + 1 :]))
            part = objective.prepared
            peaks = search_about(alone, [(part, np.concatenate([_suggested(alone, part), Ts]))], rng)[0].peaks
            zs = np.zeros((len(peaks), problem.states))
            for one, places in leaf_columns(alone.pose_factors, own).items():
                zs[:, columns[one]] = peaks.zs[:, places]
            found = objective.maximize(peaks.Ts, zs, np.full(len(peaks), (1 << BITS) - 1), fine=True)
            search.peaks = objective.merged(search.peaks, found, search.settings.maximized)


def weigh(
    problem: Problem,
    searches: Sequence[PartSearch],
    priors: FloatArray,
    anywhere: float,
    rng: np.random.Generator,
    *,
    log_left_out: float = -np.inf,
    followed: bool = False,
) -> Posterior:
    """Return the posterior from finished searches: sample the probable regions, and normalize over all parts.

    Args:
        problem: measurements and priors.
        searches: searches of the parts.
        priors: log of the prior probability of each part ``(P,)``.
        anywhere: log-evidence of an unknown object that is like no part, its prior included.
        rng: generator of all draws.
        log_left_out: largest log-evidence of parts that were not searched, their prior included; it counts for the
            unknown object.
        followed: whether the searches follow the modes of earlier measurements. Their sources do not state then how
            much a search has missed.
    """
    drawing = zip(searches, priors, common_random_numbers(rng, len(searches)), strict=True)
    negligible = problem.settings.search.negligible
    found = [(s, float(prior), own) for s, prior, own in drawing if len(s.peaks)]
    evidence = np.array([s.log_evidence + prior for s, prior, _ in found])
    total, best = float(log_sum([anywhere, *evidence])), evidence.max(initial=-np.inf)
    samplers, like, bare = [], list[_Like](), _log_bare(problem)
    for (s, prior, prior_samples), own in zip(found, evidence, strict=True):
        if own > total - negligible or own == best:
            samplers.append(_sampler(s, prior, max(total, best), prior_samples))
        elif own > total - 2 * negligible:  # a variant of a part explains more than the part
            like.append(_like(s.objective, s.peaks, s.peaks.evidence + own - log_sum(s.peaks.evidence), bare))
    sample(samplers, anywhere)
    modes = []
    sampled = float(log_sum([anywhere, *(float(log_sum(sampler.masses()[0])) for sampler in samplers)]))
    for sampler in samplers:
        own_modes = modes_of(sampler, sampled + float(np.log(problem.settings.samples.min_probability)))
        modes += own_modes
        masses = np.array([mode.log_mass for mode in own_modes])
        like.append(_like(sampler.objective, _at_peaks(own_modes, sampler), masses, bare))
    return _posterior(problem, searches, priors, anywhere, modes, like, log_left_out, followed=followed)


def _posterior(
    problem: Problem,
    searches: Sequence[PartSearch],
    priors: FloatArray,
    anywhere: float,
    modes: list[Mode],
    like: Sequence[_Like],
    log_left_out: float = -np.inf,
    *,
    followed: bool,
) -> Posterior:
    """Return the posterior of modes and objects like the parts, normalized over all parts; see :func:`weigh`."""
    negligible = problem.settings.search.negligible
    given_unknown = np.array([one.log_variant for one in like]) - np.log1p(-problem.priors.unknown)
    gain = log_gain_of_planes(found for one in like for found in one.planes)
    # only points distinguish near variants of parts (decision 87)
    own = log_unknown(anywhere + gain, given_unknown, problem.priors) if len(problem.points) else anywhere
    log_none = float(log_sum([own, log_left_out]))
    total = float(log_sum([log_none, *(mode.log_mass for mode in modes)]))
    most = max((mode.log_mass for mode in modes), default=0.0)
    modes.sort(key=lambda mode: round(most - mode.log_mass, 3))  # twins of nearly equal mass keep their order
    modes = [mode for k, mode in enumerate(modes) if not k or mode.log_mass > total - negligible]
    total = float(log_sum([log_none, *(mode.log_mass for mode in modes)]))  # dropped modes have no probability
    once, unknown = 0.0 if followed else _missing(modes), float(np.exp(log_none - total))
    kept = [replace(mode, probability=(1 - once) * float(np.exp(mode.log_mass - total))) for mode in modes]
    unseen = float(np.exp(log_left_out - total))
    return Posterior(problem, tuple(kept), unknown, total, once, tuple(searches), priors, anywhere, unseen)


def _missing(modes: Sequence[Mode]) -> float:
    """Return the probability of the modes that the search missed, as a fraction of all modes, found and missed.

    :func:`~tanteo.posterior.sampling.peaks.log_missed` derives the estimate.
    """
    if not modes:
        return 0.0
    masses = np.array([mode.log_mass for mode in modes])
    share = float(np.exp(log_missed(masses, np.array([mode.sources for mode in modes])) - log_sum(masses)))
    return share / (1 + share)


def _at_peaks(modes: Sequence[Mode], sampler: Sampler) -> Peaks:
    """Return the maxima of modes."""
    peaks = Peaks.none(sampler.objective.problem.states)
    if not modes:
        return peaks
    return replace(peaks, Ts=np.stack([m.T_peak for m in modes]), zs=np.stack([m.z for m in modes]))


@dataclass(frozen=True, slots=True, eq=False)
class _Like:
    """Unknown objects that are like a part where it is touched.

    Attributes:
        log_variant: log-evidence of near variants of the part.
        planes: readings that share planes.
    """

    log_variant: float
    planes: list[SharedPlanes]


def _log_bare(problem: Problem) -> float:
    """Return the log density of readings of which only the place is known, anywhere on an unknown object."""
    rows = without_plane(problem)
    return sizes_of_unknown(problem, rows).log_density if len(rows) else 0.0


def _like(objective: Objective, peaks: Peaks, log_masses: FloatArray, bare: float) -> _Like:
    """Return the unknown objects that are like a part about its most probable maxima.

    Args:
        objective: the part and the problem.
        peaks: its maxima.
        log_masses: log masses of the maxima.
        bare: see :func:`_log_bare`.
    """
    if not len(log_masses):
        return _Like(-np.inf, [])
    problem, part = objective.problem, objective.prepared.part
    rows = np.argsort(-log_masses, kind="stable")[: problem.settings.search.kept]
    Ts, zs = peaks.Ts[rows], peaks.zs[rows]
    at = details_at(objective, Ts, zs)
    variant = log_density_of_near_variant(at, part, problem.priors.outlier_rate)
    log = float(log_sum(log_masses[rows] + variant - at.log_points))
    return _Like(log, shared_planes(at, problem, part, Ts, zs, bare))


def _sampler(search: PartSearch, prior: float, total: float, rng: np.random.Generator) -> Sampler:
    objective, peaks = search.objective, search.peaks
    constant = objective.problem.log_pose_density(objective.prepared) + prior
    constant += log_orbit(objective.prepared, named=objective.named) + search.log_odds
    some = np.flatnonzero(peaks.evidence + constant > total - objective.problem.settings.search.drop_gap)
    some = some if len(some) else np.zeros(1, dtype=np.int64)
    return Sampler(objective, peaks.take(some), rng, constant, search.along, trusted=search.trusted)
