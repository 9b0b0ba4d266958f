"""Poses that are one: climbs that met at one maximum, or at maxima that symmetry makes one."""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3
from tanteo.localization import pose_information
from tanteo.matching.belief import squared_gaps
from tanteo.matching.part_motions import part_scale
from tanteo.parts import Part
from tanteo.surface_search.polish import Polished
from tanteo.surface_search.target import Target
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

SAME_MAXIMUM = 6.0
"""Squared Mahalanobis distance within which two polished poses are one maximum.

Near an edge of the part a climb does not settle to a point.
"""

_AT_ONCE = 64
"""Poses that are compared with all others at once: what the processor's cache holds."""


def distinct_maxima(found: Polished, target: Target, apart: IntArray | None = None) -> Polished:
    """Each maximum once, best first: starts that met at one pose are not more evidence, but it was found by all.

    Args:
        found: maxima of one part.
        target: the part.
        apart: poses of the same number from 0 on are known to be distinct ``(S,)``; nothing is known if not given.
    """
    if not len(found.Ts):
        return found
    order = np.argsort(-found.log_evidence, kind="stable")
    found = found.take(order)
    same = _same(target.part, found.Ts, pose_information(found.information), None if apart is None else apart[order])
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


def _same(part: Part, Ts: Transforms, information: FloatArray, apart: IntArray | None = None) -> BoolArray:
    """Which later poses put the part where an earlier one does ``(S, S)``, each with itself."""
    out, every = np.eye(len(Ts), dtype=bool), np.arange(len(Ts))
    bound = _Bound(part, Ts, information)
    labels = np.full(len(Ts), -1) if apart is None else apart
    for label in np.unique(labels):
        own = np.flatnonzero(labels == label)
        others = every if label < 0 else np.flatnonzero(labels != label)
        for k in range(0, len(own), _AT_ONCE):
            rows = own[k : k + _AT_ONCE]
            columns = others[others > rows[0]]
            near = bound.allows(rows, columns) & (columns > rows[:, None])
            i, j = (index[pair] for index, pair in zip((rows, columns), np.nonzero(near), strict=True))
            out[i, j] = squared_gaps(part, Ts[i], Ts[j], information[j]) <= SAME_MAXIMUM
    return out


class _Bound:
    """Which pairs of poses lower bounds of their distance do not exclude, in a hundredth of the time.

    The logarithm of a motion turns by no less than the chord of its rotation and shifts by no less than its
    translation; the least eigenvalue of the information is what any unit of both costs. Where nothing resists some
    motion this excludes nothing, and the turn alone may: the sine along its axis is no longer than the logarithm.
    """

    def __init__(self, part: Part, Ts: Transforms, information: FloatArray) -> None:
        unit = part_scale(part).T @ information @ part_scale(part)
        T_part_middle = SE3.from_parts(np.eye(3), part.centroid)
        images = SE3.inverse(T_part_middle) @ part.symmetry.Ts @ T_part_middle
        self.images = None if part.symmetry.continuous else images
        self.Ts, self.length = Ts @ T_part_middle, part.diagonal
        self.middle = self.Ts[:, :3, 3].mean(axis=0)
        self.least, self.turn = np.linalg.eigvalsh(unit)[:, 0].clip(0.0), _of_turns(unit)

    def allows(self, rows: IntArray, columns: IntArray) -> BoolArray:
        """Pairs ``(R, C)``."""
        if self.images is None:
            return np.ones((len(rows), len(columns)), dtype=bool)
        later, out = self.Ts[columns], np.zeros((len(rows), len(columns)), dtype=bool)
        place = _embedded(later, self.middle, self.length)
        for image in self.images:
            first = self.Ts[rows] @ image
            near = self.least[columns] * _chords(_embedded(first, self.middle, self.length), place)
            out |= (near <= SAME_MAXIMUM) & (_turns(first, later, self.turn[columns]) <= SAME_MAXIMUM)
        return out


def _chords(a: FloatArray, b: FloatArray) -> FloatArray:
    """Squared distances ``(R, C)`` of embedded poses, rounded down."""
    own = np.sum(b**2, axis=1)
    slack = 1e-12 * (1 + own.max(initial=0.0))
    return np.asarray(np.sum(a**2, axis=1)[:, None] + own - 2 * a @ b.T - slack)


def _turns(first: Transforms, second: Transforms, information: FloatArray) -> FloatArray:
    """Squared Mahalanobis lengths of the sines of the turns from each of the first to each of the second ``(R, C)``.

    Args:
        first: poses ``(R, 4, 4)``.
        second: poses ``(C, 4, 4)``.
        information: of the second on their turn alone ``(C, 3, 3)``.
    """
    a, b = np.swapaxes(first[:, :3, :3], 1, 2), np.swapaxes(second[:, :3, :3], 1, 2)  # rows: axes of the part
    sines = [
        0.5 * np.concatenate([a[:, j], -a[:, i]], axis=1) @ np.concatenate([b[:, i], b[:, j]], axis=1).T
        for i, j in ((1, 2), (2, 0), (0, 1))
    ]
    out = np.zeros((len(a), len(b)))
    for i in range(3):
        out += information[:, i, i] * sines[i] ** 2
        for j in range(i):
            out += 2 * information[:, i, j] * sines[i] * sines[j]
    return out


def _of_turns(information: FloatArray) -> FloatArray:
    """What is known of the turn if the place is not ``(S, 3, 3)``, of information on both ``(S, 6, 6)``."""
    values, vectors = np.linalg.eigh(information[:, :3, :3])
    values = np.maximum(values, 1e-13 * values[:, -1:] + np.finfo(np.float64).tiny)
    across = np.swapaxes(vectors, 1, 2) @ information[:, :3, 3:]
    left = information[:, 3:, 3:] - np.swapaxes(across, 1, 2) @ (across / values[:, :, None])
    values, vectors = np.linalg.eigh(left)
    return np.asarray((vectors * values.clip(0.0)[:, None]) @ np.swapaxes(vectors, 1, 2))


def _embedded(Ts: Transforms, middle: Vectors, length: float) -> FloatArray:
    """Points ``(S, 12)`` whose squared distances are turn (of the chord) plus shift, in lengths of the part."""
    turn = np.sqrt(0.5) * Ts[:, :3, :3].reshape(len(Ts), 9)
    return np.concatenate([turn, (Ts[:, :3, 3] - middle) / length], axis=1)
