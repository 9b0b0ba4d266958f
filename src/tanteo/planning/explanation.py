"""Information of each reading of a session, and support of the answer by readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from tanteo.geometry.typing import Covariances, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.planning.start import Start
from tanteo.planning.state import SensingState, begin
from tanteo.planning.stopping import largest_corner_sd
from tanteo.posterior import DEFAULTS, as_hypothesis
from tanteo.posterior.answers import corner_moves, motion_of, principal_errors
from tanteo.posterior.fit_at_mode import face_names, goodness_of_fit, information_by_point
from tanteo.words import Motion

_FORGOTTEN = np.exp(-DEFAULTS.search.negligible)
"""Upper bound of the probability of a part that the search has discarded."""

_NOTHING = 1e-300
"""Numerical: information that is not divided by zero."""


class Observation(Protocol):
    """Posterior after a step, as in :class:`tanteo.planning.Step`."""

    @property
    def ids(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def probabilities(self) -> FloatArray: ...  # noqa: D102
    @property
    def unknown(self) -> float: ...  # noqa: D102
    @property
    def T_world_part(self) -> Transforms: ...  # noqa: D102
    @property
    def part(self) -> int: ...  # noqa: D102
    @property
    def covariance(self) -> Covariances: ...  # noqa: D102
    @property
    def corner_sd(self) -> float: ...  # noqa: D102


@dataclass(frozen=True, slots=True)
class Added:
    """Information of the readings of one step.

    Attributes:
        ids: names of the readings of the step.
        faces: face of the answer's part that each reading hit; ``nothing of it`` for an outlier, ``nothing`` for a
            free-space ray.
        part: name of the most probable part after the step; empty if no part explains the readings.
        probability: probability of that part.
        about_part: information about the part: relative entropy of the probabilities after and before [nats].
        about_pose: information about the pose: half the log of the ratio of the covariances' determinants [nats]; NaN
            if the most probable part has changed.
        motion: motion of the part whose uncertainty decreased most; None if no uncertainty decreased.
        narrowed: ratio of the standard deviations along that motion after and before the step; NaN without a motion.
        corner_sd_before: largest corner sd of the same part before the step, over all its possible poses [m].
        corner_sd: largest corner sd after the step [m].
    """

    ids: tuple[str, ...]
    faces: tuple[str, ...]
    part: str
    probability: float
    about_part: float
    about_pose: float
    motion: Motion | None
    narrowed: float
    corner_sd_before: float
    corner_sd: float


@dataclass(frozen=True, slots=True)
class Direction:
    """Principal direction of the final pose's covariance, and the readings that constrain it.

    The directions are principal for the corners of the part's box: the squares of ``moves`` sum to their mean square
    error, assumed errors included. The fractions divide the information of the readings for known shared errors.

    Attributes:
        motion: motion of the part along the direction.
        moves: root mean square displacement of the corners for one standard deviation [m].
        shares: name of each reading and its fraction of the information along the motion, largest first.
        prior: fraction of the information that comes from the prior; all fractions sum to one.
    """

    motion: Motion
    moves: float
    shares: tuple[tuple[str, float], ...]
    prior: float


@dataclass(frozen=True, slots=True)
class Explanation:
    """Explanation of a session's answer.

    Attributes:
        part: name of the answer's part; empty if no part explains the readings.
        added: information of each step.
        directions: principal directions of the answer's pose without the spin of a round part, most uncertain first;
            empty before the first contact point.
    """

    part: str
    added: tuple[Added, ...]
    directions: tuple[Direction, ...]


def explain(state: SensingState, steps: Sequence[Observation]) -> Explanation:
    """Explain which readings determine the part and the pose of a session's answer.

    Args:
        state: final state of the session.
        steps: steps of the session, in order.
    """
    start, face_of = state.start, _hit_faces(state)
    before: list[Observation | None] = [None, *steps][: len(steps)]
    added = tuple(_added(start, a, b, face_of) for a, b in zip(before, steps, strict=True))
    name = state.target(0).part.name if len(state.weights) else ""
    return Explanation(name, added, _directions(state))


def _hit_faces(state: SensingState) -> dict[str, str]:
    """Return the name of the face that each reading hit if the best mode is true, by name of the reading."""
    if state.touches is None or not state.modes:
        return {} if state.touches is None else dict.fromkeys(state.touches.ids, "nothing of it")
    one = goodness_of_fit(state.modes[0])
    rows = zip(state.touches.ids, face_names(one), one.inliers, strict=True)
    return {i: n if ok else "nothing of it" for i, n, ok in rows}


def _added(start: Start, before: Observation | None, after: Observation, face_of: dict[str, str]) -> Added:
    faces = tuple(face_of.get(name, "nothing") for name in after.ids)
    about_part = _about_part(start, before, after)
    if after.part < 0:
        return Added(after.ids, faces, "", 0.0, about_part, np.nan, None, np.nan, np.nan, np.nan)
    part, old = start.targets[after.part].part, _covariance_before(start, before, after.part)
    P, sd = float(after.probabilities[after.part]), after.corner_sd
    if old is None:
        return Added(after.ids, faces, part.name, P, about_part, np.nan, None, np.nan, np.nan, sd)
    shrunk = 0.5 * float(np.linalg.slogdet(old)[1] - np.linalg.slogdet(after.covariance)[1])
    motion, narrowed = _narrowed(part, old, after)
    sd_before = _rough_corner_sd(start, after.part) if before is None else before.corner_sd
    return Added(after.ids, faces, part.name, P, about_part, shrunk, motion, narrowed, sd_before, sd)


def _rough_corner_sd(start: Start, part: int) -> float:
    """Return the largest corner sd of a part by its prior poses [m]."""
    own = np.flatnonzero(start.part == part)
    rough = {name: getattr(start, name)[own] for name in ("part", "Ts", "covariances", "weights")}
    return largest_corner_sd(begin(replace(start, **rough)))


def _about_part(start: Start, before: Observation | None, after: Observation) -> float:
    """Return the relative entropy of the probabilities after a step to those before it [nats]."""
    P = np.bincount(start.part, weights=start.weights, minlength=len(start.targets)) * (1 - start.priors.unknown)
    prior = np.r_[P, start.priors.unknown] if before is None else np.r_[before.probabilities, before.unknown]
    now = np.r_[after.probabilities, after.unknown]
    some = now > 0
    return max(0.0, float(np.sum(now[some] * np.log(now[some] / np.maximum(prior[some], _FORGOTTEN)))))


def _covariance_before(start: Start, before: Observation | None, part: int) -> Covariances | None:
    """Return the covariance of a part's pose before a step, or None if another part was more probable."""
    if before is not None:
        return before.covariance if before.part == part else None
    rows = np.flatnonzero(start.part == part)
    return np.asarray(start.covariances[rows[np.argmax(start.weights[rows])]])


