"""The belief while sensing goes on: every part at every pose that is still possible, by a sum of normal densities.

Each rough pose of the start is a prior of its own. After every reading the poses that were alive, and some drawn from
what was uncertain about them, climb to the maxima of the posterior of *all* readings under that prior; so nothing that
was linearised once is kept, and the order of the readings does not matter beyond which maxima are known. The mass of
each maximum is Laplace's, or that of weighted draws where the posterior is not normal (decision 16).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from scipy.special import logsumexp

from tanteo.active.importance import ENOUGH
from tanteo.active.start import Start
from tanteo.active.weighing import ROUNDS, Maxima, PartModes, weigh_part
from tanteo.lie import SE3
from tanteo.localization import pose_information
from tanteo.matching.belief import equivalent
from tanteo.matching.prior import PosePrior, prior_rows
from tanteo.surface_search import FreePaths, Target, Touches
from tanteo.surface_search.distinct import SAME_MAXIMUM
from tanteo.surface_search.modes import Mode, log_none
from tanteo.surface_search.polish import Polished, polish
from tanteo.surface_search.recognition import unknown_log_density
from tanteo.surface_search.search import Effort, first_poses
from tanteo.typing import Covariances, FloatArray, IntArray, Transforms

NEGLIGIBLE = 12.0
"""Log odds below the best explanation at which a pose is forgotten."""

_MATTERS = 0.003
"""Probability of a part from which its posterior is sampled until the weights can be believed."""

_CLOSE = 3.0
"""Log odds, by Laplace's approximation, below the best part within which another is sampled so from the first."""

_CLIMB = 6
"""Steps towards the maxima after every reading; those that stay alive go on at the next."""

_DRAWS, _RAW, _EFFORT = 96, 1000, Effort(1000, 10, 24, 8)
"""Poses kept from reading to reading; poses of a part looked at anew, and how many of them closely."""

_DOUBT = 0.2
"""Probability of "none of these" from which all parts are looked at anew."""

_SURE = 0.99
"""Probability of a part at which all others are looked at anew, once."""

_REACH = 25.0
"""Log odds, by Laplace's approximation, below the best part at which another is forgotten unweighed."""


@dataclass(frozen=True, slots=True, eq=False)
class Draws:
    """Poses drawn from a belief.

    Attributes:
        Ts: ``(N, 4, 4)``.
        mode: index of the mode of each ``(N,)``.
        weights: ``(N,)``, summing to the probability of all parts.
    """

    Ts: Transforms
    mode: IntArray
    weights: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """What is known after some readings.

    Attributes:
        start: what was assumed beforehand.
        touches: all readings that met something.
        free: the paths on which nothing was met.
        modes: parts at poses with their probabilities, best first; none before the first reading.
        rows: rough pose of the start under which each mode was found ``(M,)``.
        unknown: probability of "none of these".
        draws: poses drawn from all of it; None before the first reading.
        poses: where the part may be, ``(M, 4, 4)``: the modes, or the rough poses before the first reading.
        covariances: of them ``(M, 6, 6)``.
        part: index of the part of each ``(M,)``.
        weights: probability of each ``(M,)``; sums to one with ``unknown``.
    """

    start: Start
    touches: Touches | None
    free: FreePaths
    modes: tuple[Mode, ...]
    rows: IntArray
    unknown: float
    draws: Draws | None = None
    poses: Transforms = field(init=False)
    covariances: Covariances = field(init=False)
    part: IntArray = field(init=False)
    weights: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        start, modes = self.start, self.modes
        if self.touches is None:
            values = start.Ts, start.covariances, start.part, start.weights * (1 - self.unknown)
        else:
            values = (
                np.array([m.found.Ts[m.k] for m in modes]).reshape(-1, 4, 4),
                np.array([_spread(m) for m in modes]).reshape(-1, 6, 6),
                start.part[self.rows],
                np.array([m.probability for m in modes]),
            )
        for name, value in zip(("poses", "covariances", "part", "weights"), values, strict=True):
            object.__setattr__(self, name, value)

    def of_parts(self) -> FloatArray:
        """Probability of every part of the start, whatever its pose."""
        counts = np.bincount(self.part, weights=self.weights, minlength=len(self.start.targets))
        return np.asarray(counts, dtype=np.float64)

    def target(self, k: int) -> Target:
        """The part of mode ``k``."""
        return self.start.targets[self.part[k]]


