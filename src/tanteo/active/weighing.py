"""Mass, moments and draws of the posterior of one part, by importance sampling about all its maxima at once.

With few readings the posterior is a bent and cut ridge: a part slides along a face until an edge stops it. Laplace's
approximation at a maximum can then be wrong by many orders, and a pose that holds nearly all of the probability would
be forgotten. Draws from heavy-tailed densities about every maximum, weighted by the exact posterior over the mixture of
all of them (Veach and Guibas; Cappe et al. 2008, adapted while few draws carry the weight), give masses that can be
trusted whatever the shape. Where the posterior is normal about a maximum, its curvature is used: it has no noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.active.importance import ENOUGH, Posterior, Weighted, drawn, drawn_all_over, sampled
from tanteo.active.maxima import Maxima, more
from tanteo.active.proposals import Proposals
from tanteo.active.start import Start
from tanteo.matching import PosePrior
from tanteo.matching.priors import log_sum
from tanteo.surface_search import FreePaths, Touches
from tanteo.surface_search.modes import has_image_near
from tanteo.surface_search.moments import Moments
from tanteo.surface_search.of_draws import ONE, gaps, is_normal, moments_of, second_moments
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.sheets import LEAST
from tanteo.typing import FloatArray, IntArray, Transforms

MATTERS = 0.003
"""Probability of a part from which its posterior is sampled until the weights can be believed."""

_REACH = 25.0
"""Log odds, by Laplace's approximation, below the best part at which another is forgotten unweighed."""

_ROUNDS = 4
"""Rounds at most."""

_LIKELY, _RIVAL, _LEADS = 0.03, 1e-4, 0.9
"""Probability of a part from which draws are made from all that the readings leave of its rough pose; the same where
one part has more than the third: what is left of its rivals then is what may be wrong with calling it known."""

_FEW, _HEAVY = 50.0, 16
"""Effective draws of the first round below which maxima may be missing; heavy draws from which they are looked for."""

_MAXIMA, _HOPELESS = 16, 25.0
"""Maxima about which draws are made, and log odds below the best at which none are."""


@dataclass(frozen=True, slots=True, eq=False)
class PartModes:
    """The posterior of one part.

    Attributes:
        part: index of the part in the start.
        found: the maxima.
        k: those that are modes, best first ``(M,)``.
        rows: rough pose of the start under which each was found ``(M,)``.
        log_mass: of each ``(M,)``.
        log_kin: log mass of objects that are only like the part, at all these poses, before their prior.
        moments: of each, about its maximum; None where the posterior is normal there.
        Ts: draws ``(N, 4, 4)``.
        mode: index into ``k`` of each draw ``(N,)``.
        weights: of the draws, summing to one ``(N,)``.
    """

    part: int
    found: Polished
    k: IntArray
    rows: IntArray
    log_mass: FloatArray
    log_kin: float
    moments: tuple[Moments | None, ...]
    Ts: Transforms
    mode: IntArray
    weights: FloatArray


def weigh_parts(
    start: Start,
    found: Sequence[Maxima],
    touches: Touches,
    free: FreePaths,
    log_anywhere: float,
    *,
    all_over: bool = False,
) -> list[PartModes]:
    """Modes of all parts that are not hopeless, the more draws the more a part matters.

    Args:
        start: what was assumed beforehand.
        found: the maxima of each part.
        touches: all readings that met something.
        free: all paths on which nothing was met.
        log_anywhere: log evidence of readings anywhere, the prior of "none of these" included.
        all_over: likely parts of one rough pose are weighed by draws from all that the readings leave of it.
    """
    best = max((f.masses[0] for f in found if len(f.masses)), default=-np.inf)
    alive = [f for f in found if len(f.masses) and f.masses[0] > best - _REACH]
    glances = [_glance(start, f, touches, free) for f in alive]
    none = log_anywhere - np.log1p(-start.priors.unknown)
    masses = [draws.log_mass for _, draws in glances]
    total = float(log_sum([none, *masses]))
    leads = max(masses, default=-np.inf) > total + np.log(_LEADS)
    least = total + np.log(_RIVAL if leads else _LIKELY)
    out = []
    for maxima, draws in glances:
        likely = all_over and draws.log_mass > least
        prior = _one_rough_pose(start, maxima.part) if likely else None
        wide = None if prior is None else drawn_all_over(draws.posterior, draws.proposals[0], prior)
        if wide is not None and wide.effective >= LEAST:
            draws = wide
        elif draws.effective < ENOUGH and draws.log_mass > total + np.log(MATTERS):
            maxima, draws = _closely(start, maxima, draws, touches, free)
        out.append(_as_modes(maxima, draws))
    return out


