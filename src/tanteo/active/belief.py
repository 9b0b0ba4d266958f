"""The belief while sensing goes on: every part at every pose that is still possible, by a sum of normal densities.

Each rough pose of the start is a prior of its own. After every reading the poses that were alive, and some drawn from
what was uncertain about them, climb to the maxima of the posterior of *all* readings under that prior; so nothing that
was linearised once is kept, and the order of the readings does not matter beyond which maxima are known. The mass of
each maximum is Laplace's, or that of weighted draws where the posterior is not normal (decision 16).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from tanteo.active.maxima import Maxima, climbed, fresh
from tanteo.active.start import Start, blurred
from tanteo.active.weighing import MATTERS, PartModes, weigh_parts
from tanteo.lie import SE3
from tanteo.localization import pose_information
from tanteo.matching.priors import log_sum
from tanteo.surface_search import FreePaths, Target, Touches
from tanteo.surface_search.mode import Mode
from tanteo.surface_search.none_of_these import log_none, reported, unknown_log_density
from tanteo.typing import Covariances, FloatArray, IntArray, Transforms

_DRAWS, _OF_NORMAL = 96, 1 / 8
"""Poses kept from reading to reading; share of them that a normal mode keeps: nearly all climb back to it."""

_DOUBT, _ASIDE = 0.2, 0.5
"""Probability of "none of these" from which all are looked at anew, and of a reading up to which it is no part's."""

_FEW, _MANY = range(3, 13), 6
"""So many readings leave a rough pose on sheets, or fix it in several ways; so many told at once may be of a pose that
nothing alive leads to: then draws are made from all that the readings leave of it."""

_LEAST_P = 1e-12
"""Probability of a mode at least: where the object is only like a part, it is kept as the place of that."""

_SURE = 0.99
"""Probability of a part at which all are looked at anew, once."""


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
    start, searched = before.start, np.flatnonzero(before.of_parts() > MATTERS)
    known, told = 0 if before.touches is None else len(before.touches), len(touches)
    touches = blurred(start, touches)
    all_over = told in _FEW or told >= known + _MANY
    found = _climbed(start, *_alive(before), touches, free, searched)
    log_anywhere = np.log(start.priors.unknown) + unknown_log_density(touches, start.priors).sum()
    log_anywhere += len(free.origins) * np.log1p(-start.priors.clutter)
    weigh = partial(weigh_parts, start, touches=touches, free=free, log_anywhere=log_anywhere, all_over=all_over)
    after = _believe(start, touches, free, log_anywhere, weigh(found))
    if after.unknown > _DOUBT or _aside(after) - _aside(before) or _settles(before, after):  # what is known is not all
        found = _climbed(start, *_alive(after), touches, free, np.unique(start.part), widely=True)
        after = _believe(start, touches, free, log_anywhere, weigh(found))
    return after


def _aside(belief: Belief) -> set[int]:
    """Readings that the likeliest pose has no use for: of one more another may have, to which nothing led yet."""
    best = belief.modes[0] if belief.modes else None
    return set() if best is None else set(np.flatnonzero(best.found.belongs[best.k] <= _ASIDE).tolist())


def _settles(before: Belief, after: Belief) -> bool:
    """Whether a part has got nearly certain that was not: the true one may be among those not looked for anew."""
    P, Q = before.of_parts(), after.of_parts()
    return bool(Q.max() > _SURE and (P.max() <= _SURE or P.argmax() != Q.argmax()))


def _climbed(
    start: Start,
    Ts: Transforms,
    rows: IntArray,
    touches: Touches,
    free: FreePaths,
    searched: IntArray,
    widely: bool = False,
) -> list[Maxima]:
    """Maxima of every part that has a pose, or is searched: looked at anew."""
    found = []
    for k in range(len(start.targets)):
        own = start.part[rows] == k
        poses, at = Ts[own], rows[own]
        if len(touches) and k in searched:
            anew, of = fresh(start, k, touches, widely)
            poses, at = np.concatenate([poses, anew]), np.concatenate([at, of])
        if len(poses):
            found.append(climbed(start, k, poses, at, touches, free, k in searched))
    return found


def _alive(before: Belief) -> tuple[Transforms, IntArray]:
    """The poses that were alive, and some drawn about them, more about the likelier; each with its rough pose."""
    rows = before.rows if before.touches is not None else np.arange(len(before.start))
    if before.draws is not None:
        bent = np.array([m.moments is not None for m in before.modes], dtype=bool)
        w = np.cumsum(before.draws.weights * np.where(bent, 1.0, _OF_NORMAL)[before.draws.mode])
        count = int(np.ceil(_DRAWS * w[-1] / before.draws.weights.sum())) if len(w) else 0
        some = np.unique(np.searchsorted(w, w[-1:] * (np.arange(count) + 0.5) / max(count, 1)))
        Ts, mode = before.draws.Ts[some], before.draws.mode[some]
    else:
        share = before.weights / before.weights.sum()
        mode = np.repeat(np.arange(len(rows)), np.ceil(_DRAWS * share).astype(np.int64))
        xi = np.random.default_rng(1991).normal(size=(len(mode), 6, 1))
        Ts = before.poses[mode] @ SE3.exp((np.linalg.cholesky(before.covariances)[mode] @ xi)[..., 0])
    return np.concatenate([before.poses, Ts]), np.concatenate([rows, rows[mode]])


def _believe(
    start: Start, touches: Touches, free: FreePaths, log_anywhere: float, parts: Sequence[PartModes]
) -> Belief:
    """The belief of the weighed modes of all parts."""
    prior = np.log1p(-start.priors.unknown)
    log = np.concatenate([np.zeros(0), *(p.log_mass for p in parts)]) + prior
    log_unknown = log_none(log_anywhere, np.array([p.log_kin for p in parts]), start.priors)
    total = float(log_sum([log_unknown, *log]))
    modes = [
        Mode(start.targets[p.part], p.found, int(p.k[m]), float(p.log_mass[m] + prior), p.moments[m])
        for p in parts
        for m in range(len(p.k))
    ]
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *(p.rows for p in parts)])
    kin = np.concatenate([np.zeros(0), *(_at_best(p) for p in parts)]) + np.log(start.priors.unknown * start.priors.kin)
    alive = reported(log, kin, total)
    order = [k for k in np.argsort(-log, kind="stable") if alive[k]]
    total = float(log_sum([log_unknown, *log[order]]))
    kept = tuple(replace(modes[k], probability=max(float(np.exp(log[k] - total)), _LEAST_P)) for k in order)
    number = np.full(len(modes), -1)
    number[order] = np.arange(len(order))
    draws = _joined(parts, number, np.array([m.probability for m in kept]))
    return Belief(start, touches, free, kept, rows[order], float(np.exp(log_unknown - total)), draws)


def _at_best(part: PartModes) -> FloatArray:
    """Log mass of objects that are only like the part, all of it at its likeliest mode ``(M,)``."""
    best = np.arange(len(part.log_mass)) == np.argmax(part.log_mass) if len(part.log_mass) else np.zeros(0, dtype=bool)
    return np.where(best, part.log_kin, -np.inf)


def _joined(parts: Sequence[PartModes], number: IntArray, probabilities: FloatArray) -> Draws:
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
