"""Mass, moments and draws of the posterior of one part, by importance sampling about all its maxima at once.

With few readings the posterior is a bent and cut ridge: a part slides along a face until an edge stops it. Laplace's
approximation at a maximum can then be wrong by many orders, and a pose that holds nearly all of the probability would
be forgotten. Draws from heavy-tailed densities about every maximum, weighted by the exact posterior over the mixture of
all of them (Veach and Guibas; Cappe et al. 2008, adapted while few draws carry the weight), give masses that can be
trusted whatever the shape. Where the posterior is normal about a maximum, its curvature is used: it has no noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.special import gammaln, logsumexp

from tanteo.active.start import Start
from tanteo.lie import SE3
from tanteo.surface_search import FreePaths, Target, Touches
from tanteo.surface_search.likelihood import log_posterior
from tanteo.surface_search.moments import Moments
from tanteo.surface_search.polish import Polished
from tanteo.typing import FloatArray, IntArray, Transforms

_DRAWS, _TAIL = 256, 5
"""Draws in a round, degrees of freedom of the proposals."""

ROUNDS = 6
"""Rounds at most."""

ENOUGH = 200.0
"""Effective draws with which the weights are believed."""

_MAXIMA, _HOPELESS = 16, 25.0
"""Maxima about which draws are made, and log odds below the best at which none are."""

_NORMAL = 0.25
"""Root mean square by which the log density may differ from a normal one that is believed."""

_OFF = 2.0
"""A draw that differs by more than this counts as one that differs by this: a stray's tail is no other shape."""

_ONE = 9.0
"""Squared Mahalanobis distance within which a maximum belongs to a larger mode."""


@dataclass(frozen=True, slots=True, eq=False)
class Maxima:
    """Distinct maxima of the posterior of one part.

    Attributes:
        part: index of the part in the start.
        found: the maxima, best first.
        rows: rough pose of the start under which each was found ``(S,)``.
        masses: Laplace's log mass of each ``(S,)``, of all rough poses that lead to it.
    """

    part: int
    found: Polished
    rows: IntArray
    masses: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class PartModes:
    """The posterior of one part.

    Attributes:
        found: the maxima.
        k: those that are modes, best first ``(M,)``.
        rows: rough pose of the start under which each was found ``(M,)``.
        log_mass: of each ``(M,)``.
        moments: of each, about its maximum; None where the posterior is normal there.
        Ts: draws ``(N, 4, 4)``.
        mode: index into ``k`` of each draw ``(N,)``.
        weights: of the draws, summing to one ``(N,)``.
        effective: number of draws that carry the weight.
    """

    found: Polished
    k: IntArray
    rows: IntArray
    log_mass: FloatArray
    moments: tuple[Moments | None, ...]
    Ts: Transforms
    mode: IntArray
    weights: FloatArray
    effective: float


def weigh_part(start: Start, maxima: Maxima, touches: Touches, free: FreePaths, rounds: int = 1) -> PartModes:
    """Modes of one part with masses, moments and draws.

    Args:
        start: what was assumed beforehand.
        maxima: of the part.
        touches: all readings that met something.
        free: all paths on which nothing was met.
        rounds: of draws, at most; fewer if enough of them carry the weight.
    """
    near = np.flatnonzero(maxima.masses > maxima.masses[0] - _HOPELESS)[:_MAXIMA]
    found, rows, masses = maxima.found.take(near), maxima.rows[near], maxima.masses[near]
    posterior = _Posterior(start, maxima.part, touches, free)
    about = _Proposals.at(found, masses)
    draws = _sampled(posterior, about, rounds)
    return _as_modes(found, rows, masses, about, draws, posterior)


@dataclass(frozen=True, slots=True, eq=False)
class _Posterior:
    """Log density of readings and pose, the rough poses of the part mixed and symmetric poses added."""

    start: Start
    part: int
    touches: Touches
    free: FreePaths

    @property
    def target(self) -> Target:
        return self.start.targets[self.part]

    def __call__(self, Ts: Transforms, z: FloatArray) -> FloatArray:
        priors = self.start.priors
        log = log_posterior(self.touches, self.free, Ts, z, self.target, replace(priors, pose=None))
        anywhere = 3 * np.log(2 * priors.radius) + np.log(8 * np.pi**2)
        log -= 0.5 * z.shape[1] * np.log(2 * np.pi)  # the density of shared errors, which log_posterior leaves at that
        return np.asarray(log + anywhere + self.start.log_density(self.part, Ts))


