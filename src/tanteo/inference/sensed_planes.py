"""Planes that were sensed, by labels or by normals, as the core compares them with the faces of parts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tanteo.inference.around import outlier_log_density
from tanteo.inference.label_tuples import Planes, labelled_planes
from tanteo.inference.problem import Problem
from tanteo.measurements import ContactPoints
from tanteo.typing import BoolArray, FloatArray, Indices, IntArray

_WIDER = 0.6
"""Of the log of the factor to which the noise is known: so much larger it is taken to be."""

SDS, MADE, TILT = 4.0, 1e-4, 0.004
"""Distances and angles agree within so many standard deviations and so much more [m, rad]."""

_MOST, _CURVED, _LEAST = 13.0, 8.0, 2.0
"""Nats that a labelled plane of no face costs: what it does by the outlier rate, but between the first and the last;
one sensed normal may be of a curved face."""

_TRIPLES, _MORE, _INDEPENDENT = 2, 6, 0.25
"""Triples of planes that poses are made of, and where these lead to nothing; the least product of their normals."""

_WALLS = 6
"""Pairs of points of walls: those of three cylinders have three that are not of one."""

_KNOWN = 0.01
"""Tilt below which it hardly matters how well a normal is known [rad]."""

_COMPARED = 16
"""Planes that are compared, those known best."""


@dataclass(frozen=True, slots=True, eq=False)
class SensedPlanes:
    """Planes as the core compares them.

    Attributes:
        rows: normal, a point of each, sd of its height [m], tilt [rad], span [m], nats without a face, whether its
            side is known, and whether it is one point, which may be of a face that is no plane ``(k, 12)``.
        triples: of them, that fix a pose, or two and -1 ``(3 m,)``.
        walls: of them, one and two points that may be of the walls of two cylinders across it ``(3 w,)``.
        certain: whether some triple fixes one although each normal without a parallel is of a curved face.
    """

    rows: FloatArray
    triples: Indices
    walls: Indices
    certain: bool = True

    @property
    def first(self) -> SensedPlanes:
        """With the triples that are tried first, and with walls where nothing else may fix the pose."""
        none = np.zeros(0, dtype=np.int32)
        return replace(self, triples=self.triples[: 3 * _TRIPLES], walls=none if self.certain else self.walls)

    @property
    def more(self) -> SensedPlanes:
        """With what is left to try: other triples, any of which may be of walls, and points of walls."""
        none = np.zeros(0, dtype=np.int32)
        kept = self.triples.reshape(-1, 3)
        turned = np.concatenate([kept[_TRIPLES:], kept[:, [2, 0, 1]], kept[:, [1, 2, 0]]])
        turned = turned[np.all(turned[:, :2] >= 0, axis=1)]
        return replace(self, triples=turned.ravel(), walls=self.walls if self.certain else none)

    @property
    def doubtful(self) -> float:
        """Nats of the best part from which other triples are tried: more than those of one plane without a face."""
        return 1.2 * float(self.rows[:, 9].max())

    @property
    def hopeless(self) -> float:
        """Nats of the best part from which planes are not what was sensed: more than those of two of them."""
        return 2.2 * float(self.rows[:, 9].max())

    @property
    def believed(self) -> float:
        """Nats of the best part up to which planes and walls are what was sensed."""
        if self.certain:
            return self.hopeless
        return self.doubtful if len(self.walls) else 0.0


def sensed_planes(problem: Problem, points: ContactPoints) -> SensedPlanes:
    """The planes that labels and normals show, with their noise as large as it may be."""
    planes = labelled_planes(points)
    factor = float(np.exp(_WIDER * problem.scale_sd))
    some = np.argsort(planes.tilts, kind="stable")[:_COMPARED]
    normals = planes.normals[some]
    at = planes.middles[some] - planes.radii[some, None] * normals
    shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
    sds = np.hypot(factor * planes.sds[some], shared)
    alone = np.array([len(planes.rows[k]) == 1 for k in some], dtype=bool)
    most = _without_face(problem, points, planes, factor)[some].clip(_LEAST, np.where(alone, _CURVED, _MOST))
    rows = np.column_stack(
        [
            normals,
            at,
            np.hypot(sds, MADE),
            factor * planes.tilts[some],
            planes.spans[some],
            most,
            planes.sided[some],
            alone,
        ]
    )
    lonely = _lonely(normals, planes.tilts[some], alone)
    triples = _triples(normals, planes.tilts[some], lonely)
    doubtful = lonely[triples.reshape(-1, 3)].sum(axis=1) > (triples[2::3] >= 0)
    walls = _walls(normals, at, planes.tilts[some], alone)
    return SensedPlanes(np.ascontiguousarray(rows), triples, walls, bool(np.any(~doubtful)))


def _without_face(problem: Problem, points: ContactPoints, planes: Planes, factor: float) -> FloatArray:
    """Nats that a plane costs if it is of no face ``(k,)``."""
    rate = problem.priors.outlier_rate
    out = []
    for rows in planes.rows:
        peak = -np.log(np.sqrt(2 * np.pi) * factor * points.sd[rows])
        elsewhere = outlier_log_density(points.take(rows), problem.priors)
        out.append(float(np.sum(np.minimum(peak - elsewhere, 12.0))) + float(np.log1p(-rate) - np.log(rate)))
    return np.array(out)


def _lonely(normals: FloatArray, tilts: FloatArray, alone: BoolArray) -> BoolArray:
    """Which are one sensed normal that no other one is parallel to: they may be of a curved face ``(k,)``."""
    sines = np.linalg.norm(np.cross(normals[:, None], normals), axis=-1)
    near: BoolArray = sines < SDS * np.hypot(tilts[:, None], tilts) + TILT
    return np.asarray(alone & (near.sum(axis=1) < 2))


def _walls(normals: FloatArray, at: FloatArray, tilts: FloatArray, alone: BoolArray) -> Indices:
    """Pairs of points, far from each other, that may be of walls across the plane that most others are parallel to."""
    if len(normals) < 3:
        return np.zeros(0, dtype=np.int32)
    within = SDS * np.hypot(tilts[:, None], tilts) + TILT
    first = int(np.argmax(np.sum(np.linalg.norm(np.cross(normals[:, None], normals), axis=-1) < within, axis=1)))
    points = np.flatnonzero(alone & (np.abs(normals @ normals[first]) < within[first]))
    away = at[points] - np.outer((at[points] - at[first]) @ normals[first], normals[first])
    pairs = sorted(
        combinations(range(len(points)), 2), key=lambda ij: -float(np.linalg.norm(away[ij[0]] - away[ij[1]]))
    )
    return np.array([(first, points[i], points[j]) for i, j in pairs[:_WALLS]], dtype=np.int32).ravel()


def _triples(normals: FloatArray, tilts: FloatArray, lonely: BoolArray) -> Indices:
    """Triples that fix a pose, as different as can be: one outlier does not spoil them all.

    What may be of a curved face comes last, in a triple, too. Where all normals lie in one plane, the third is -1:
    poses slide along what two planes leave free.
    """
    if len(normals) < 2:
        return np.zeros(0, dtype=np.int32)
    sines = np.linalg.norm(np.cross(normals[:, None], normals), axis=-1)
    line = np.argmax(sines < SDS * np.hypot(tilts[:, None], tilts) + TILT, axis=1)
    order = np.lexsort((line, lonely))  # triples of the same three lines have them in the same order
    triples = np.array([order[list(k)] for k in combinations(range(len(order)), 3)], dtype=np.int64).reshape(-1, 3)
    chosen = _as_different(triples, np.abs(np.linalg.det(normals[triples])), lonely, tilts)
    if not chosen:
        pairs = np.array([order[list(k)] for k in combinations(range(len(order)), 2)], dtype=np.int64).reshape(-1, 2)
        found = _as_different(pairs, sines[pairs[:, 0], pairs[:, 1]], lonely, tilts)
        chosen = [np.append(pair, -1) for pair in found]
    return np.array(chosen, dtype=np.int32).ravel()


def _as_different(tuples: IntArray, sizes: FloatArray, lonely: BoolArray, tilts: FloatArray) -> list[IntArray]:
    """The most telling tuples of planes, as few planes in two of them as can be; none that are nearly dependent."""
    if not len(tuples):
        return []
    good = sizes * 0.5 ** lonely[tuples].sum(axis=1) / (_KNOWN + tilts[tuples].max(axis=1))
    chosen = list[IntArray]()
    for shared in range(tuples.shape[1]):
        for k in np.argsort(-good, kind="stable"):
            if len(chosen) == _MORE:
                break
            new = all(len(set(tuples[k].tolist()) & set(other.tolist())) <= shared for other in chosen)
            if new and sizes[k] >= _INDEPENDENT:
                chosen.append(tuples[k])
    return chosen