def _one_rough_pose(start: Start, part: int) -> PosePrior | None:
    """That of a part which has no other, nor one that symmetry makes equal to it; None if it has."""
    own = np.flatnonzero(start.part == part)
    prior = PosePrior(start.Ts[own[0]], start.covariances[own[0]])
    return None if len(own) > 1 or has_image_near(start.targets[part].part, prior) else prior


def _glance(start: Start, maxima: Maxima, touches: Touches, free: FreePaths) -> tuple[Maxima, Weighted]:
    """The maxima of one part that are not hopeless, and a round of draws about them."""
    near = np.flatnonzero(maxima.masses > maxima.masses[0] - _HOPELESS)[:_MAXIMA]
    maxima = Maxima(maxima.part, maxima.found.take(near), maxima.rows[near], maxima.masses[near])
    return maxima, drawn(Posterior(start, maxima.part, touches, free), Proposals.at(maxima.found, maxima.masses))


def _closely(
    start: Start, maxima: Maxima, draws: Weighted, touches: Touches, free: FreePaths
) -> tuple[Maxima, Weighted]:
    """As many draws as it takes; where few carry the weight, about those maxima too that no climb found till then."""
    if draws.effective < _FEW:
        heavy = np.argsort(-draws.log_weights, kind="stable")[:_HEAVY]
        maxima, draws = _glance(start, more(start, maxima, draws.Ts[heavy], touches, free), touches, free)
    return maxima, sampled(draws, _ROUNDS)


def _as_modes(maxima: Maxima, draws: Weighted) -> PartModes:
    log_total, about, owner, rows = draws.log_mass, draws.proposals[0], np.array(draws.owner), maxima.rows
    all_ = log_sum(draws.log_weights)
    w = np.exp(draws.log_weights - all_)
    share = np.bincount(owner, weights=w, minlength=len(rows))
    kept, moments, log_mass = [], [], []
    left = list(np.argsort(-share, kind="stable"))
    normal_mass = draws.tops + 3 * np.log(2 * np.pi) + np.linalg.slogdet(about.roots)[1]
    while left and share[left[0]] > 0:
        j = int(left.pop(0))
        apart = gaps(about.Ts[j], about.Ts[left], second_moments(draws.x[j], w * (owner == j)))
        near = [i for i, gap in zip(left, apart, strict=True) if gap < ONE]
        for i in near:
            owner[owner == i] = j
            left.remove(i)
        mine = w * (owner == j)
        kept.append(j)
        normal = not near and is_normal(_off_normal(draws, about, j), mine)
        log_mass.append(float(normal_mass[j]) if normal else log_total + np.log(mine.sum()))
        moments.append(None if normal else _moments(draws, about, j, mine))
    number = np.full(len(rows), -1)
    number[kept] = np.arange(len(kept))
    alive = w > 1e-6 * w.max()
    own = w[alive] / w[alive].sum()
    index = np.array(kept, dtype=np.int64)
    log_kin = float(log_sum(log_mass) + log_sum(draws.at.kin + draws.log_weights) - all_)
    return PartModes(
        maxima.part, maxima.found, index, rows[index], np.array(log_mass), log_kin, tuple(moments),
        draws.Ts[alive], number[owner[alive]], own,
    )  # fmt: skip


def _off_normal(draws: Weighted, about: Proposals, j: int) -> FloatArray:
    """By how much the log density at the draws is off that of the curvature at maximum ``j`` ``(S,)``."""
    white = np.linalg.solve(about.roots[j], draws.x[j].T)
    return np.asarray(draws.at.log - draws.tops[j] + 0.5 * np.sum(white * white, axis=0))


def _moments(draws: Weighted, about: Proposals, j: int, w: FloatArray) -> Moments:
    """Moments about maximum ``j``, of draws with weights ``(S,)``."""
    return moments_of(draws.x[j], w, draws.at.z - about.z[j], draws.at.spreads, about.roots[j])