@dataclass(frozen=True, slots=True, eq=False)
class _Proposals:
    """Heavy-tailed densities about maxima: over the pose's perturbation and the shared errors together."""

    Ts: Transforms
    z: FloatArray
    means: FloatArray
    roots: FloatArray
    shares: FloatArray

    @classmethod
    def at(cls, found: Polished, masses: FloatArray) -> _Proposals:
        """With the curvature of the maxima; half of the draws evenly, half by (tempered) mass."""
        d = found.information.shape[-1]
        scale = 1 / np.sqrt(np.einsum("sii->si", found.information))
        unit = found.information * scale[:, :, None] * scale[:, None, :] + 1e-10 * np.eye(d)
        roots = scale[:, :, None] * np.swapaxes(np.linalg.inv(np.linalg.cholesky(unit)), 1, 2)
        tempered = np.exp(0.5 * (masses - masses.max()))
        shares = 0.5 / len(masses) + 0.5 * tempered / tempered.sum()
        return cls(found.Ts, found.z, np.zeros((len(masses), d)), roots, shares)

    def coordinates(self, Ts: Transforms, z: FloatArray) -> FloatArray:
        """Perturbations and shared errors from every maximum ``(J, S, d)``."""
        xi = SE3.log(SE3.inverse(self.Ts)[:, None] @ Ts)
        return np.concatenate([xi, z - self.z[:, None]], axis=-1)

    def log_density(self, x: FloatArray) -> FloatArray:
        """Of draws by each of them, shares included ``(J, S)``."""
        d = x.shape[-1]
        white = (x - self.means[:, None]) @ np.swapaxes(np.linalg.inv(self.roots), 1, 2)
        constant = gammaln(0.5 * (_TAIL + d)) - gammaln(0.5 * _TAIL) - 0.5 * d * np.log(_TAIL * np.pi)
        log = constant - np.linalg.slogdet(self.roots)[1] + np.log(self.shares)
        return np.asarray(log[:, None] - 0.5 * (_TAIL + d) * np.log1p(np.sum(white * white, axis=-1) / _TAIL))

    def draw(self, round_: int) -> tuple[Transforms, FloatArray]:
        """Poses and shared errors."""
        d = self.means.shape[1]
        normal, factor = _chance(d, round_)
        which = np.searchsorted(np.cumsum(self.shares), (np.arange(_DRAWS) + 0.5) / _DRAWS)
        which = np.minimum(which, len(self.shares) - 1)
        x = self.means[which] + factor[:, None] * (self.roots[which] @ normal[..., None])[..., 0]
        return self.Ts[which] @ SE3.exp(x[:, :6]), self.z[which] + x[:, 6:]

    def adapted(self, x: FloatArray, w: FloatArray, log: FloatArray) -> _Proposals:
        """With moments and shares of the weighted draws that each is responsible for, by its log density ``(J, S)``."""
        own = np.exp(log - logsumexp(log, axis=0)) * np.minimum(w, w.mean() * np.sqrt(len(w)))
        mass = own.sum(axis=1)
        share = mass / mass.sum()
        weight = own / np.maximum(mass, 1e-300)[:, None]
        means = np.einsum("js,jsi->ji", weight, x)
        gap = x - means[:, None]
        C = np.einsum("js,jsi,jsk->jik", weight, gap, gap)
        old = self.roots @ np.swapaxes(self.roots, 1, 2)
        few = 1 / np.maximum(np.sum(weight**2, axis=1), 1e-300) < 3 * x.shape[-1]
        C = np.where(few[:, None, None], old, C + 0.05 * old)
        means = np.where(few[:, None], self.means, means)
        shares = 0.1 / len(share) + 0.9 * share
        return _Proposals(self.Ts, self.z, means, np.asarray(np.linalg.cholesky(C)), shares)


@cache
def _chance(d: int, round_: int) -> tuple[FloatArray, FloatArray]:
    """The same standard normal draws and heavy-tailed factors every time, so that an answer can be repeated."""
    rng = np.random.default_rng((1991, d, round_))
    half = _DRAWS // 2
    normal, factor = rng.normal(size=(half, d)), np.sqrt(_TAIL / rng.chisquare(_TAIL, half))
    order = rng.permutation(_DRAWS)
    return np.concatenate([normal, -normal])[order], np.concatenate([factor, factor])[order]


@dataclass(frozen=True, slots=True, eq=False)
class _Draws:
    Ts: Transforms
    x: FloatArray
    log: FloatArray
    log_weights: FloatArray
    owner: IntArray
    effective: float

    @property
    def log_mass(self) -> float:
        return float(logsumexp(self.log_weights) - np.log(len(self.log_weights)))


