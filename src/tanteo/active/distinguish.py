"""The single reading that tells one part from another, once the part is located as either of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.active.belief import begin
from tanteo.active.candidates import propose
from tanteo.active.probe import Probe
from tanteo.active.samples import draw, predict
from tanteo.active.start import Start
from tanteo.active.utility import about_mode
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.matching.verdict import corner_moves
from tanteo.surface_search import FreePaths, Target, Touches, identify_touches
from tanteo.surface_search.refine import refine
from tanteo.typing import Covariances, FloatArray, Transforms, Vectors

_PLACES = 60
"""Places of the one part that the other is laid on."""

_AGREE = 0.02
"""How well, in diagonals of the part."""

_TELLS = 0.3
"""Information from which a reading is said to tell two parts apart [nats]."""

_FITTED = np.full(8, 3.0)
"""Steps of the fit, and the scale beyond which a place loses its weight [deviations]."""

_TWINS = 4
"""Ways of laying it on that are looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class Distinction:
    """A reading that tells two parts apart.

    Attributes:
        parts: their names.
        origin: from where to look or move, in the frame of the first part ``(3,)`` [m].
        direction: in which, unit ``(3,)``.
        ranges: what it reads if it is the first, and if it is the second [m]; infinite for nothing.
        sds: standard deviations of these [m].
        T_first_second: where the second part is then, in the frame of the first ``(4, 4)``.
        information: about which it is [nats]; ln 2 is all there is.
        message: one sentence.
    """

    parts: tuple[str, str]
    origin: Vectors
    direction: Vectors
    ranges: FloatArray
    sds: FloatArray
    T_first_second: Transforms
    information: float
    message: str

    @property
    def tells(self) -> bool:
        """Whether it is worth making."""
        return self.information >= _TELLS


def distinguish(first: Target, second: Target, probe: Probe, sd: float = 2e-4, seed: int = 0) -> Distinction:
    """The reading that tells most about which of two parts it is, located to ``sd`` at its corners.

    The second part is where it looks most like the first; it may look like it in several ways.

    Args:
        first: one part.
        second: the other.
        probe: what senses.
        sd: to which the part is located, at its corners [m].
        seed: of the places that are tried.
    """
    twins = laid_on(first, second)
    start = Start(
        (first, second),
        np.array([0] + [1] * len(twins)),
        np.concatenate([np.eye(4)[None], twins]),
        np.stack([located(first, sd)] + [located(second, sd)] * len(twins)),
        np.r_[0.5, np.full(len(twins), 0.5 / max(len(twins), 1))],
        Priors(),
    )
    belief = begin(start)
    candidates = propose(belief, probe, 1500, seed)
    names = (first.part.name, second.part.name)
    if not len(candidates):
        nowhere = np.full(3, np.nan)
        message = "The probe reaches no place of the parts: give it more room, or another approach."
        return Distinction(names, nowhere, nowhere, nowhere[:2], nowhere[:2], twins[0], 0.0, message)
    samples = draw(belief, 96)
    predicted = predict(samples, candidates.origins, candidates.directions)
    told = about_mode(samples, predicted, probe, samples.part)
    k = int(np.argmax(told))
    here = draw(begin(start), 1)  # the middle of every pose
    seen = predict(here, candidates.origins[k : k + 1], candidates.directions[k : k + 1])
    rows = [int(np.flatnonzero(here.part == part)[0]) for part in (0, 1)]
    ranges = seen.ranges[0, rows]
    answers = probe.answers(ranges, seen.cosines[0, rows])
    own = probe.variance(np.where(answers, ranges, 1.0), np.where(answers, seen.cosines[0, rows], 1.0))
    sds = np.sqrt(own + seen.variances[0, rows])
    return Distinction(
        names, candidates.origins[k], candidates.directions[k], np.where(answers, ranges, np.inf), sds, twins[0],
        float(told[k]),        _message(names, np.where(answers, ranges, np.inf), float(told[k])),
    )  # fmt: skip


def laid_on(first: Target, second: Target) -> Transforms:
    """Poses of the second part, in the frame of the first, at which it looks most like it ``(k, 4, 4)``."""
    points, normals, n = first.samples[:_PLACES], first.normals[:_PLACES], min(_PLACES, len(first.samples))
    sd = _AGREE * first.part.diagonal
    none, directions = np.zeros((n, 3, 0)), np.zeros((n, 3))
    touches = Touches(
        tuple(map(str, range(n))), points, np.tile(sd**2 * np.eye(3), (n, 1, 1)), np.zeros(n), directions, normals,
        np.full(n, 0.2), np.zeros(n), none, np.full(n, sd),
    )  # fmt: skip
    priors = Priors(clutter=0.2, radius=max(first.part.radius, second.part.radius))
    answer = identify_touches(touches, FreePaths.none(), [second], priors=priors, top=_TWINS)
    if not answer.hypotheses:
        return SE3.from_parts(np.eye(3), first.part.centroid - second.part.centroid)[None]
    Ts = np.stack([h.T_world_part for h in answer.hypotheses])
    return refine(touches, Ts, second.distance, _FITTED)[0]  # the places are exact: no noise put one beside its face


def located(target: Target, sd: float) -> Covariances:
    """A covariance of the pose with about that standard deviation at the corners ``(6, 6)``."""
    J = corner_moves(target.part)
    return np.asarray(sd**2 * 3 / 6 * np.linalg.inv(np.mean(np.swapaxes(J, 1, 2) @ J, axis=0)))


def _message(names: tuple[str, str], ranges: FloatArray, told: float) -> str:
    words = ["nothing" if np.isinf(r) else f"{1e3 * r:.2f} mm" for r in ranges]
    if told < 0.05:
        both = f"{words[0]} for both" if words[0] == words[1] else f"{words[0]} and {words[1]}, which its noise hides"
        return f"No single reading of this sensor tells {names[0]} from {names[1]}: the best reads {both}."
    sure = "tells" if told > 0.6 else "hardly tells" if told < _TELLS else "helps to tell"
    return f"This reading {sure} {names[0]} ({words[0]}) from {names[1]} ({words[1]})."
