"""Goal of a session: required certainty of part and pose, smallest gain, and largest number of readings."""

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
from tanteo.posterior.answers import observed_covariance, without_symmetric_rotation
from tanteo.words.findings import GoalReached

_SAMPLES = 2048
"""Number of sampled poses for the probability of a tolerance."""

_FEWEST = 64
"""Numerical: smallest number of sampled poses of one mode, and of one model of its unstated errors."""

_FAINT = 0.1
"""Fraction of the smallest gain below which the expected information is not accurate."""

_CLEAR = 3.0
"""Definition: sampling errors between a probability and its limit that decide it [standard deviations]; one in 700."""

_ROUNDING = 1e-12
"""Numerical: least standard deviation of a probability."""

_HALF = 0.5
"""Probability above which a part or pose may count as certain, even if the goal states a smaller value."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Goal of a session and its limits; a goal of None does not count.

    A part or pose counts as certain only above 50 %, even if the goal states less.

    Attributes:
        probability: required posterior probability of the part over all its poses; None if the part does not matter.
        tolerance: largest allowed displacement of the corners of the part's box, or of the feature [m]; None if the
            pose does not matter.
        confidence: required probability of the tolerance.
        least_gain: information below which a reading is not worth its cost [nats]. Exceptions are readings that exclude
            the unknown object, and cases in which the remaining readings can provide the little that is missing.
        max_measurements: largest number of readings.
        feature: feature to which the tolerance applies instead of the corners, ``face 3``, ``edge 4`` or ``vertex 2``:
            for a face along its normal, for an edge across its direction. Parts without this feature use the corners.

    Raises:
        InputError: a probability or a length is invalid, or the feature is invalid or has no tolerance.

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
                raise InputError(f"{name}: expected a probability between 0 and 1, got {value:g}. Use 0.99.")
        if self.tolerance is not None:
            check_length("tolerance", self.tolerance, LEAST_SD)
        if self.feature is not None:
            check_feature(self.feature)
            if self.tolerance is None:
                raise InputError(
                    f"feature: expected a tolerance with '{self.feature}', got none. Use tolerance=0.5e-3."
                )
        check_count("max_measurements", self.max_measurements, 1)
        check_number("least_gain", self.least_gain)
        if not self.least_gain >= 0:
            raise InputError("least_gain: expected no negative information [nats].")

    def reached(self, state: SensingState) -> GoalReached | None:
        """Return the reached goal with its probabilities, or None if it is not reached.

        Without a probability and a tolerance there is no goal, and the result is None.

        Args:
            state: posterior of the session.
        """
        if self.probability is None and self.tolerance is None:
            return None
        if state.touches is None or not len(state.touches) or not len(state.weights):
            return None
        P = state.of_parts()
        k = int(np.argmax(P))
        part = state.start.targets[k].part
        goal = GoalReached(part.name)
        if self.probability is not None:
            if not self.is_part_known(state):
                return None
            goal = replace(goal, probability=float(P[k]))
        if self.tolerance is not None:
            within = self.chance(state)
            if within < max(self.confidence, _HALF):
                return None
            feature = places_of(part, self.feature).feature or ""
            goal = replace(goal, tolerance=self.tolerance, within=within, feature=feature)
        return goal

    def is_clear(self, state: SensingState) -> bool:
        """Return whether the sampling error of a state is too small to change whether the goal is reached.

        With ``n`` effective samples the probability ``P`` of a part has the standard deviation ``P (1 - P) / sqrt(n)``,
        because the evidence for an unknown object is not sampled, and the chance ``c`` of the tolerance has
        ``sqrt(c (1 - c) / n)``.

        Args:
            state: posterior of the session.
        """
        if not len(state.weights):
            return True
        parts = state.of_parts()
        P, n = float(parts.max()), state.effective_samples(int(np.argmax(parts)))
        gaps = []
        if self.probability is not None:
            gaps.append((P - max(self.probability, _HALF)) / max(P * (1 - P) / np.sqrt(n), _ROUNDING))
        if self.tolerance is not None:
            c = self.chance(state)
            gaps.append((c - max(self.confidence, _HALF)) / max(np.sqrt(c * (1 - c) / n), _ROUNDING))
        return not gaps or abs(min(gaps)) > _CLEAR

    def chance(self, state: SensingState) -> float:
        """Return the probability that the pose is within the tolerance; NaN without a tolerance.

        Args:
            state: posterior of the session.
        """
        return float("nan") if self.tolerance is None else chance_within(state, self.tolerance, self.feature)

    def left_for_noise(self, state: SensingState) -> float | None:
        """Return the tolerance less what errors take that no policy considers [m]; None without a tolerance.

        These are the errors of :meth:`tanteo.planning.state.SensingState.moves`. Readings that are accurate enough
        without them are not accurate enough with them.

        Args:
            state: posterior of the session.
        """
        if self.tolerance is None or not len(state.weights):
            return self.tolerance
        k = int(np.argmax(state.weights))
        part, own, whole = state.target(k).part, state.covariances[k], state.whole_covariance(k)
        places = places_of(part, self.feature)
        plain, wide = (places.sd(observed_covariance(part, C)) for C in (own, whole))
        return self.tolerance * plain / wide if wide > plain else self.tolerance

    def is_part_known(self, state: SensingState) -> bool:
        """Return whether the part has the required probability; True if the part does not matter.

        Args:
            state: posterior of the session.
        """
        if self.probability is None:
            return True
        return bool(state.of_parts().max(initial=0.0) > max(self.probability, _HALF))

    def confirms(self, state: SensingState) -> bool:
        """Return whether only the probability of an unknown object prevents the goal, and more readings can reduce it.

        Part and pose are certain then, given that the object is known. The probability of an unknown object that is
        similar to the part decreases inversely with the number of readings on the part.

        Args:
            state: posterior of the session.
        """
        if self.probability is None or not len(state.weights) or state.unknown > _HALF:
            return False
        rest, readings = 1 - state.unknown, 0 if state.touches is None else len(state.touches)
        allowed = 1 - self.probability * rest / state.of_parts().max()
        if allowed <= 0 or (readings + 1) * state.unknown > allowed * self.max_measurements:
            return False
        return self.tolerance is None or self.chance(state) >= self.confidence * rest

    def many_small_gains_suffice(self, state: SensingState, gain: float, left: int) -> bool:
        """Return whether many readings with little information each can still reach the goal.

        They can if their total information exceeds the entropy of the posterior, and if the pose given the best mode is
        already within the tolerance.

        Args:
            state: posterior of the session.
            gain: expected information of the next reading [nats].
            left: number of readings that may still be made.
        """
        if not len(state.weights) or gain < _FAINT * self.least_gain:
            return False
        known = state.of_parts() if self.tolerance is None else state.weights
        if gain * left < entropy(np.append(known, state.unknown)).sum():
            return False
        return self.tolerance is None or self.chance(state) >= self.confidence * float(state.weights.max())


def chance_within(state: SensingState, tolerance: float, feature: str | None = None) -> float:
    """Return the probability that all corners of the part's box are within a tolerance of those at the best mode.

    Poses of other modes of the same part count if their corners are within the tolerance, too. Symmetric poses are
    equivalent.

    Args:
        state: posterior of the session.
        tolerance: largest displacement of a corner [m].
        feature: feature to which the tolerance applies instead of the corners, see :class:`Stop`.
    """
    if (tolerance, feature) not in state.chances:
        state.chances[tolerance, feature] = _chance_within(state, tolerance, feature)
    return state.chances[tolerance, feature]


def _chance_within(state: SensingState, tolerance: float, feature: str | None) -> float:
    if not len(state.weights):
        return 0.0
    best = int(np.argmax(state.weights))
    same = np.flatnonzero(state.part == state.part[best])
    counts = np.maximum(_FEWEST, np.ceil(_SAMPLES * state.weights[same] / state.weights[same].sum())).astype(int)
    total = 0.0
    for k, n in zip(same, counts, strict=True):
        Ts, w = _poses(state, int(k), int(n))
        total += float(state.weights[k] * np.average(_distances(state, best, Ts, feature) <= tolerance, weights=w))
    return total


def _poses(state: SensingState, k: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Return poses of one mode and their weights: by its covariance, or posterior samples if it is not normal.

    They have the errors that the mode's covariance does not contain.
    """
    rows, moves = np.zeros(0, dtype=np.int64), state.moves(k)
    if state.draws is not None and not state.modes[k].normal:
        rows = np.flatnonzero(state.draws.mode == k)
    models = zip(moves.weights, moves.factors, moves.offsets, moves.covariances, strict=True)
    Ts, weights = list[FloatArray](), list[FloatArray]()
    if state.draws is not None and len(rows):  # an improbable mode may have no sample
        xi, own = SE3.log(SE3.inverse(state.poses[k]) @ state.draws.Ts[rows]), state.draws.weights[rows]
        noise = np.random.default_rng((1991, len(rows))).normal(size=xi.shape)
        for share, factor, off, C in models:
            Ts.append(state.poses[k] @ SE3.exp(off + factor * xi + noise @ _root(C).T))
            weights.append(share * own)
    else:
        for share, factor, off, C in models:
            n = max(_FEWEST, int(np.ceil(share * count)))
            Ts.append(state.poses[k] @ SE3.exp(off + even_normals(n) @ _root(factor**2 * state.covariances[k] + C).T))
            weights.append(np.full(n, share / n))
    return np.concatenate(Ts), np.concatenate(weights)


