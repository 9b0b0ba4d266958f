"""Approximation of a posterior by many small normal densities, so that edges, misses and wrong faces are predicted."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from statistics import NormalDist

import numpy as np

from tanteo.fitting.localization import pose_information
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.planning.places import places_of
from tanteo.planning.state import SensingState
from tanteo.posterior import PreparedPart

_KEPT = 0.3
"""Fraction of a mode's covariance that each sample has; the spread of the samples has the rest."""

_RMS = 1.6
"""A normal error in space stays within 1.6 times its root mean square with a probability of 95 %."""

_SEEN = 1e-12
"""Fraction of the largest mean square displacement below which a motion of the part does not count."""

_PLASTIC = 1.1127756842787055
"""Root of x^7 = x + 1: multiples of its powers fill six dimensions evenly (Roberts 2018)."""

_FULL = 24
"""Number of vectors above which their covariance is normalized to the identity."""

_LEAST = 1e-4
"""Fraction of the largest probability below which a mode has no samples."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Sampled poses, each with a small covariance of its own.

    Attributes:
        targets: the parts.
        part: index of the part of each sample ``(S,)``.
        mode: index of the mode of each sample ``(S,)``.
        Ts: poses ``T_world_part`` ``(S, 4, 4)``.
        covariances: covariance of each sample, part frame, right perturbation ``(S, 6, 6)`` [m, rad].
        weights: weights that sum to one ``(S,)``.
        whole: covariance of the mode of each sample ``(S, 6, 6)``.
        useful: useful part of that covariance ``(S, 6, 6)``: the excess over the tolerance, or all without a tolerance.
    """

    targets: tuple[PreparedPart, ...]
    part: IntArray
    mode: IntArray
    Ts: Transforms
    covariances: Covariances
    weights: FloatArray
    whole: Covariances
    useful: Covariances

    def __len__(self) -> int:
        return len(self.part)


def draw(state: SensingState, count: int, tolerance: float | None = None, feature: str | None = None) -> Samples:
    """Return evenly spread samples of a posterior, in proportion to the modes' probabilities.

    The samples are quasi-random (Roberts 2018) and reproducible.

    Args:
        state: posterior of the session.
        count: approximate number of samples; every mode has at least one.
        tolerance: tolerance of the part's corners [m], beyond which accuracy has no value; None without one.
        feature: feature to which the tolerance applies instead, see :class:`tanteo.planning.Stop`.
    """
    alive = np.flatnonzero(state.weights > _LEAST * state.weights.max(initial=0.0))
    w = state.weights[alive] / state.weights[alive].sum()
    counts = np.maximum(1, np.round(count * w)).astype(np.int64)
    which = np.repeat(np.arange(len(alive)), counts)
    mode = alive[which]
    xi = np.concatenate([even_normals(n) for n in counts]) if len(counts) else np.zeros((0, 6))
    C = state.covariances[mode]
    values, vectors = np.linalg.eigh(state.covariances[alive])
    L = (vectors * np.sqrt(values.clip(0.0))[:, None, :])[which]
    many = counts[which] > 1  # a single sample has the complete covariance
    moved = np.where(many[:, None], np.sqrt(1 - _KEPT) * (L @ xi[..., None])[..., 0], 0.0)
    kept = np.where(many, _KEPT, 1.0)[:, None, None] * C
    Ts = state.poses[mode] @ SE3.exp(moved)
    kept, Ts = _from_draws(state, alive, counts, kept, Ts)
    useful = (
        np.stack([useful_covariance(state, int(k), state.covariances[k], tolerance, feature) for k in alive])
        if len(alive)
        else C
    )
    return Samples(state.start.targets, state.part[mode], mode, Ts, kept, (w / counts)[which], C, useful[which])


def _from_draws(
    state: SensingState, alive: IntArray, counts: IntArray, kept: Covariances, Ts: Transforms
) -> tuple[Covariances, Transforms]:
    """Return the covariances and poses with those of modes that are not normal replaced by posterior samples."""
    first = np.cumsum(counts) - counts
    for k, n, at in zip(alive, counts, first, strict=True):
        if state.draws is None or state.modes[k].normal or n < 2:
            continue
        rows = np.flatnonzero(state.draws.mode == k)
        if not len(rows):
            continue
        w = np.cumsum(state.draws.weights[rows])
        chosen = rows[np.searchsorted(w, w[-1] * (np.arange(n) + 0.5) / n).clip(0, len(rows) - 1)]
        Ts[at : at + n] = state.draws.Ts[chosen]
        kept[at : at + n] = _KEPT * np.linalg.inv(pose_information(state.modes[k].information))
    return kept, Ts


def useful_covariance(
    state: SensingState, k: int, C: Covariances, tolerance: float | None, feature: str | None
) -> Covariances:
    """Return the part of a covariance of a mode's pose whose removal has a value: ``C - (C^-1 + W)^-1``.

    ``W`` is the information that just achieves the tolerance. Motions that displace none of the points do not count.

    Args:
        state: posterior of the session.
        k: index of the mode.
        C: covariance of its pose ``(6, 6)``.
        tolerance: tolerance of the part's corners [m], beyond which accuracy has no value; None for all accuracy.
        feature: feature to which the tolerance applies instead; None for the corners.
    """
    if tolerance is None:
        return C
    J = places_of(state.target(k).part, feature).moves
    values, vectors = np.linalg.eigh(np.mean(np.swapaxes(J, 1, 2) @ J, axis=0))
    some = values > _SEEN * values[-1]
    A = np.sqrt(some.sum() * values[some])[:, None] * (_RMS / tolerance) * vectors[:, some].T
    AC = A @ C
    return np.asarray(AC.T @ np.linalg.solve(np.eye(len(A)) + AC @ A.T, AC))


@cache
def even_normals(n: int) -> FloatArray:
    """Return evenly spread standard normal vectors ``(n, 6)``.

    The first vector is zero; the others have mean zero and, if there are more than 24, unit covariance.

    Args:
        n: number of vectors.
    """
    if n == 1:
        return np.zeros((1, 6))
    half = _even(1 << (int(n) // 2 - 1).bit_length())[: n // 2]
    x = np.stack([half, -half], axis=1).reshape(-1, 6)[: n - 1]
    if n > _FULL:
        x -= x.mean(axis=0)
        x = np.linalg.solve(np.linalg.cholesky(np.cov(x.T)), x.T).T
    return np.concatenate([np.zeros((1, 6)), x])


@cache
def _even(n: int) -> FloatArray:
    """Return the first ``n`` evenly spread standard normal vectors of one sequence ``(n, 6)``."""
    u = (0.5 + np.arange(1, n + 1)[:, None] * _PLASTIC ** -np.arange(1.0, 7.0)) % 1.0
    return np.vectorize(NormalDist().inv_cdf)(np.clip(u, 1e-6, 1 - 1e-6))
