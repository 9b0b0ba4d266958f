"""Allocation of samples to maxima, in rounds until every important mode has enough."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.posterior.sampling.modes import common_samples, regions_of
from tanteo.posterior.sampling.sampler import Sampler
from tanteo.posterior.settings import POSE_DOF
from tanteo.threads import for_each


def sample(samplers: Sequence[Sampler], log_none: float) -> None:
    """Draw samples in rounds until every important mode has enough.

    Where there are too few measurements for a pose, or no maximum is more probable than all other explanations, no
    answer needs the shape of the modes. Fewer rounds and samples give the probabilities, and more follow only while the
    probability of the best mode is less exact than ``probability_sd``. Where there are too few measurements for a pose,
    no sample is for a shape.

    Args:
        samplers: samplers of the parts.
        log_none: log-evidence of the unknown object, its prior included.
    """
    total = float(log_sum([log_none, *(float(log_sum(s.peaks.evidence)) + s.log_constant for s in samplers)]))
    fixed = any(s.fixes_pose for s in samplers)
    logs = [s.peaks.evidence + s.log_constant - total for s in samplers]
    wants = _first(samplers, logs, shaped=fixed)
    rounds = 0 if not samplers else samplers[0].settings.rounds if fixed else samplers[0].settings.few_rounds
    count, P = 0, np.nan
    for k in itertools.count():
        for_each(lambda one: one[0].sample(one[1]), zip(samplers, wants, strict=True))
        if k == 0:
            _sample_more(samplers, logs, wants, shaped=fixed)
        before, count = count, sum(len(s.peaks) for s in samplers)
        if k >= rounds or (k == rounds - 1 and count == before):  # sample new maxima once
            break
        if k == 0 and fixed:
            _spread(samplers, log_none)
        masses = for_each(Sampler.masses, samplers)
        total = float(log_sum([log_none, *(float(log_sum(m)) for m, _ in masses)]))
        own = samplers[0].settings
        shaped = fixed and max(float(m.max(initial=-np.inf)) for m, _ in masses) > total + np.log(0.5)
        before_P, (needs, sd, P) = P, _needs_of_probability(samplers, masses, total)
        sd = np.inf if abs(P - before_P) > 2 * own.probability_sd else sd  # samples found what none had shown
        heaviest = max(float(s.log_weights.max(initial=-np.inf)) for s in samplers) - total
        sd = np.inf if heaviest > np.log(own.min_fraction) else sd  # one sample is no estimate
        rounds = own.rounds if (shaped and fixed) or sd > own.probability_sd else min(rounds, own.few_rounds)
        limits = own.first if shaped else own.shape, own.more if fixed or sd > own.probability_sd else own.first
        more = not shaped and k >= own.few_rounds  # further rounds are for the probability alone
        wants = _all_wanted(samplers, masses, total, needs, limits, shape=not more and (fixed or shaped))
        if not any(want.any() for want in wants):
            break


def _needs_of_probability(
    samplers: Sequence[Sampler], masses: Sequence[tuple[FloatArray, FloatArray]], total: float
) -> tuple[list[FloatArray], float, float]:
    """Return the effective samples that the probabilities of the best mode and part need, and their largest error.

    With relative variance ``1 / ess`` of each mass, the probability ``P`` of a set ``B`` of maxima has the variance
    ``sum_k a_k^2 / ess_k``, where ``a_k = p_k (1 - P)`` for its maxima and ``a_k = p_k P`` for all others. The fewest
    effective samples for a standard deviation ``s`` are ``a_k sum(a) / s^2`` (Neyman 1934).

    Returns:
        Effective samples of the maxima of each part; standard deviation of the less exact probability; probability of
        the best part.
    """
    p = [np.exp(log_mass - total) for log_mass, _ in masses]
    part = int(np.argmax([float(one.sum()) for one in p]))
    mode, most = (part, np.zeros(0, dtype=np.int64)), 0.0
    for i, (sampler, own) in enumerate(zip(samplers, p, strict=True)):
        for rows in regions_of(sampler, common_samples(sampler)) if own.sum() > most else ():
            mode, most = ((i, rows), float(own[rows].sum())) if own[rows].sum() > most else (mode, most)
    limit, sd, needs = samplers[0].settings.probability_sd, 0.0, [np.zeros(len(one)) for one in p]
    for i, rows in ((part, np.arange(len(p[part]))), mode):
        P = float(p[i][rows].sum())
        a = [one * P for one in p]
        a[i][rows] *= (1 - P) / max(P, 1e-300)
        errors = [float(np.sum(np.square(b) / np.maximum(ess, 1.0))) for b, (_, ess) in zip(a, masses, strict=True)]
        scale = sum(float(b.sum()) for b in a) / limit**2
        sd, needs = (
            max(sd, float(np.sqrt(sum(errors)))),
            [np.maximum(n, scale * b) for n, b in zip(needs, a, strict=True)],
        )
    return needs, sd, float(p[part].sum())


def _first(samplers: Sequence[Sampler], logs: Sequence[FloatArray], *, shaped: bool) -> list[IntArray]:
    """Return the samples to draw first of each maximum, by its probability from its curvature.

    The best maximum of each part always gets a few, and so do those that may be better by the error of their curvature.
    Without ``shaped`` no maximum gets enough samples to show the shape of its region.

    Args:
        samplers: samplers of the parts.
        logs: log probabilities of the maxima of each part.
        shaped: whether the shape of the modes is needed.
    """
    few, tops, out = 2 * POSE_DOF, [float(log_p.max()) for log_p in logs], []
    for sampler, log_p, top in zip(samplers, logs, tops, strict=True):
        own = sampler.settings
        gaps = log_p - top if top == max(tops) and top < -own.full_gap else log_p
        want = np.where(gaps > -own.full_gap, own.first if shaped else few, np.where(gaps > -own.few_gap, few, 0))
        near = log_p > top - sampler.objective.problem.settings.search.curvature_error
        out.append(np.where(near, np.maximum(want, few), want))
    return out


def _sample_more(
    samplers: Sequence[Sampler], logs: Sequence[FloatArray], drawn: Sequence[IntArray], *, shaped: bool
) -> None:
    """Sample further maxima of parts whose samples show more mass than the curvature of their maxima.

    A ridge can have a hundred times the mass that its curvature suggests. The ratio is that of the maxima that were
    sampled, and is assumed of the others.

    Args:
        samplers: samplers of the parts.
        logs: log probabilities of the maxima of each part by their curvature.
        drawn: number of samples drawn of each.
        shaped: whether the shape of the modes is needed.
    """
    found = []
    for sampler, log_p, count in zip(samplers, logs, drawn, strict=True):
        sampled = float(log_sum((sampler.peaks.evidence + sampler.log_constant)[count > 0]))
        shift = float(log_sum(sampler.masses()[0])) - sampled
        found.append(log_p + max(shift, 0.0))
    more = [
        np.maximum(want - count, 0) for want, count in zip(_first(samplers, found, shaped=shaped), drawn, strict=True)
    ]
    for_each(lambda one: one[0].sample(one[1]), zip(samplers, more, strict=True))


def _spread(samplers: Sequence[Sampler], log_none: float) -> None:
    """Add components along ridges where a maximum of a probable part is not normal."""
    masses = [np.logaddexp(s.masses()[0], s.peaks.evidence + s.log_constant) for s in samplers]
    total = float(log_sum([log_none, *(float(log_sum(mass)) for mass in masses)]))
    for s, mass in zip(samplers, masses, strict=True):
        likely = mass > total + np.log(s.settings.region)
        if s.along is not None and len(s.along) and not all(s.is_normal(int(k)) for k in np.flatnonzero(likely)):
            # all components of a ridge together have as many samples as a mode needs
            s.spread(s.along, -(-s.settings.enough // s.objective.problem.settings.search.maximized))


def _all_wanted(
    samplers: Sequence[Sampler],
    masses: Sequence[tuple[FloatArray, FloatArray]],
    total: float,
    needs: Sequence[FloatArray],
    limits: tuple[int, int],
    *,
    shape: bool,
) -> list[IntArray]:
    """Return the number of further samples of each maximum of each part; see ``_wanted``."""
    rows = zip(samplers, masses, needs, strict=True)
    return for_each(lambda row: _wanted(row[0], row[1][0] - total, row[1][1], limits, row[2], shape=shape), rows)


def _wanted(
    sampler: Sampler, log_p: FloatArray, ess: FloatArray, limits: tuple[int, int], least: FloatArray, *, shape: bool
) -> IntArray:
    """Return the number of further samples of each maximum; adapt components, and add maxima that samples show.

    Args:
        sampler: sampler of a part.
        log_p: log probability of each maximum ``(m,)``.
        ess: effective number of its samples ``(m,)``.
        limits: smallest and largest number of samples to draw of a maximum that has too few.
        least: effective number that the probabilities need ``(m,)``.
        shape: whether to draw also the samples that the shapes of the modes need.
    """
    own, p = sampler.settings, np.exp(log_p)
    if not np.isfinite(sampler.log_weights.max(initial=-np.inf)):  # nearly all is outside a box: sample more
        return own.more * (np.arange(len(p)) == np.argmax(sampler.peaks.evidence))
    if sampler.local.any():
        return _wanted_along(sampler, p)
    if not shape:
        return _wanted_in_pieces(sampler, p, float(least.sum()))
    need = np.clip(2 * own.enough * p, own.shape, own.enough) * (p > own.min_probability)
    need = np.maximum(need, least)
    worth = np.clip(ess / np.maximum(sampler.counts(), 1), 1 / own.most, 1)  # effective samples for each drawn
    most = np.where(sampler.in_pieces, own.rounds, 1) * limits[1]
    want = np.where(ess < need, np.clip((need - ess) / worth, limits[0], most), 0).astype(np.int64)
    alone = sampler.unexplained() if want.any() or p.sum() > own.min_fraction else np.zeros(0, dtype=np.int64)
    if not want.any() and not len(alone):
        return want
    owners = np.argmax(sampler.shares[alone], axis=1)
    want[owners] = np.maximum(want[owners], limits[0])
    sampler.adapt(np.flatnonzero(want), float(sampler.log_weights.max()))
    found = sampler.objective.maximize(np.ascontiguousarray(sampler.Ts[alone]), fine=True)
    new = sampler.objective.unlike(found, sampler.peaks)
    if len(new):
        sampler.add(new)
        want = np.concatenate([want, np.full(len(new), limits[1])])
    return want


def _wanted_in_pieces(sampler: Sampler, p: FloatArray, need: float) -> IntArray:
    """Return the number of further samples of each maximum, all in pieces of ridges, by its mass.

    Args:
        sampler: sampler of a part.
        p: probability of each maximum ``(m,)``.
        need: effective number of samples of the part that the probabilities need.
    """
    w, own = sampler.weights(float(sampler.log_weights.max())), sampler.settings
    ess = float(w.sum() ** 2 / (w @ w))
    if ess >= need:
        return np.zeros(len(p), dtype=np.int64)
    most = max(own.rounds * own.more * float(p.sum()), own.first)  # all parts together have ``rounds * more``
    count = np.clip((need - ess) * len(w) / ess, own.first, most)
    want = np.round(count * p / p.sum() / own.heaviest).astype(np.int64) * own.heaviest
    sampler.in_pieces |= want > 0
    return want


def _wanted_along(sampler: Sampler, p: FloatArray) -> IntArray:
    """Return the number of further samples of each piece of a ridge, by its mass, until all together have enough."""
    w = np.exp(sampler.log_weights - sampler.log_weights.max())
    ess, total = float(w.sum() ** 2 / np.sum(w * w)), float(p.sum())
    own = sampler.settings
    enough = own.enough if total > 0.5 else own.first
    if ess >= enough or total < own.region or len(w) > own.more * own.rounds:
        return np.zeros(len(p), dtype=np.int64)
    return np.round(min((enough / ess - 1) * len(w), 4 * own.more) * p / total).astype(np.int64)
