"""Weighted draws from the posterior of the pose of one part, by importance sampling about all its maxima at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.active.proposals import Proposals
from tanteo.active.start import Start
from tanteo.matching import PosePrior
from tanteo.matching.priors import log_sum
from tanteo.surface_search import FreePaths, Target, Touches
from tanteo.surface_search.given_pose import GivenPose, given_pose
from tanteo.surface_search.nodes import Rough
from tanteo.surface_search.sheets import all_over
from tanteo.typing import FloatArray, IntArray, Tangents, Transforms

ENOUGH = 200.0
"""Effective draws with which the weights are believed."""

_FAINT = 14.0
"""Log odds below the heaviest at which draws are not kept."""


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

    def __call__(self, Ts: Transforms, z: FloatArray) -> GivenPose:
        """At poses ``(S, 4, 4)``, looked at from shared errors ``(S, D)``."""
        priors = replace(self.start.priors, pose=None)
        at = given_pose(self.touches, self.free, self.target, priors, Ts, z)
        return replace(at, log=at.log + self.start.log_density(self.part, Ts))


def truncated(log: FloatArray) -> FloatArray:
    """Log weights, none above the mean times the root of their number: one draw must not be worth all others together.

    Where a proposal is thinner than the posterior, a draw in its tail may by chance weigh as much as all others; the
    bias of leaving that out vanishes as their number grows (Ionides 2008).
    """
    return np.minimum(log, log_sum(log) - 0.5 * np.log(len(log)))


@dataclass(frozen=True, slots=True, eq=False)
class Weighted:
    """Draws with weights.

    Attributes:
        posterior: of one part.
        proposals: of each round; the first are those about its maxima.
        each: log density of the draws by each of them ``(rounds, J, S)``.
        Ts: poses ``(S, 4, 4)``.
        x: the same as perturbations from every maximum ``(J, S, 6)``.
        at: the posterior there.
        tops: log density at the maxima ``(J,)``.
        log_weights: posterior over the density that they are drawn from ``(S,)``.
        effective: number of draws that carry the weight.
    """

    posterior: Posterior
    proposals: tuple[Proposals, ...]
    each: FloatArray
    Ts: Transforms
    x: Tangents
    at: GivenPose
    tops: FloatArray
    log_weights: FloatArray
    effective: float

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
    return _weighed(posterior, (about,), about.log_density(x)[None], Ts, x, both.first(len(Ts)), both.log[len(Ts) :])


def drawn_all_over(posterior: Posterior, about: Proposals, prior: PosePrior) -> Weighted:
    """Draws from all that the readings leave of the one rough pose of a part, whatever maxima of it are known."""
    priors = replace(posterior.start.priors, pose=prior)
    all_ = all_over(Rough.of_prior(posterior.touches, posterior.target, priors, posterior), about.Ts)
    some = np.flatnonzero(all_.log_weights > all_.log_weights.max() - _FAINT)
    x, log = about.coordinates(all_.Ts[some]), all_.log_weights[some] + np.log(len(some))
    at = GivenPose(*(getattr(all_.at, name)[some] for name in GivenPose.__slots__))
    values = all_.Ts[some], x, at, all_.tops.log, truncated(log), all_.effective
    return Weighted(posterior, (about,), about.log_density(x)[None], *values)


def _weighed(
    posterior: Posterior,
    proposals: tuple[Proposals, ...],
    each: FloatArray,
    Ts: Transforms,
    x: Tangents,
    at: GivenPose,
    tops: FloatArray,
) -> Weighted:
    """Each draw against the mixture of the proposals of all rounds."""
    log = at.log - (log_sum(each, axis=(0, 1)) - np.log(len(proposals)))
    w = np.exp(log - log.max()) if np.isfinite(log.max()) else np.ones(len(log))
    effective = float(w.sum() ** 2 / np.sum(w**2))
    return Weighted(posterior, proposals, each, Ts, x, at, tops, truncated(log), effective)


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
    return _weighed(draws.posterior, proposals, each, *both, at, draws.tops)