def _narrowed(part: Part, old: Covariances, after: Observation) -> tuple[Motion | None, float]:
    """Return the motion whose standard deviation decreased most, and the ratio of the standard deviations."""
    d = np.sqrt(np.diag(old))
    L = d[:, None] * np.linalg.cholesky(old / np.outer(d, d))
    values, vectors = np.linalg.eigh(np.linalg.solve(L, np.linalg.solve(L, after.covariance).T))
    if values[0] > 1 - 1e-6:
        return None, np.nan
    return motion_of(part, L @ vectors[:, 0], after.T_world_part), float(np.sqrt(max(values[0], 0.0)))


def _directions(state: SensingState) -> tuple[Direction, ...]:
    """Return the principal errors of the answer's pose, with the assumed errors that its covariance contains."""
    if state.touches is None or not state.modes:
        return ()
    mode, part = state.modes[0], state.target(0).part
    stated = state.start.stated(int(state.rows[0]))
    answer = as_hypothesis(state.touches, goodness_of_fit(mode), stated, state.unstated)
    own, J, out = information_by_point(mode), corner_moves(part), []
    for xi in principal_errors(part, answer.covariance):
        total, each = max(float(xi @ mode.information[:6, :6] @ xi), _NOTHING), (own @ xi) @ xi
        rms = float(np.sqrt(np.mean(np.sum((J @ xi) ** 2, axis=-1))))
        order = np.argsort(-each, kind="stable")
        shares = tuple((state.touches.ids[i], float(each[i] / total)) for i in order)
        words = motion_of(part, xi, state.poses[0])
        out.append(Direction(words, rms, shares, 1 - float(each.sum()) / total))
    return tuple(out)
