"""Poses that are one: climbs that met at one maximum, or at maxima that symmetry makes one."""

from __future__ import annotations

import numpy as np

from tanteo.localization import pose_information
from tanteo.matching.belief import squared_gaps
from tanteo.parts import Part
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.target import Target
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

SAME_MAXIMUM = 6.0
"""Squared Mahalanobis distance within which two polished poses are one maximum.

Near an edge of the part a climb does not settle to a point.
"""

_PAIRS = 20_000
"""Pairs of poses that are compared at once."""


def distinct_maxima(found: Polished, target: Target) -> Polished:
    """Each maximum once, best first: starts that met at one pose are not more evidence, but it was found by all."""
    if not len(found.Ts):
        return found
    found = found.take(np.argsort(-found.log_evidence, kind="stable"))
    same = _same(target.part, found.Ts, pose_information(found.information))
    left, kept, groups = np.ones(len(found.Ts), dtype=bool), [], []
    for k in range(len(found.Ts)):
        if left[k]:
            met = left & same[k]
            kept.append(k)
            groups.append(np.bitwise_or.reduce(found.groups[met]))
            left &= ~met
    out = found.take(np.array(kept, dtype=np.int64))
    out.groups[:] = groups
    return out


def _same(part: Part, Ts: Transforms, information: FloatArray) -> BoolArray:
    """Which later poses put the part where an earlier one does ``(S, S)``, each with itself."""
    out = np.eye(len(Ts), dtype=bool)
    first, second = np.nonzero(np.triu(_may_be_same(part, Ts, information), 1))
    for k in range(0, len(first), _PAIRS):
        i, j = first[k : k + _PAIRS], second[k : k + _PAIRS]
        out[i, j] = squared_gaps(part, Ts[i], Ts[j], information[j]) <= SAME_MAXIMUM
    return out


def _may_be_same(part: Part, Ts: Transforms, information: FloatArray) -> BoolArray:
    """Pairs that a lower bound of their distance does not exclude ``(S, S)``, in a hundredth of the time.

    The logarithm of a motion turns by no less than the chord of its rotation and shifts by no less than its
    translation; the least eigenvalue of the information is what any unit of both costs.
    """
    if part.symmetry.continuous:
        return np.ones((len(Ts), len(Ts)), dtype=bool)
    length = part.diagonal
    scale = np.r_[np.full(3, length), np.ones(3)]
    least = np.linalg.eigvalsh(information * np.outer(scale, scale))[:, 0].clip(0.0)
    middle = Ts[:, :3, 3].mean(axis=0)
    own = _embedded(Ts, middle, length)
    nearest = np.full((len(Ts), len(Ts)), np.inf)
    for image in part.symmetry.Ts:
        other = _embedded(Ts @ image, middle, length)
        squared = np.sum(other**2, axis=1)[:, None] + np.sum(own**2, axis=1) - 2 * other @ own.T
        nearest = np.minimum(nearest, squared)
    slack = 1e-12 * (1 + np.sum(own**2, axis=1).max(initial=0.0))
    return np.asarray(least * (nearest - slack) <= SAME_MAXIMUM)


def _embedded(Ts: Transforms, middle: Vectors, length: float) -> FloatArray:
    """Points ``(S, 12)`` whose squared distances are turn (of the chord) plus shift, in lengths of the part."""
    turn = np.sqrt(0.5) * Ts[:, :3, :3].reshape(len(Ts), 9)
    return np.concatenate([turn, (Ts[:, :3, 3] - middle) / length], axis=1)
