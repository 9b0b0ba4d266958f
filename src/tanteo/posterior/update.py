"""Update of the posterior by further measurements.

A step of sequential Monte Carlo in which moves are maximizations. Samples of the tracked modes and of the prior are
maximized under *all* measurements. No linearization is kept, so the order of the measurements matters only through the
known maxima. If the answer is in doubt, every part is searched again over its whole prior. The first measurements are
searched as those of a log if they are enough for a pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.defaults import SIGNIFICANCE
from tanteo.factors.factor import leaf_columns
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.posterior.candidate_pruning import prune
from tanteo.posterior.details import details_at
from tanteo.posterior.part_search import PartSearch, start_search
from tanteo.posterior.posterior import Posterior, weigh
from tanteo.posterior.prepared import PreparedPart
from tanteo.posterior.problem import Problem
from tanteo.posterior.proposals import BITS, FactorPoses, PriorSamples
from tanteo.posterior.proposals.drawn import along_ridge
from tanteo.posterior.sampling.modes import Mode
from tanteo.posterior.sampling.peaks import Objective, Peaks
from tanteo.posterior.settings import FEWEST

_EXPECTED = 1.0
"""Smallest log density of a measurement over that of an outlier if its part is roughly at the expected pose."""


def update_posterior(
    problem: Problem,
    parts: Sequence[PreparedPart],
    log_priors: FloatArray,
    before: Posterior | None,
    anywhere: float,
    rng: np.random.Generator,
) -> Posterior:
    """Return the posterior of all measurements, from that of the earlier ones.

    Args:
        problem: all measurements, and the prior of the pose of every part.
        parts: the parts.
        log_priors: log of the prior probability of each part ``(P,)``.
        before: posterior of the earlier measurements; None at first.
        anywhere: log-evidence of an unknown object that is like no part, its prior included.
        rng: generator of all draws.
    """
    if before is None and len(problem.points) > FEWEST:
        return _of_a_log(problem, parts, log_priors, anywhere, rng)
    followed = [p for p in range(len(parts)) if before is None or _modes(before, parts[p])]
    searches = {p: _followed(problem, parts[p], before, rng) for p in followed}
    after = _weighed(problem, searches, log_priors, anywhere, rng)
    if before is not None and _in_doubt(before, after):
        for p, part in enumerate(parts):
            if p not in searches:
                searches[p] = start_search(problem, part, rng)
            search_widely(searches[p], before)
        after = _weighed(problem, searches, log_priors, anywhere, rng)
    return after


def _of_a_log(
    problem: Problem, parts: Sequence[PreparedPart], log_priors: FloatArray, anywhere: float, rng: np.random.Generator
) -> Posterior:
    """Return the posterior of measurements without earlier ones, by the search of a log."""
    most = float(log_priors.max())
    known = [None] * len(parts)
    searches, unseen = prune(problem, parts, anywhere - most, rng, known, exhaustive=False, unsearched=None)
    prior_of = {id(part): log for part, log in zip(parts, log_priors, strict=True)}
    priors = np.array([prior_of[id(search.objective.prepared)] for search in searches])
    return weigh(problem, searches, priors, anywhere, rng, log_left_out=unseen + most)


def posterior_about(problem: Problem, part: PreparedPart, Ts: Transforms, rng: np.random.Generator) -> Posterior:
    """Return the posterior of one part near initial poses ``(S, 4, 4)``, without a search or an unknown object."""
    search = start_search(problem, part, rng)
    _take(search, search.objective.maximize(Ts, fine=True))
    return weigh(problem, [search], np.zeros(1), -np.inf, rng)


def _weighed(
    problem: Problem, searches: dict[int, PartSearch], log_priors: FloatArray, anywhere: float, rng: np.random.Generator
) -> Posterior:
    parts = list(searches)
    return weigh(problem, list(searches.values()), log_priors[parts], anywhere, rng, followed=True)


def _followed(problem: Problem, part: PreparedPart, before: Posterior | None, rng: np.random.Generator) -> PartSearch:
    """Track a part: maximize from its known modes and from some samples of its prior."""
    search, own = start_search(problem, part, rng), problem.settings.samples
    modes = [] if before is None else _modes(before, part)
    if not modes:
        known = problem.mixture(part)
        if known is not None:  # coarse measurements may not separate means of the prior
            _take(search, search.objective.maximize(known.Ts[: own.widely], fine=True))
        _draw(search, own.widely)
        return search
    objective, likely = search.objective, sum(mode.probability for mode in modes)
    Ts, zs = _samples(modes, problem, rng)
    if before is not None and likely > own.min_probability:
        Ts, zs = _with_maxima(Ts, zs, before, problem, part)
    _take(search, objective.maximize(Ts, zs, fine=True))
    search.trusted = max(modes, key=lambda mode: mode.probability).normal
    if likely > own.min_probability and not search.trusted:
        _draw(search, own.shape)
        search.along = along_ridge(objective, _resampled(modes, search.settings.maximized, rng))
    return search


def _samples(modes: Sequence[Mode], problem: Problem, rng: np.random.Generator) -> tuple[Transforms, FloatArray]:
    """Return the maxima of modes and samples of them by their probability, with the other states."""
    total = max(sum(mode.probability for mode in modes), np.finfo(float).tiny)
    own, Ts, zs = problem.settings.samples, [], []
    for mode in modes:
        count = 1 if mode.normal else int(np.ceil(own.shape * mode.probability / total))
        ends = (np.arange(count) + rng.uniform()) / count
        rows = np.searchsorted(np.cumsum(mode.weights), ends).clip(0, len(mode.weights) - 1)
        Ts += [mode.T_peak[None], mode.Ts[np.unique(rows)]]
        z = _carried(mode.z[None], mode.objective.problem, problem)
        zs.append(np.repeat(z, 1 + len(np.unique(rows)), axis=0))
    return np.concatenate(Ts), np.concatenate(zs)


def _with_maxima(
    Ts: Transforms, zs: FloatArray, before: Posterior, problem: Problem, part: PreparedPart
) -> tuple[Transforms, FloatArray]:
    """Return these poses and all known maxima of a part, improbable ones included."""
    for search in before.searches:
        if search.objective.prepared is part:
            own = _carried(search.peaks.zs, before.problem, problem)
            return np.concatenate([Ts, search.peaks.Ts]), np.concatenate([zs, own])
    return Ts, zs


def _carried(zs: FloatArray, before: Problem, after: Problem) -> FloatArray:
    """Return states of an earlier problem as states of a later one ``(S, D)``.

    The shared errors of a factor of the pose stay, because several images agree only with the errors of their camera.
    Those of the points begin at zero if another device has joined.
    """
    (old, was), (new, now) = ((p, p.points.shared_jacobian.shape[2]) for p in (before, after))
    out = np.zeros((len(zs), new.states))
    if was == now:
        out[:, :now] = zs[:, :now]
    columns = leaf_columns(old.pose_factors, was)
    for one, places in leaf_columns(new.pose_factors, now).items():
        if one in columns:
            out[:, places] = zs[:, columns[one]]
    if old.scale_sd > 0 and new.scale_sd > 0:
        out[:, -1] = zs[:, -1]
    return out


def _resampled(modes: Sequence[Mode], count: int, rng: np.random.Generator) -> Transforms:
    """Return samples of some modes together."""
    weights = np.cumsum(np.concatenate([mode.probability * mode.weights for mode in modes]))
    rows = np.searchsorted(weights, weights[-1] * (np.arange(count) + rng.uniform()) / count)
    return np.concatenate([mode.Ts for mode in modes])[rows.clip(0, len(weights) - 1)]


def _draw(search: PartSearch, count: int) -> None:
    search.propose(PriorSamples(), replace(search.settings.effort, maximized=count))
    search.peaks = _found(search.peaks)


def search_widely(search: PartSearch, before: Posterior) -> None:
    """Search a part over its whole prior, and by pairs of points if these fix a pose.

    Poses that images suggest start without errors of the cameras and with the best ones known: several images agree
    only with these.
    """
    problem, part = search.objective.problem, search.objective.prepared.part
    _draw(search, problem.settings.samples.widely)
    search.propose(FactorPoses())
    search.peaks = _found(search.peaks)
    Ts = np.concatenate([np.zeros((0, 4, 4)), *(factor.poses(part) for factor in problem.pose_factors)])
    if before.modes and len(Ts):
        z = _carried(before.modes[0].z[None], before.problem, problem)
        _take(search, search.objective.maximize(Ts, np.repeat(z, len(Ts), axis=0), fine=True))
    if len(problem.points) > FEWEST:
        search.restart()
        search.peaks = _found(search.peaks)


def _take(search: PartSearch, peaks: Peaks) -> None:
    search.peaks = _found(search.objective.merged(search.peaks, peaks, 10**6))


def _found(peaks: Peaks) -> Peaks:
    peaks.groups[:] = (1 << BITS) - 1  # count as found by all sources
    return peaks


def _modes(posterior: Posterior, part: PreparedPart) -> list[Mode]:
    return [mode for mode in posterior.modes if mode.prepared is part]


def _in_doubt(before: Posterior, after: Posterior) -> bool:
    """Return whether the known modes may be incomplete.

    They are if no mode explains the measurements; the last measurements are hardly more probable than as outliers; the
    best mode has a new outlier, which another pose may explain; or a part has become nearly certain, and the right one
    may be among those that were not searched.
    """
    if after.unknown > after.problem.settings.samples.reopen_probability or not after.modes:
        return True
    if _surprising(before, after) or _outliers(after) > _outliers(before):
        return True
    old, new = (probabilities(posterior) for posterior in (before, after))
    best = max(new, key=lambda part: new[part])
    return new[best] > 1 - SIGNIFICANCE >= old.get(best, 0.0)


def _surprising(before: Posterior, after: Posterior) -> bool:
    old, new = before.problem.points, after.problem.points
    as_outliers = float(after.problem.log_not_on_part[len(old) :].sum())
    gain = after.log_evidence - before.log_evidence
    return len(new) > len(old) and gain < as_outliers + _EXPECTED * (len(new) - len(old))


def _outliers(posterior: Posterior) -> int:
    return int(np.sum(~on_part(posterior.modes[0]))) if posterior.modes else 0


def on_part(mode: Mode) -> BoolArray:
    """Return which points are on the part at the maximum of a mode ``(n,)``."""
    objective: Objective = mode.objective
    return np.asarray(details_at(objective, mode.T_peak[None], mode.z[None]).inlier_probability[0] > 0.5)


def probabilities(posterior: Posterior) -> dict[int, float]:
    """Return the probability of each part with a mode, by the id of its :class:`PreparedPart`."""
    out: dict[int, float] = {}
    for mode in posterior.modes:
        out[id(mode.prepared)] = out.get(id(mode.prepared), 0.0) + mode.probability
    return out
