"""Draws that adapt to a density: mean, covariance and mass of it by weighted draws in several rounds.

Adaptive multiple importance sampling (Cornuet et al. 2012) with heavy-tailed proposals, and Ionides' truncated weights
while it adapts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from scipy.special import gammaln

from tanteo.matching.box import SURE
from tanteo.matching.priors import log_sum
from tanteo.typing import BoolArray, FloatArray

Proposal = tuple[FloatArray, FloatArray]
"""Mean and factor of the covariance of a density that is drawn from."""

_DRAWS, _ROUNDS, _TAIL = 400, 10, 6
"""Draws in each round, rounds at most, and degrees of freedom of the proposal."""

_LEAST_ROUNDS, _STEADY = 4, 1.3
"""Rounds at least; no more are needed when no variance changed by more than this factor in the last one."""

_LEAST = 40.0
"""Effective draws with which the moments are believed."""


class TooFewDrawsError(Exception):
    """Too few draws carry the weight: the density is not that of one place."""


def sampled(
    at: Callable[[FloatArray], FloatArray],
    d: int,
    peak: float,
    plains: Sequence[Proposal],
    inside: Callable[[FloatArray], BoolArray],
) -> tuple[FloatArray, FloatArray, float, float]:
    """Mean, covariance and log mass, in the coordinates of the ellipsoid, of the share inside.

    First rounds draw from the ellipsoid and along each plain, further ones from what those before found; all draws
    count in the end, each weighed against the mixture of all proposals (Cornuet et al. 2012, adaptive multiple
    importance sampling).

    Raises:
        TooFewDrawsError: so few of them carry the weight that nothing is known.
    """
    us, logs = np.zeros((0, d)), np.zeros(0)
    first: list[Proposal] = [(np.zeros(d), np.eye(d)), *plains]
    proposals: list[Proposal] = []
    mean, C = first[0]
    for normal, spread in _draws(d):
        k = len(proposals)
        mean, L = first[k] if k < len(first) else (mean, np.asarray(np.linalg.cholesky(C), dtype=np.float64))
        proposals.append((mean, L))
        u = mean + (normal * spread[:, None]) @ L.T
        us, logs = np.concatenate([us, u]), np.concatenate([logs, at(u) - peak])
        log_q = log_sum([_log_t(us, *proposal) for proposal in proposals], axis=0) - np.log(len(proposals))
        top = float(np.max(logs - log_q))
        w = np.exp(logs - log_q - top)
        mean, C = _weighted(us, np.minimum(w, w.mean() * np.sqrt(len(w))))
        C = C + 1e-6 * np.trace(C) / d * np.eye(d)
        change = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, C).T))
        if len(proposals) >= _LEAST_ROUNDS + len(plains) and change[0] > 1 / _STEADY and change[-1] < _STEADY:
            break
    if _effective(w) < _LEAST:
        raise TooFewDrawsError
    left = w * inside(us)
    share = float(left.sum() / w.sum())
    w, share = (left, share) if share < SURE and _effective(left) > _LEAST else (w, 1.0)
    log_mass = top + float(np.log(w.mean())) - 0.5 * d * np.log(2 * np.pi)
    return *_weighted(us, w), log_mass, share


def effective(log_weights: FloatArray) -> float:
    """Number of draws that carry the weight; none if all of them have none."""
    top = log_weights.max(initial=-np.inf)
    return _effective(np.exp(log_weights - top)) if np.isfinite(top) else 0.0


def _effective(w: FloatArray) -> float:
    return float(w.sum() ** 2 / max(np.sum(w * w), 1e-300))


def _log_t(u: FloatArray, mean: FloatArray, L: FloatArray) -> FloatArray:
    """Log density of the heavy-tailed proposal with that mean and factor."""
    d = len(mean)
    white = np.linalg.solve(L, (u - mean).T)
    constant = gammaln(0.5 * (_TAIL + d)) - gammaln(0.5 * _TAIL) - 0.5 * d * np.log(_TAIL * np.pi)
    log = constant - np.log(np.diag(L)).sum()
    return np.asarray(log - 0.5 * (_TAIL + d) * np.log1p(np.sum(white * white, axis=0) / _TAIL))


def _weighted(u: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray]:
    w = w / w.sum()
    mean = w @ u
    gap = u - mean
    return mean, (w[:, None] * gap).T @ gap


@cache
def _draws(d: int) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """The same standard normal draws and heavy-tailed factors every time, so that an answer can be repeated."""
    rng = np.random.default_rng((1991, d))
    half = _DRAWS // 2
    out = []
    for _ in range(_ROUNDS):
        normal, factor = rng.normal(size=(half, d)), np.sqrt(_TAIL / rng.chisquare(_TAIL, half))
        out.append((np.concatenate([normal, -normal]), np.concatenate([factor, factor])))
    return tuple(out)
