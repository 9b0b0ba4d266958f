"""How many samples each maximum gets: in rounds, until every mode that matters has enough."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.inference.sampler import Sampler
from tanteo.special import log_sum
from tanteo.typing import FloatArray, IntArray

_FIRST, _MORE, _MOST, _ROUNDS = 64, 400, 8, 5
"""Samples of a mode at first, at most in each later round while it has too few, and for one effective one at most."""

_CHECK = 40
"""Samples at first of a mode that was normal before the last measurement: so many tell whether it still is."""

_LIKELY, _GLANCE, _RARE = 5.0, 12, 9.0
"""Log evidence behind the total up to which a maximum gets all first samples; a few up to the last of these: the mass
of a ridge can be a hundred times that of its curvature; the others are taken by their curvature."""

_ENOUGH, _PER, _LEAST = 300, 600, 24
"""Effective samples of a mode: its covariance is good to a twelfth; fewer in proportion where it is less probable than
a half, but enough for its mass to be good to a fifth."""

_MATTERS = 0.005
"""Probability of a mode from which it is sampled until it has enough."""

_RIVAL = 1e-3
"""The same of all regions of a part that lie along ridges: where little was measured, rivals are what may be wrong."""

_MOST_ALONG = 2000
"""Samples of a part along its ridges from which no more are drawn: what so few measurements leave is soon told anew."""

_ALONG, _ENOUGH_ALONG = 8, 64
"""Samples of each component along a ridge, of which there are dozens; effective ones of all of them together, of a
part that is not the likeliest: its odds are known to an eighth then."""


def sample(samplers: Sequence[Sampler], log_none: float) -> None:
    """Rounds of sampling, until every mode that matters has enough."""
    total = float(log_sum([log_none, *(float(log_sum(s.peaks.evidence)) + s.log_constant for s in samplers)]))
    wants = [_first(s.peaks.evidence + s.log_constant - total, trusted=s.trusted) for s in samplers]
    count = 0
    for k in range(_ROUNDS + 1):
        for sampler, want in zip(samplers, wants, strict=True):
            sampler.sample(want)
        before, count = count, sum(len(s.peaks) for s in samplers)
        if k == _ROUNDS or (k == _ROUNDS - 1 and count == before):  # maxima just shown are sampled once, too
            break
        if k == 0:
            _spread(samplers, log_none)
        masses = [s.masses() for s in samplers]
        total = float(log_sum([log_none, *(float(log_sum(m)) for m, _ in masses)]))
        wants = [_wanted(s, mass - total, ess) for s, (mass, ess) in zip(samplers, masses, strict=True)]
        if not any(want.any() for want in wants):
            break


def _first(log_p: FloatArray, *, trusted: bool) -> IntArray:
    """Samples to draw at first of each maximum, by its probability from its curvature; the best always has some."""
    log_p = log_p - min(log_p.max(), 0.0) if log_p.max() < -_LIKELY else log_p
    return np.where(log_p > -_LIKELY, _CHECK if trusted else _FIRST, np.where(log_p > -_RARE, _GLANCE, 0))


def _spread(samplers: Sequence[Sampler], log_none: float) -> None:
    """Follow ridges where a maximum of a part that matters does not look normal, by its curvature or its samples."""
    masses = [np.logaddexp(s.masses()[0], s.peaks.evidence + s.log_constant) for s in samplers]
    total = float(log_sum([log_none, *(float(log_sum(mass)) for mass in masses)]))
    for sampler, mass in zip(samplers, masses, strict=True):
        likely = mass > total + np.log(_RIVAL)
        strange = [k for k in np.flatnonzero(likely) if not sampler.is_normal(int(k))]
        if sampler.along is not None and len(sampler.along) and strange:
            sampler.spread(sampler.along, _ALONG)


def _wanted(sampler: Sampler, log_p: FloatArray, ess: FloatArray) -> IntArray:
    """Samples to draw next of each maximum, components adapted; new maxima are added where samples show them."""
    p = np.exp(log_p)
    if not np.isfinite(sampler.log_weights.max(initial=-np.inf)):  # a box has next to nothing of it: how much?
        return _MORE * (np.arange(len(p)) == np.argmax(sampler.peaks.evidence))
    if sampler.local.any():
        return _wanted_along(sampler, p)
    need = np.clip(_PER * p, _LEAST, _ENOUGH) * (p > _MATTERS)
    worth = np.clip(ess / np.maximum(sampler.counts(), 1), 1 / _MOST, 1)  # effective samples for each that is drawn
    want = np.where(ess < need, np.clip((need - ess) / worth, _FIRST, _MORE), 0).astype(np.int64)
    if not want.any():
        return want
    sampler.adapt(np.flatnonzero(want), float(sampler.log_weights.max()))
    found = sampler.objective.maximize(sampler.strange(), fine=True)
    new = sampler.objective.unlike(found, sampler.peaks)
    if len(new):
        sampler.add(new)
        want = np.concatenate([want, np.full(len(new), _MORE)])
    return want


def _wanted_along(sampler: Sampler, p: FloatArray) -> IntArray:
    """Samples to draw next along a ridge, of its pieces and maxima by their masses, until all together have enough."""
    w = np.exp(sampler.log_weights - sampler.log_weights.max())
    ess, total = float(w.sum() ** 2 / np.sum(w * w)), float(p.sum())
    enough = _ENOUGH if total > 0.5 else _ENOUGH_ALONG
    if ess >= enough or total < _RIVAL or len(w) > _MOST_ALONG:
        return np.zeros(len(p), dtype=np.int64)
    return np.round(min((enough / ess - 1) * len(w), 4 * _MORE) * p / total).astype(np.int64)