def _sampled(posterior: _Posterior, about: _Proposals, rounds: int) -> _Draws:
    """Rounds of draws until enough of them carry the weight; each weighs against the mixture of all proposals."""
    Ts, z = about.draw(0)
    log, x, proposals = posterior(Ts, z), about.coordinates(Ts, z), [about]
    each = about.log_density(x)[None]
    while True:
        log_w = log - (logsumexp(each, axis=(0, 1)) - np.log(len(proposals)))
        w = np.exp(log_w - log_w.max()) if np.isfinite(log_w.max()) else np.ones(len(log_w))
        effective = float(w.sum() ** 2 / np.sum(w**2))
        if effective > ENOUGH or len(proposals) == rounds:
            break
        proposals.append(proposals[-1].adapted(x, w, each[-1]))
        each = np.concatenate([each, proposals[-1].log_density(x)[None]])
        more = proposals[-1].draw(len(proposals) - 1)
        more_x = about.coordinates(*more)
        each = np.concatenate([each, np.stack([p.log_density(more_x) for p in proposals])], axis=-1)
        log, x = np.concatenate([log, posterior(*more)]), np.concatenate([x, more_x], axis=1)
        Ts, z = np.concatenate([Ts, more[0]]), np.concatenate([z, more[1]])
    return _Draws(Ts, x, log, log_w, np.argmax(logsumexp(each, axis=0), axis=0), effective)


def _as_modes(
    found: Polished, rows: IntArray, masses: FloatArray, about: _Proposals, draws: _Draws, posterior: _Posterior
) -> PartModes:
    log_total = draws.log_mass
    w = np.exp(draws.log_weights - logsumexp(draws.log_weights))
    share = np.bincount(draws.owner, weights=w, minlength=len(masses))
    owner, kept, moments, log_mass = np.array(draws.owner), [], [], []
    left = list(np.argsort(-share, kind="stable"))
    tops = posterior(about.Ts, about.z)
    while left and share[left[0]] > 0:
        j = int(left.pop(0))
        C, mean = _second_moment(draws.x[j], w * (owner == j))
        near = [i for i, d in zip(left, _distances(about, j, left, C), strict=True) if d < _ONE]
        for i in near:
            owner[owner == i] = j
            left.remove(i)
        mine = w * (owner == j)
        if near:
            C, mean = _second_moment(draws.x[j], mine)
        kept.append(j)
        normal = not near and _is_normal(draws, about, float(tops[j]), j, mine)
        log_mass.append(masses[j] if normal else log_total + np.log(mine.sum()))
        moments.append(None if normal else _moments(C, mean))
    number = np.full(len(masses), -1)
    number[kept] = np.arange(len(kept))
    alive = w > 1e-6 * w.max()
    own = w[alive] / w[alive].sum()
    index = np.array(kept, dtype=np.int64)
    return PartModes(
        found, index, rows[index], np.array(log_mass), tuple(moments), draws.Ts[alive], number[owner[alive]], own,
        draws.effective,
    )  # fmt: skip


def _second_moment(x: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray]:
    share = w / w.sum()
    return np.einsum("s,si,sk->ik", share, x, x), share @ x


def _distances(about: _Proposals, j: int, others: list[int], C: FloatArray) -> FloatArray:
    """Squared Mahalanobis distances of other maxima from maximum ``j`` under the moments about it."""
    x = np.concatenate([SE3.log(SE3.inverse(about.Ts[j]) @ about.Ts[others]), about.z[others] - about.z[j]], axis=1)
    s = np.sqrt(np.maximum(np.diag(C), 1e-300))
    x /= s
    return np.asarray(np.sum(x * np.linalg.lstsq(C / np.outer(s, s), x.T, rcond=1e-9)[0].T, axis=1))


def _is_normal(draws: _Draws, about: _Proposals, top: float, j: int, w: FloatArray) -> bool:
    """Whether the draws about a maximum, whose log density is ``top``, have the density of its curvature."""
    white = np.linalg.solve(about.roots[j], draws.x[j].T)
    off = np.clip(draws.log - top + 0.5 * np.sum(white * white, axis=0), -_OFF, _OFF)
    used = w > 1e-3 * w.max()
    return bool(np.sqrt(np.average(off[used] ** 2, weights=w[used])) < _NORMAL)


def _moments(C: FloatArray, mean: FloatArray) -> Moments:
    pose = C[:6, :6]
    given = pose
    if len(C) > 6:
        given = pose - C[:6, 6:] @ np.linalg.solve(C[6:, 6:] + 1e-12 * np.eye(len(C) - 6), C[6:, :6])
    return Moments(mean[:6], pose, given, 0.0)
