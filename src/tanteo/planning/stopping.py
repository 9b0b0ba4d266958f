"""When to stop: the part is known, it is placed well enough, or nothing is left that is worth its cost."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.limits import LEAST_SD, check_count, check_length, check_number
from tanteo.geometry.special import entropy
from tanteo.geometry.typing import FloatArray
from tanteo.planning.places import Places, check_feature, places_of
from tanteo.planning.samples import even_normals
from tanteo.planning.state import SensingState
from tanteo.posterior import observed_covariance, without_spin
from tanteo.words.findings import GoalReached

_SAMPLES = 2048
"""Poses by which the probability to be within a tolerance is counted."""

_FAINT = 0.1
"""Share of the least gain below which a reading is no longer expected to tell anything: so exact are expectations."""

_HALF = 0.5
"""A part counts as identified only above 50 %: below, no reading is made to confirm it."""


@dataclass(frozen=True, slots=True)
class Stop:
    """What has to be known before sensing ends; what is None is not asked for.

    Nothing is known that is not more probable than all else together, however little is asked for.

    Attributes:
        probability: of one part, whatever its pose.
        tolerance: that all corners of the part's box are to be within, or the feature [m].
        confidence: with which they are.
        feature: one feature that has to keep the tolerance instead of the corners, ``face 3``, ``edge 4`` or
            ``vertex 2``: a face along its normal, an edge across itself. Of parts that have none of that name, the
            corners.
        least_gain: information below which no reading is worth making [nats], but to confirm what is known but for
            the unknown object, and where the readings that may still be made tell what little is left to know.
        max_measurements: number of readings at which to end in any case.

    Raises:
        InputError: no probability, a tolerance that is no length, a feature without tolerance, or no name of one.

    Example:
        >>> stop = tanteo.Stop(tolerance=0.5e-3, confidence=0.95)
        >>> stop.max_measurements
        100
    """

    probability: float | None = 0.99
    tolerance: float | None = None
    confidence: float = 0.95
    least_gain: float = 0.02
    max_measurements: int = 100
    feature: str | None = None

    def __post_init__(self) -> None:
        for name in ("probability", "confidence"):
            value = getattr(self, name)
            if value is not None:
                check_number(name, value)
            if value is not None and not 0 < value < 1:
                raise InputError(f"{name}: expected a probability between 0 and 1, got {value:g}. Say 0.99.")
        if self.tolerance is not None:
            check_length("tolerance", self.tolerance, LEAST_SD)
        if self.feature is not None:
            check_feature(self.feature)
            if self.tolerance is None:
                raise InputError(
                    f"feature: expected a tolerance with '{self.feature}', got none. Say tolerance=0.5e-3."
                )
        check_count("max_measurements", self.max_measurements, 1)
        check_number("least_gain", self.least_gain)
        if not self.least_gain >= 0:
            raise InputError("least_gain: expected no negative information [nats].")

    def reached(self, state: SensingState) -> GoalReached | None:
        """Return what is known if the goal is reached, or None."""
        if state.touches is None or not len(state.touches) or not len(state.weights):
            return None
        P = state.of_parts()
        k = int(np.argmax(P))
        part = state.start.targets[k].part
        goal = GoalReached(part.name)
        if self.probability is not None:
            if not self.knows_part(state):
                return None
            goal = replace(goal, probability=float(P[k]))
        if self.tolerance is not None:
            within = self.chance(state)
            if within < max(self.confidence, _HALF):
                return None
            feature = places_of(part, self.feature).feature or ""
            goal = replace(goal, tolerance=self.tolerance, within=within, feature=feature)
        return goal

    def chance(self, state: SensingState) -> float:
        """That the corners, or the feature, are within the tolerance; NaN where none is asked for."""
        return float("nan") if self.tolerance is None else chance_within(state, self.tolerance, self.feature)

    def knows_part(self, state: SensingState) -> bool:
        """Whether it is known well enough which part it is; always, where nobody asks."""
        if self.probability is None:
            return True
        return bool(state.of_parts().max(initial=0.0) > max(self.probability, _HALF))

    def confirms(self, state: SensingState) -> bool:
        """Whether more readings on the part are all that is missing: which it is among the parts, and where, is known.

        Then only the unknown object is in the way. That it is a part like this one gets less probable by one over the
        number of readings that are on it; no single one of them tells much.
        """
        if self.probability is None or not len(state.weights) or state.unknown > _HALF:
            return False
        rest, readings = 1 - state.unknown, 0 if state.touches is None else len(state.touches)
        allowed = 1 - self.probability * rest / state.of_parts().max()
        if allowed <= 0 or (readings + 1) * state.unknown > allowed * self.max_measurements:
            return False
        return self.tolerance is None or self.chance(state) >= self.confidence * rest

    def settles(self, state: SensingState, gain: float, left: int) -> bool:
        """Whether so many readings, each of which tells little, would tell what is not known yet: part and place.

        What is left to know of a part at 0.98, where 0.99 is asked for, is little too. Where the tolerance is not kept
        even if it is what it most probably is, more is missing than that.

        Args:
            state: what is known.
            gain: what the next reading is expected to tell [nats].
            left: readings that may still be made.
        """
        if not len(state.weights) or gain < _FAINT * self.least_gain:
            return False
        known = state.of_parts() if self.tolerance is None else state.weights
        if gain * left < entropy(np.append(known, state.unknown)).sum():
            return False
        return self.tolerance is None or self.chance(state) >= self.confidence * float(state.weights.max())


def chance_within(state: SensingState, tolerance: float, feature: str | None = None) -> float:
    """Probability that all corners of the part's box are within a tolerance of where the best mode puts them.

    Other modes of the same part count as far as they put the corners there too; symmetric poses are one.

    Args:
        state: what is known.
        tolerance: how far off they may be [m].
        feature: name of one that is to be within it instead, see :class:`Stop`.
    """
    if (tolerance, feature) not in state.chances:
        state.chances[tolerance, feature] = _chance_within(state, tolerance, feature)
    return state.chances[tolerance, feature]


def _chance_within(state: SensingState, tolerance: float, feature: str | None) -> float:
    if not len(state.weights):
        return 0.0
    best = int(np.argmax(state.weights))
    same = np.flatnonzero(state.part == state.part[best])
    counts = np.maximum(64, np.ceil(_SAMPLES * state.weights[same] / state.weights[same].sum())).astype(int)
    total = 0.0
    for k, n in zip(same, counts, strict=True):
        Ts, w = _poses(state, int(k), int(n))
        total += float(state.weights[k] * np.average(_distances(state, best, Ts, feature) <= tolerance, weights=w))
    return total


def _poses(state: SensingState, k: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Poses of one mode and their weights: from its covariance, or those it was weighed by if it is not normal."""
    rows = np.zeros(0, dtype=np.int64)
    if state.draws is not None and not state.modes[k].normal:
        rows = np.flatnonzero(state.draws.mode == k)
    if state.draws is not None and len(rows):  # of a mode that hardly matters, no draw may be left
        return state.draws.Ts[rows], state.draws.weights[rows]
    values, vectors = np.linalg.eigh(state.covariances[k])
    xi = even_normals(count) @ (vectors * np.sqrt(values.clip(0.0))).T
    return state.poses[k] @ SE3.exp(xi), np.ones(count)


