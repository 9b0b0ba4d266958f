"""Weighted draws from the posterior of the pose of one part, by importance sampling about all its maxima at once.

Errors that the readings share are not drawn: at a given pose what a reading says of them is linear and normal, so they
are integrated out there, by two steps from where the nearest maximum expects them. What is left has six dimensions,
whatever the rig.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.active.proposals import Proposals
from tanteo.active.start import Start
from tanteo.matching import Priors
from tanteo.matching.evidence import log_sum
from tanteo.surface_search import FreePaths, Target, Touches
from tanteo.surface_search.likelihood import (
    Explained,
    explain,
    log_beside_readings,
    log_hit_or_stray,
    normal_equations,
)
from tanteo.surface_search.strays import log_density, log_density_of_kin
from tanteo.typing import FloatArray, IntArray, Tangents, Transforms

_STEPS = 2
"""Steps to the shared errors that are expected at a pose."""

ENOUGH = 200.0
"""Effective draws with which the weights are believed."""


@dataclass(frozen=True, slots=True, eq=False)
class Density:
    """The posterior at some poses.

    Attributes:
        log: density, the shared errors integrated out ``(S,)``.
        kin: log odds of an object that is only like the part, there, before their priors ``(S,)``.
        z: whitened shared errors that are expected there ``(S, D)``.
        spreads: covariances about them ``(S, D, D)``.
    """

    log: FloatArray
    kin: FloatArray
    z: FloatArray
    spreads: FloatArray

    def first(self, n: int) -> Density:
        """At the first of the poses."""
        return Density(*(getattr(self, name)[:n] for name in self.__slots__))

    def join(self, other: Density) -> Density:
        """These and others."""
        return Density(*(np.concatenate([getattr(self, n), getattr(other, n)]) for n in self.__slots__))


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Density of readings and pose of one part, its rough poses mixed and symmetric poses added.

    Attributes:
        start: what was assumed beforehand.
        part: index of the part.
        touches: all readings that met something.
        free: all paths on which nothing was met.
    """

    start: Start
    part: int
    touches: Touches
    free: FreePaths

    @property
    def target(self) -> Target:
        """The part."""
        return self.start.targets[self.part]

    def __call__(self, Ts: Transforms, z: FloatArray) -> Density:
        """At poses ``(S, 4, 4)``, looked at from shared errors ``(S, D)``."""
        priors, D = replace(self.start.priors, pose=None), z.shape[1]
        spreads, log = np.zeros((len(Ts), D, D)), np.zeros(len(Ts))
        if D:
            z, spreads = self._expected(Ts, z, priors)
            log = 0.5 * np.linalg.slogdet(spreads)[1]
        densities = log_hit_or_stray(self.touches, Ts, z, self.target, priors)
        of_readings = log_density(*densities, priors.clutter)
        log = log + of_readings + log_beside_readings(self.free, Ts, z, self.target, priors)
        kin = log_density_of_kin(*densities) - of_readings
        return Density(log + self.start.log_density(self.part, Ts), kin, z, spreads)

    def _expected(self, Ts: Transforms, z: FloatArray, priors: Priors) -> tuple[FloatArray, FloatArray]:
        """Shared errors that are expected at the poses, and their covariances."""
        bare = replace(self.touches, reach=np.zeros(len(self.touches)))  # what blocks a beam now may not when they move
        spreads = np.zeros((len(Ts), z.shape[1], z.shape[1]))
        for _ in range(_STEPS):
            at = _before_shared(explain(bare, Ts, z, self.target, priors))
            A, b = normal_equations(bare, at, z)
            spreads = np.asarray(np.linalg.inv(A[:, 6:, 6:]))
            z = z + (spreads @ b[:, 6:, None])[..., 0]
        return z, spreads