def begin(start: Start) -> Belief:
    """The belief before the first reading."""
    return Belief(start, None, FreePaths.none(), (), np.zeros(0, dtype=np.int64), start.priors.unknown)


def update(before: Belief, touches: Touches, free: FreePaths) -> Belief:
    """The belief after readings.

    Args:
        before: the belief before them.
        touches: all readings so far that met something, the old ones included.
        free: all paths so far on which nothing was met.
    """
    after = _believe(before, touches, free, _searched(before))
    # what was alive does not explain them, or a part gets certain among those that were: look at every part again
    if after.unknown > _DOUBT or _settles(before, after):
        after = _believe(after, touches, free, np.unique(before.start.part))
    return after


def _settles(before: Belief, after: Belief) -> bool:
    """Whether a part has got nearly certain that was not: the true one may be among those not looked for anew."""
    P, Q = before.of_parts(), after.of_parts()
    return bool(Q.max() > _SURE and (P.max() <= _SURE or P.argmax() != Q.argmax()))


def _searched(before: Belief) -> IntArray:
    """The parts that are alive."""
    return np.flatnonzero(before.of_parts() > _MATTERS)


def _believe(before: Belief, touches: Touches, free: FreePaths, searched: IntArray) -> Belief:
    start = before.start
    Ts, rows = _alive(before)
    if len(touches):
        fresh = [_fresh(start, int(k), touches) for k in searched]
        Ts = np.concatenate([Ts, *(T for T, _ in fresh)])
        rows = np.concatenate([rows, *(row for _, row in fresh)])
    found: list[Maxima] = []
    for k, target in enumerate(start.targets):
        some = np.flatnonzero(start.part[rows] == k)
        if len(some):
            priors = replace(start.priors, pose=start.prior(rows[some]))
            maxima = polish(touches, free, Ts[some], target, priors, _CLIMB)
            found.append(_distinct(start, k, maxima, rows[some]))
    log_unknown = np.log(start.priors.unknown) + unknown_log_density(touches, start.priors).sum()
    log_unknown += len(free.origins) * np.log1p(-start.priors.clutter)
    return _weigh(start, touches, free, found, float(log_unknown))


def _fresh(start: Start, part: int, touches: Touches) -> tuple[Transforms, IntArray]:
    """Poses of a part found anew from what the start allows, whatever was alive, each with the likeliest rough pose."""
    target, raw = start.targets[part], start.drawn(part, _RAW)
    own = np.flatnonzero(start.part == part)
    known = partial(prior_rows, PosePrior(start.Ts[own[0]], start.covariances[own[0]]), target.part)
    Ts, _ = first_poses(touches, [raw], target, _EFFORT, known if len(own) == 1 else None)
    xi = SE3.log(SE3.inverse(start.Ts[own])[:, None] @ Ts)
    white = np.linalg.solve(np.linalg.cholesky(start.covariances[own])[:, None], xi[..., None])[..., 0]
    log = np.log(np.maximum(start.weights[own], 1e-300)) - 0.5 * np.linalg.slogdet(start.covariances[own])[1]
    return Ts, own[np.argmax(log[:, None] - 0.5 * np.sum(white * white, axis=-1), axis=0)]


def _alive(before: Belief, draws: int = _DRAWS) -> tuple[Transforms, IntArray]:
    """The poses that were alive, and some drawn about them, more about the likelier; each with its rough pose."""
    rows = before.rows if before.touches is not None else np.arange(len(before.start))
    rng = np.random.default_rng(1991)
    if before.draws is not None:
        w = np.cumsum(before.draws.weights)
        which = np.searchsorted(w, w[-1] * (np.arange(draws) + 0.5) / draws) if len(w) else np.zeros(0, dtype=np.int64)
        some = np.unique(which)
        Ts, mode = before.draws.Ts[some], before.draws.mode[some]
    else:
        share = before.weights / before.weights.sum()
        mode = np.repeat(np.arange(len(rows)), np.ceil(draws * share).astype(np.int64))
        xi = (np.linalg.cholesky(before.covariances)[mode] @ rng.normal(size=(len(mode), 6, 1)))[..., 0]
        Ts = before.poses[mode] @ SE3.exp(xi)
    return np.concatenate([before.poses, Ts]), np.concatenate([rows, rows[mode]])


