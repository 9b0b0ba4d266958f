"""Where a part may turn out to lie when a plan is carried out, and which readings meet their faces there.

A reading that is chosen beforehand is made whether it still meets its face or not. Placements are drawn from all that
is known beforehand, each with errors of sensor, robot and readings; at each only the readings count that have room and
meet their faces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray, Transforms, Vectors
from tanteo.planning.candidates import Candidates
from tanteo.planning.clearance import clear_at
from tanteo.planning.probe import Probe
from tanteo.planning.rays import has_cone, rays_met
from tanteo.planning.samples import even_normals
from tanteo.posterior import PreparedPart

_CHOICE, _VERDICT = 256, 1024
"""Placements by which readings are chosen, and others by which the choice is judged: its own would flatter it."""

_NOISES = 4
"""Samples of the readings' noise at each."""

_SEED = 1991, 27


@dataclass(frozen=True, slots=True)
class Promise:
    """What some readings bring that are chosen beforehand.

    Attributes:
        within: chance that the tolerance is kept, over all placements; only readings that meet their faces count.
        if_met: the same if every reading meets its face.
        all_meet: share of the placements at which every reading does.
        room: share of them at which all starts, and the ways there, are clear of the part.
    """

    within: float
    if_met: float
    all_meet: float
    room: float


@dataclass(frozen=True, slots=True, eq=False)
class Placements:
    """Samples of where the part lies, how far sensor and robot are off, and what the candidates meet then.

    Attributes:
        Ts: poses of the part, world ``(S, 4, 4)``.
        errors: of what is expected of pose, bias and base ``(S, D)``.
        noise: standard normal, that of the readings ``(S, M, D)``.
        room: whether the probe has room at the start of each candidate and on the way there ``(S, N)``.
        meets: whether each candidate has room and is answered, by its face ``(S, N)``.
    """

    Ts: Transforms
    errors: FloatArray
    noise: FloatArray
    room: BoolArray
    meets: BoolArray

    def __len__(self) -> int:
        return len(self.Ts)

    def take(self, rows: IntArray | BoolArray) -> Placements:
        """With some of the candidates."""
        return replace(self, room=self.room[:, rows], meets=self.meets[:, rows])

    def patterns(self, chosen: IntArray) -> list[tuple[BoolArray, IntArray]]:
        """Which of the chosen readings meet their faces ``(n,)``, and the placements where it is these."""
        found, which = np.unique(self.meets[:, chosen], axis=0, return_inverse=True)
        order = np.argsort(which, kind="stable")
        return list(zip(found, np.split(order, np.cumsum(np.bincount(which.ravel()))[:-1]), strict=True))


def placements(
    target: PreparedPart, T: Transforms, prior: Covariances, candidates: Candidates, probe: Probe
) -> tuple[Placements, Placements]:
    """Those to choose by, and those to judge by.

    Args:
        target: the part.
        T: its expected pose ``(4, 4)``.
        prior: covariance of pose, bias and base ``(D, D)``; the pose comes first, independent of the others.
        candidates: readings.
        probe: what makes them.
    """
    rng, count = np.random.default_rng(_SEED), _CHOICE + _VERDICT
    normal = np.concatenate([even_normals(count + 1)[1:], rng.normal(size=(count, len(prior) - 6))], axis=1)
    errors = normal @ np.linalg.cholesky(prior).T
    Ts, noise = T @ SE3.exp(errors[:, :6]), rng.normal(size=(count, _NOISES, len(prior)))
    room = clear_at(target, T, Ts, candidates, probe)
    every = Placements(Ts, errors, noise, room, room & _meets(target, Ts, candidates, probe, rng))
    first, others = np.split(np.arange(count), [_CHOICE])
    return tuple(Placements(*(getattr(every, name)[k] for name in every.__slots__)) for k in (first, others))  # type: ignore[return-value]


def _meets(
    target: PreparedPart, Ts: Transforms, candidates: Candidates, probe: Probe, rng: np.random.Generator
) -> BoolArray:
    """Whether each candidate is answered, by its face ``(S, C)``; of a cone by any one of its rays."""
    along = candidates.directions[:, None]
    if has_cone(probe):
        along = _rays(candidates.directions, probe.beam_half_angle, len(Ts), rng)
    met = rays_met(target, Ts, candidates.origins, along)
    answered = np.isfinite(met.distances) & probe.answers(met.distances, met.cosines)
    return np.asarray(answered & (met.faces == candidates.face[:, None])).T


def _rays(directions: Vectors, half_angle: float, count: int, rng: np.random.Generator) -> Vectors:
    """Of every cone so many rays, drawn evenly over its disc ``(C, S, 3)``."""
    slope = np.tan(half_angle) * np.sqrt(rng.random((len(directions), count)))
    turn = 2 * np.pi * rng.random(slope.shape)
    across = SO3.frame_from_axis(directions, 2)[:, None]
    aside = across[..., 0] * np.cos(turn)[..., None] + across[..., 1] * np.sin(turn)[..., None]
    return np.asarray((directions[:, None] + slope[..., None] * aside) / np.sqrt(1 + slope**2)[..., None])
