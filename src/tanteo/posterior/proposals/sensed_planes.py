"""Sensed planes from labels or normals, as the core compares them with the faces of parts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from tanteo.factors import ContactPoints
from tanteo.geometry.typing import BoolArray, FloatArray, Indices, IntArray, Vectors
from tanteo.posterior.furniture_points import outlier_log_density
from tanteo.posterior.labels import groups_of
from tanteo.posterior.problem import Problem
from tanteo.posterior.settings import DEFAULTS, SearchSettings


@dataclass(frozen=True, slots=True, eq=False)
class Planes:
    """Planes through the points of a label, or through one point with its normal: ``normals . x = offsets``.

    Attributes:
        normals: unit normals, outward if the sensor's direction is known ``(n, 3)``.
        offsets: offsets of the points, or of the centres of the tip's ball ``(n,)`` [m].
        middles: means of the points ``(n, 3)`` [m].
        spans: largest distance of the points from their mean ``(n,)`` [m].
        radii: radius of the tip ``(n,)`` [m].
        tilts: standard deviations of the normals ``(n,)`` [rad].
        sided: whether the side of the material is known ``(n,)``.
        sds: standard deviation of the height of each plane at its mean ``(n,)`` [m].
        rows: rows of the points of each plane.
    """

    normals: Vectors
    offsets: FloatArray
    middles: Vectors
    spans: FloatArray
    radii: FloatArray
    tilts: FloatArray
    sided: BoolArray
    sds: FloatArray
    rows: tuple[IntArray, ...]


def labelled_planes(points: ContactPoints, settings: SearchSettings) -> Planes:
    """Return planes of labels with three points or more that fit one, and of points with a sensed normal."""
    groups, found = groups_of(points), []
    for g in range(groups.max(initial=-1) + 1):
        rows = np.flatnonzero(groups == g)
        if len(rows) < 3 or not points.factors[rows[0]].flat_face:
            continue
        p, sd = points.points[rows], float(points.sd[rows].max())
        middle = p.mean(axis=0)
        _, sizes, axes = np.linalg.svd(p - middle, full_matrices=False)
        n, width = axes[2], sizes[1] / np.sqrt(len(rows))
        if sizes[2] > settings.gate * sd * np.sqrt(len(rows)) or width < settings.gate * sd:
            continue
        toward = points.inward[rows].sum(axis=0) @ n
        n = -n if toward > 0 else n
        span = np.linalg.norm(p - middle, axis=1).max()
        tilt = sd / (width * np.sqrt(len(rows)))
        found.append(
            (n, n @ middle, middle, span, points.radii[rows].mean(), tilt, toward != 0, sd / np.sqrt(len(rows)), rows)
        )
    for k in np.flatnonzero(
        points.oriented & ~points.centres & (groups < 0) & (points.normal_sds < settings.plane_normal_sd)
    ):
        n, p = points.normals[k], points.points[k]
        found.append((n, n @ p, p, 0.0, points.radii[k], points.normal_sds[k], True, points.sd[k], np.array([k])))
    n, offsets, middles, spans, radii, tilts, sided, sds, own = zip(*found, strict=True) if found else [()] * 9
    return Planes(
        np.array(n).reshape(-1, 3), np.array(offsets), np.array(middles).reshape(-1, 3), np.array(spans),
        np.array(radii), np.array(tilts), np.array(sided, dtype=bool), np.array(sds), tuple(own),
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class SensedPlanes:
    """Sensed planes as the core compares them.

    Attributes:
        rows: normal, point, sd of its height [m], tilt [rad], span [m], cost without a face [nats], whether its side is
            known, and whether it is a single point, which may be on a curved face ``(k, 12)``.
        triples: triples of planes that fix a pose, or pairs and -1 ``(3 m,)``.
        walls: a plane, and two points that may be on the walls of two cylinders across it ``(3 w,)``.
        certain: whether some triple fixes a pose even if each normal without a parallel one is on a curved face.
        settings: settings of the search.
        limit: largest cost of a pose that may still matter, as another part has a pose of low cost [nats].
    """

    rows: FloatArray
    triples: Indices
    walls: Indices
    certain: bool = True
    settings: SearchSettings = DEFAULTS.search
    limit: float = np.inf

    @property
    def first(self) -> SensedPlanes:
        """Return these planes with the triples that are tried first, and with walls if nothing else fixes the pose."""
        none = np.zeros(0, dtype=np.int32)
        return replace(
            self, triples=self.triples[: 3 * self.settings.tuples // 2], walls=none if self.certain else self.walls
        )

    @property
    def more(self) -> SensedPlanes:
        """Return these planes with the remaining triples, whose second plane may be a wall, and walls."""
        none = np.zeros(0, dtype=np.int32)
        kept = self.triples.reshape(-1, 3)
        turned = np.concatenate([kept[self.settings.tuples // 2 :], kept[kept[:, 2] >= 0][:, [0, 2, 1]]])
        return replace(self, triples=turned.ravel(), walls=self.walls if self.certain else none)

    @property
    def doubtful(self) -> float:
        """Return the cost of the best part from which further triples are tried: noise and one outlier [nats]."""
        return 0.5 * len(self.rows) + float(self.rows[:, 9].max())

    @property
    def hopeless(self) -> float:
        """Return the cost of the best part from which planes are wrong: noise and two outliers, or the limit [nats]."""
        return min(self.doubtful + float(self.rows[:, 9].max()), self.limit)

    @property
    def believed(self) -> float:
        """Return the cost of the best part up to which planes and walls are right [nats]."""
        return self.doubtful if self.certain or len(self.walls) else 0.0


def sensed_planes(problem: Problem, points: ContactPoints, planes: Planes | None = None) -> SensedPlanes:
    """Return planes with the largest noise that is probable.

    Args:
        problem: measurements and priors.
        points: the points.
        planes: planes through the points; None for those of labels and sensed normals.
    """
    own = problem.settings.search
    planes = labelled_planes(points, own) if planes is None else planes
    factor = float(np.exp(own.noise_fraction * problem.scale_sd))
    some = np.argsort(planes.tilts, kind="stable")[: own.compared]
    normals = planes.normals[some]
    at = planes.middles[some] - planes.radii[some, None] * normals
    shared = float(np.sqrt(np.sum(points.shared_jacobian**2) / max(len(points), 1)))
    sds = np.hypot(factor * planes.sds[some], shared)
    alone = np.array([len(planes.rows[k]) == 1 for k in some], dtype=bool)
    most = _without_face(problem, points, planes, factor)[some].clip(
        own.cost_least, np.where(alone, own.cost_point, own.negligible)
    )
    rows = np.column_stack(
        [
            normals,
            at,
            np.hypot(sds, own.as_made),
            factor * planes.tilts[some],
            planes.spans[some],
            most,
            planes.sided[some],
            alone,
        ]
    )
    near = _parallel(own, normals, planes.tilts[some])
    lonely = alone & (near.sum(axis=1) < 2)  # they may be on a curved face
    triples = _triples(own, normals, planes.tilts[some], lonely, near)
    doubtful = lonely[triples.reshape(-1, 3)].sum(axis=1) > (triples[2::3] >= 0)
    walls = _walls(own, normals, at, planes.tilts[some], alone, near)
    return SensedPlanes(np.ascontiguousarray(rows), triples, walls, bool(np.any(~doubtful)), own)


def _without_face(problem: Problem, points: ContactPoints, planes: Planes, factor: float) -> FloatArray:
    """Return the cost of each plane if no face of the part explains it ``(k,)`` [nats].

    The cost is approximate: for an undirected point on the surface it assumes a density of 1 / m^2.
    """
    rate = problem.priors.outlier_rate
    peak = -np.log(np.sqrt(2 * np.pi) * factor * points.sd)
    gaps = np.minimum(peak - outlier_log_density(points, problem.priors), 12.0)
    return np.array([gaps[rows].sum() for rows in planes.rows]) + np.log1p(-rate) - np.log(rate)


def _parallel(own: SearchSettings, normals: FloatArray, tilts: FloatArray) -> BoolArray:
    """Return which planes are parallel within their uncertainty ``(k, k)``."""
    sines = np.linalg.norm(np.cross(normals[:, None], normals), axis=-1)
    return np.asarray(sines < own.gate * np.hypot(tilts[:, None], tilts) + own.tilt_as_made)


def _walls(
    own: SearchSettings, normals: FloatArray, at: FloatArray, tilts: FloatArray, alone: BoolArray, near: BoolArray
) -> Indices:
    """Return pairs of distant points that may be on walls across the plane to which most others are parallel."""
    if len(normals) < 3:
        return np.zeros(0, dtype=np.int32)
    first = int(np.argmax(near.sum(axis=1)))
    across = own.gate * np.hypot(tilts, tilts[first]) + own.tilt_as_made
    points = np.flatnonzero(alone & (np.abs(normals @ normals[first]) < across))
    away = at[points] - np.outer((at[points] - at[first]) @ normals[first], normals[first])
    apart = np.linalg.norm(away[:, None] - away, axis=-1)
    pairs = sorted(combinations(range(len(points)), 2), key=lambda ij: -float(apart[ij]))
    return np.array([(first, points[i], points[j]) for i, j in pairs[: own.items]], dtype=np.int32).ravel()


def _triples(
    own: SearchSettings, normals: FloatArray, tilts: FloatArray, lonely: BoolArray, near: BoolArray
) -> Indices:
    """Return triples of planes that fix a pose, most accurate first; each starts with the direction of most planes.

    Planes that may be on a curved face come last. If all normals lie in one plane, the third index is -1, and poses
    slide along the free direction.
    """
    if not len(normals):
        return np.zeros(0, dtype=np.int32)
    counts, lines = near.sum(axis=1), np.unique(np.argmax(near, axis=1))
    order = lines[np.lexsort((-counts[lines], lonely[lines]))]
    known = tilts / np.sqrt(counts)
    for size in (3, 2):
        tuples = np.array(list(combinations(order, size)), dtype=np.int32).reshape(-1, size)
        n = normals[tuples]
        sizes = np.abs(np.linalg.det(n)) if size == 3 else np.linalg.norm(np.cross(n[:, 0], n[:, 1]), axis=1)
        good = sizes * 0.5 ** lonely[tuples].sum(axis=1) / (own.tilt_as_made + known[tuples].max(axis=1))
        chosen = [k for k in np.argsort(-good, kind="stable") if sizes[k] >= own.independent][: own.items]
        if chosen:
            return np.pad(tuples[chosen], ((0, 0), (0, 3 - size)), constant_values=-1).ravel()
    return np.zeros(0, dtype=np.int32)