def corner_distances(state: SensingState, k: int, Ts: FloatArray) -> FloatArray:
    """Largest distance of a corner of the part's box from where mode ``k`` has it ``(S,)`` [m], up to symmetry.

    Args:
        state: what is known.
        k: the mode.
        Ts: poses of the same part ``(S, 4, 4)``.
    """
    return _distances(state, k, Ts)


def _distances(state: SensingState, k: int, Ts: FloatArray, feature: str | None = None) -> FloatArray:
    return _moved(state, k, Ts, places_of(state.target(k).part, feature))[2]


def largest_corner_sd(state: SensingState) -> float:
    """Largest standard deviation of the position of a corner of the likeliest part's box, in any direction [m].

    Over all poses that this part may have: that of one which may lie in either of two ways is large. Up to symmetry;
    NaN if no part explains the readings.
    """
    if not len(state.weights):
        return float("nan")
    best = int(np.argmax(state.weights))
    part, same = state.target(best).part, np.flatnonzero(state.part == state.part[best])
    w = state.weights[same] / state.weights[same].sum()
    places = places_of(part)
    moved, R, _ = _moved(state, best, state.poses[same], places)
    J = R[:, None] @ places.moves
    C = np.stack([observed_covariance(part, state.covariances[k]) for k in same])[:, None]
    off = moved - np.tensordot(w, moved, 1)
    whole = np.tensordot(w, J @ C @ np.swapaxes(J, -1, -2) + off[..., :, None] * off[..., None, :], 1)
    return float(np.sqrt(np.linalg.eigvalsh(whole).max().clip(0.0)))


def _moved(state: SensingState, k: int, Ts: FloatArray, places: Places) -> tuple[FloatArray, FloatArray, FloatArray]:
    """From where mode ``k`` has the places to where poses have them, in its frame ``(S, K, 3)``; how these are turned.

    And how far the worst place is moved ``(S,)``. Of poses that symmetry makes equal, the one at which that is least.
    """
    part = state.target(k).part
    gaps = SE3.inverse(state.poses[k] @ part.symmetry.Ts)[:, None] @ Ts
    if part.symmetry.continuous:
        gaps = without_spin(part, gaps)
    R, t = gaps[..., :3, :3], gaps[..., :3, 3]
    moved = (R - np.eye(3)) @ places.points.T + t[..., None]  # (..., 3, K): sums over three in a row are slow
    if places.feature is not None:
        moved = np.einsum("kij,...jk->...ik", places.across, moved)
    worst = np.sqrt(np.einsum("...ik,...ik->...k", moved, moved).max(axis=-1))
    least, rows = worst.argmin(axis=0), np.arange(len(Ts))
    return np.swapaxes(moved[least, rows], -1, -2), R[least, rows], worst[least, rows]