def _distinct(start: Start, part: int, found: Polished, rows: IntArray) -> Maxima:
    """Each maximum once, with the mass of all rough poses that lead to it."""
    target = start.targets[part]
    log = found.log_evidence + np.log(start.weights[rows]) + _images(start, target, found.Ts, rows)
    order = np.argsort(-log, kind="stable")
    order = order[np.isfinite(log[order]) & (log[order] > log.max() - 2 * NEGLIGIBLE)]
    information = pose_information(found.information)
    kept, masses = [], []
    while len(order):
        first = order[0]
        same = equivalent(target.part, found.Ts[first], found.Ts[order], information[order], SAME_MAXIMUM)
        same[0] = True
        own = order[same]
        best = own[np.unique(rows[own], return_index=True)[1]]  # sorted by mass: the first of every rough pose
        kept.append(first)
        masses.append(logsumexp(log[best]))
        order = order[~same]
    index = np.array(kept, dtype=np.int64)
    return Maxima(part, found.take(index), rows[index], np.array(masses))


def _images(start: Start, target: Target, Ts: Transforms, rows: IntArray) -> FloatArray:
    """Log of how many poses that symmetry makes equal the rough pose allows, each by its density ``(S,)``."""
    images = target.part.symmetry.Ts
    if len(images) < 2:
        return np.zeros(len(Ts))
    prior = start.prior(rows)
    log = [-0.5 * np.sum(prior_rows(prior, target.part, Ts @ S)[0] ** 2, axis=1) for S in images]
    return np.asarray(logsumexp(log, axis=0) - log[0])


def _weigh(
    start: Start,
    touches: Touches,
    free: FreePaths,
    found: list[Maxima],
    log_unknown: float,
) -> Belief:
    prior = np.log1p(-start.priors.unknown)
    best = max((f.masses[0] for f in found if len(f.masses)), default=-np.inf)
    alive = [f for f in found if len(f.masses) and f.masses[0] > best - _REACH]
    parts = [weigh_part(start, f, touches, free, ROUNDS if f.masses[0] > best - _CLOSE else 1) for f in alive]
    total = float(logsumexp([log_unknown - prior, *(logsumexp(p.log_mass) for p in parts)]))
    parts = [
        weigh_part(start, f, touches, free, ROUNDS)
        if p.effective < ENOUGH and f.masses[0] <= best - _CLOSE and logsumexp(p.log_mass) > total + np.log(_MATTERS)
        else p
        for p, f in zip(parts, alive, strict=True)
    ]
    log = np.concatenate([np.zeros(0), *(p.log_mass for p in parts)]) + prior
    log_unknown = log_none(log_unknown, np.array([p.log_kin for p in parts]), start.priors)
    total = float(logsumexp([log_unknown, *log]))
    modes = [
        Mode(start.targets[f.part], p.found, int(p.k[m]), float(p.log_mass[m] + prior), p.moments[m])
        for f, p in zip(alive, parts, strict=True)
        for m in range(len(p.k))
    ]
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *(p.rows for p in parts)])
    order = [k for k in np.argsort(-log, kind="stable") if log[k] > total - NEGLIGIBLE]
    total = float(logsumexp([log_unknown, *log[order]]))
    kept = tuple(replace(modes[k], probability=float(np.exp(log[k] - total))) for k in order)
    number = np.full(len(modes), -1)
    number[order] = np.arange(len(order))
    draws = _joined(parts, number, np.array([m.probability for m in kept]))
    return Belief(start, touches, free, kept, rows[order], float(np.exp(log_unknown - total)), draws)


def _joined(parts: list[PartModes], number: IntArray, probabilities: FloatArray) -> Draws:
    """The draws of all parts, those of each mode weighing what it is worth."""
    first = np.cumsum([0, *(len(p.k) for p in parts)])
    numbers = (number[p.mode + k] for p, k in zip(parts, first, strict=False))
    mode = np.concatenate([np.zeros(0, dtype=np.int64), *numbers])
    Ts = np.concatenate([np.zeros((0, 4, 4)), *(p.Ts for p in parts)])
    weights = np.concatenate([np.zeros(0), *(p.weights for p in parts)])
    keep = mode >= 0
    mode, Ts, weights = mode[keep], Ts[keep], weights[keep]
    sums = np.bincount(mode, weights=weights, minlength=len(probabilities))
    return Draws(Ts, mode, weights * probabilities[mode] / sums[mode])


def _spread(mode: Mode) -> Covariances:
    """Covariance of a mode; along its continuous symmetry, where all poses are one, that of its rough pose."""
    if mode.moments is not None:
        return mode.moments.covariance
    return np.asarray(np.linalg.inv(pose_information(mode.found.information[mode.k])))
