"""Sampled placements of a part for a plan, and the readings that hit their faces there.

A plan is fixed beforehand, so a reading may miss its face. Placements are sampled from the prior, each with errors of
sensor, robot and readings. At each placement only the readings with a clear approach that hit their faces count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms, Vectors
from tanteo.planning.candidates import Candidates
from tanteo.planning.clearance import clear_at
from tanteo.planning.probe import Probe
from tanteo.planning.rays import cast_rays, has_cone
from tanteo.planning.samples import even_normals
from tanteo.posterior import PreparedPart

_CHOICE, _VERDICT = 256, 1024
"""Numbers of placements for the choice of readings, and of independent ones for its evaluation, to avoid a bias."""

_NOISES = 4
"""Number of noise samples for each placement."""

_SEED = 1991, 27


@dataclass(frozen=True, slots=True)
class Promise:
    """Probabilities that planned readings succeed.

    Attributes:
        within: probability of the tolerance over all placements; only readings that hit their faces count.
        within_assumed: the same probability if the readings have the errors that :func:`tanteo.locate` assumes if none
            are stated.
        if_all_hit: probability of the tolerance if every reading hits its face.
        all_meet: fraction of the placements at which every reading hits its face.
        all_clear: fraction of the placements at which all starts and approach paths are clear of the part.
    """

    within: float
    within_assumed: float
    if_all_hit: float
    all_meet: float
    all_clear: float


@dataclass(frozen=True, slots=True, eq=False)
class Placements:
    """Sampled poses and errors, and which candidates succeed at each.

    Attributes:
        Ts: poses of the part ``T_world_part`` ``(S, 4, 4)``.
        errors: errors of the states: pose, bias, base and faces ``(S, D)``.
        noise: standard normal noise of the readings ``(S, M, D)``.
        clear: whether the approach of each candidate is clear ``(S, N)``.
        meets: whether the approach is clear and the candidate has an echo from its face ``(S, N)``.
    """

    Ts: Transforms
    errors: FloatArray
    noise: FloatArray
    clear: BoolArray
    meets: BoolArray

    def __len__(self) -> int:
        return len(self.Ts)

    def take(self, rows: IntArray | BoolArray) -> Placements:
        """Return the same placements with some of the candidates only.

        Args:
            rows: indices or flags of the candidates.
        """
        return replace(self, clear=self.clear[:, rows], meets=self.meets[:, rows])

    def patterns(self, chosen: IntArray) -> list[tuple[BoolArray, IntArray]]:
        """Return each combination of hits, as flags of the readings ``(n,)``, with the rows of its placements.

        Args:
            chosen: rows of the readings.
        """
        found, which = np.unique(self.meets[:, chosen], axis=0, return_inverse=True)
        order = np.argsort(which, kind="stable")
        return list(zip(found, np.split(order, np.cumsum(np.bincount(which.ravel()))[:-1]), strict=True))


def placements(
    target: PreparedPart, T: Transforms, prior: Covariances, candidates: Candidates, probe: Probe
) -> tuple[Placements, Placements]:
    """Sample placements for the choice of readings, and independent ones for its evaluation.

    Args:
        target: the part.
        T: expected pose ``T_world_part`` ``(4, 4)``.
        prior: covariance of pose, bias, base and faces ``(D, D)``; the pose is first and independent of the others.
        candidates: candidate readings.
        probe: sensor model.
    """
    rng, count = np.random.default_rng(_SEED), _CHOICE + _VERDICT
    normal = np.concatenate([even_normals(count + 1)[1:], rng.normal(size=(count, len(prior) - 6))], axis=1)
    errors = normal @ np.linalg.cholesky(prior).T
    Ts, noise = T @ SE3.exp(errors[:, :6]), rng.normal(size=(count, _NOISES, len(prior)))
    clear = clear_at(target, T, Ts, candidates, probe)
    every = Placements(Ts, errors, noise, clear, clear & _meets(target, Ts, candidates, probe, rng))
    first, others = np.split(np.arange(count), [_CHOICE])
    return tuple(Placements(*(getattr(every, name)[k] for name in every.__slots__)) for k in (first, others))  # type: ignore[return-value]


def _meets(
    target: PreparedPart, Ts: Transforms, candidates: Candidates, probe: Probe, rng: np.random.Generator
) -> BoolArray:
    """Return whether each candidate has an echo from its face ``(S, C)``; for a cone, from one random ray."""
    along = candidates.directions[:, None]
    if has_cone(probe):
        along = _rays(candidates.directions, probe.beam_half_angle, len(Ts), rng)
    hits = cast_rays(target, Ts, candidates.origins, along)
    answered = np.isfinite(hits.distances) & probe.answers(hits.distances, hits.cosines)
    return np.asarray(answered & (hits.faces == candidates.face[:, None])).T


def _rays(directions: Vectors, half_angle: float, count: int, rng: np.random.Generator) -> Vectors:
    """Return unit directions of random rays in each beam's cone, uniform over its disc ``(C, S, 3)``."""
    slope = np.tan(half_angle) * np.sqrt(rng.random((len(directions), count)))
    turn = 2 * np.pi * rng.random(slope.shape)
    across = SO3.frame_from_axis(directions, 2)[:, None]
    radial = across[..., 0] * np.cos(turn)[..., None] + across[..., 1] * np.sin(turn)[..., None]
    return np.asarray((directions[:, None] + slope[..., None] * radial) / np.sqrt(1 + slope**2)[..., None])