def _root(covariance: FloatArray) -> FloatArray:
    """Return a matrix whose product with its transpose is a covariance ``(6, 6)``."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(values.clip(0.0)))


def corner_distances(state: SensingState, k: int, Ts: FloatArray) -> FloatArray:
    """Return the largest displacement of a corner of the box between a mode and other poses ``(S,)`` [m].

    Of symmetric poses, the nearest counts.

    Args:
        state: posterior of the session.
        k: index of the mode.
        Ts: poses of the same part ``(S, 4, 4)``.
    """
    return _distances(state, k, Ts)


def _distances(state: SensingState, k: int, Ts: FloatArray, feature: str | None = None) -> FloatArray:
    return _moved(state, k, Ts, places_of(state.target(k).part, feature))[2]


def largest_corner_sd(state: SensingState) -> float:
    """Return the largest standard deviation of a corner of the most probable part's box, in any direction [m].

    It covers all modes of this part, up to symmetry, so it is large if two different poses are possible. It is NaN if
    no part explains the readings.

    Args:
        state: posterior of the session.
    """
    if not len(state.weights):
        return float("nan")
    best = int(np.argmax(state.weights))
    part, same = state.target(best).part, np.flatnonzero(state.part == state.part[best])
    w = state.weights[same] / state.weights[same].sum()
    places = places_of(part)
    moved, R, _ = _moved(state, best, state.poses[same], places)
    J = R[:, None] @ places.moves
    C = np.stack([observed_covariance(part, state.whole_covariance(int(k))) for k in same])[:, None]
    off = moved - np.tensordot(w, moved, 1)
    whole = np.tensordot(w, J @ C @ np.swapaxes(J, -1, -2) + off[..., :, None] * off[..., None, :], 1)
    return float(np.sqrt(np.linalg.eigvalsh(whole).max().clip(0.0)))


def _moved(state: SensingState, k: int, Ts: FloatArray, places: Places) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacements of points from a mode to other poses ``(S, K, 3)``, rotations, and largest displacements.

    Of symmetric poses, the one with the smallest largest displacement counts.
    """
    part = state.target(k).part
    gaps = SE3.inverse(state.poses[k] @ part.symmetry.Ts)[:, None] @ Ts
    if part.symmetry.continuous:
        gaps = without_symmetric_rotation(part, gaps)
    R, t = gaps[..., :3, :3], gaps[..., :3, 3]
    moved = (R - np.eye(3)) @ places.points.T + t[..., None]  # (..., 3, K): sums over three in a row are slow
    if places.feature is not None:
        moved = np.einsum("kij,...jk->...ik", places.across, moved)
    worst = np.sqrt(np.einsum("...ik,...ik->...k", moved, moved).max(axis=-1))
    least, rows = worst.argmin(axis=0), np.arange(len(Ts))
    return np.swapaxes(moved[least, rows], -1, -2), R[least, rows], worst[least, rows]