def _before_shared(at: Explained) -> Explained:
    """The same with each reading as probable on the surface as it is while the shared errors are unknown.

    With the errors that are expected a reading may look astray that one of them explains.
    """
    n = at.log_hit.shape[1]
    shared = np.sum(at.J[:, :n, 6:] ** 2, axis=2)
    wider = 0.5 * at.r[:, :n] ** 2 * shared / (1 + shared) - 0.5 * np.log1p(shared)
    return replace(at, log_hit=at.log_hit + wider)


def truncated(log: FloatArray) -> FloatArray:
    """Log weights, none above the mean times the root of their number: one draw must not be worth all others together.

    Where a proposal is thinner than the posterior, a draw in its tail may by chance weigh as much as all others; the
    bias of leaving that out vanishes as their number grows (Ionides 2008).
    """
    return np.minimum(log, log_sum(log) - 0.5 * np.log(len(log)))


@dataclass(frozen=True, slots=True, eq=False)
class Weighted:
    """Draws with weights, round after round; each weighs against the mixture of the proposals of all rounds.

    Attributes:
        posterior: of one part.
        proposals: of each round; the first are those about its maxima.
        each: log density of the draws by each of them ``(rounds, J, S)``.
        Ts: poses ``(S, 4, 4)``.
        x: the same as perturbations from every maximum ``(J, S, 6)``.
        at: the posterior there.
        tops: log density at the maxima ``(J,)``.
        log_weights: posterior over the mixture of all proposals ``(S,)``.
        effective: number of draws that carry the weight.
    """

    posterior: Posterior
    proposals: tuple[Proposals, ...]
    each: FloatArray
    Ts: Transforms
    x: Tangents
    at: Density
    tops: FloatArray
    log_weights: FloatArray = field(init=False)
    effective: float = field(init=False)

    def __post_init__(self) -> None:
        log = self.at.log - (log_sum(self.each, axis=(0, 1)) - np.log(len(self.proposals)))
        w = np.exp(log - log.max()) if np.isfinite(log.max()) else np.ones(len(log))
        object.__setattr__(self, "log_weights", truncated(log))
        object.__setattr__(self, "effective", float(w.sum() ** 2 / np.sum(w**2)))

    @property
    def owner(self) -> IntArray:
        """The maximum that each draw is about ``(S,)``."""
        return np.asarray(np.argmax(log_sum(self.each, axis=0), axis=0))

    @property
    def log_mass(self) -> float:
        """Log of the integral of the posterior."""
        return float(log_sum(self.log_weights) - np.log(len(self.log_weights)))


def drawn(posterior: Posterior, about: Proposals) -> Weighted:
    """The first round of draws, from densities about the maxima of the posterior of one part."""
    Ts, z = about.draw(0)
    both = posterior(np.concatenate([Ts, about.Ts]), np.concatenate([z, about.z]))
    x = about.coordinates(Ts)
    return Weighted(posterior, (about,), about.log_density(x)[None], Ts, x, both.first(len(Ts)), both.log[len(Ts) :])


def sampled(draws: Weighted, rounds: int) -> Weighted:
    """More rounds of draws, so many in all at most, until enough of them carry the weight."""
    while draws.effective <= ENOUGH and len(draws.proposals) < rounds:
        draws = _another(draws)
    return draws


def _another(draws: Weighted) -> Weighted:
    """A round more, from proposals that are adapted to the draws so far."""
    log = draws.log_weights
    w = np.exp(log - log.max()) if np.isfinite(log.max()) else np.ones(len(log))
    proposals = (*draws.proposals, draws.proposals[-1].adapted(draws.x, w, draws.each[-1]))
    Ts, z = proposals[-1].draw(len(draws.proposals))
    x = proposals[0].coordinates(Ts)
    old = np.concatenate([draws.each, proposals[-1].log_density(draws.x)[None]])
    each = np.concatenate([old, np.stack([p.log_density(x) for p in proposals])], axis=-1)
    at = draws.at.join(draws.posterior(Ts, z))
    both = np.concatenate([draws.Ts, Ts]), np.concatenate([draws.x, x], axis=1)
    return Weighted(draws.posterior, proposals, each, *both, at, draws.tops)
