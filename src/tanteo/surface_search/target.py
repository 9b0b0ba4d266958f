"""A part prepared for readings without correspondences: its surface, distance grid and even surface samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from dataclasses import field as attribute
from typing import Any

import numpy as np

from tanteo.lie import SE3
from tanteo.matching.model import PartModel
from tanteo.parts import Part, exact_faces
from tanteo.parts.several import as_parts
from tanteo.shapes import (
    Borders,
    DistanceField,
    NearPlanes,
    Revolved,
    Surface,
    borders,
    distance_field,
    near_planes,
    nearest,
)
from tanteo.surface_search.spins import spins_about
from tanteo.typing import FloatArray, IntArray, Transforms, Vectors

SAMPLES = 320
"""Surface points among which places for readings are looked for."""

GRID_SD = 0.3
"""Error of the distance grid, in cells."""

_POOL, _POOL_OF_MANY = 12, 3
"""Random points drawn for every sample kept; of more samples than usual fewer, as that takes long."""

MOST_SAMPLES = 3000
"""No more for readings that lie close together."""


@dataclass(frozen=True, slots=True, eq=False)
class SamplePairs:
    """All ordered pairs of samples by their distance; ``line`` runs from the first to the second.

    Attributes:
        gaps: distances, ascending ``(P,)`` [m].
        first: index of one sample ``(P,)``.
        second: of the other ``(P,)``.
        cosines: products of the two normals ``(P,)``.
        starts: cosine of the line with the first normal ``(P,)``.
        ends: with the second ``(P,)``.
    """

    gaps: FloatArray
    first: IntArray
    second: IntArray
    cosines: FloatArray
    starts: FloatArray
    ends: FloatArray

    def between(self, low: float, high: float) -> slice:
        """The pairs whose distance is in a range."""
        return slice(*np.searchsorted(self.gaps, [low, high]))


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """What the surface search asks of a part.

    Attributes:
        part: the part.
        surface: for exact distances and rays.
        field: for many rough distances.
        planes: where the nearest surface is one plane, for exact ones.
        samples: evenly spread surface points ``(K, 3)`` in the part frame [m].
        normals: their outward normals ``(K, 3)``.
        gaps: distances between samples ``(K, K)``, single precision [m].
        spacing: typical distance from any surface point to the nearest sample [m].
        turns: half turns about the axes of the box and about the principal axes ``(6, 4, 4)``, in the part frame.
        spins: turns about the axes of its largest round faces, all the way round ``(A, K, 4, 4)``, in the part frame.
        borders: the sharp edges, where faces end.
        curved: the exact surfaces behind the mesh of curved faces; None if there are none.
    """

    part: Part
    surface: Surface
    field: DistanceField
    planes: NearPlanes
    samples: Vectors
    normals: Vectors
    gaps: np.ndarray
    spacing: float
    turns: Transforms
    spins: Transforms
    borders: Borders
    curved: Revolved | None
    _pairs: list[SamplePairs] = attribute(default_factory=list, repr=False)

    def distance(self, points: Vectors) -> tuple[FloatArray, Vectors]:
        """Exact signed distances ``(*batch,)`` and gradients ``(*batch, 3)`` at points of the part frame [m]."""
        return self.nearest(points)[:2]

    def nearest(self, points: Vectors) -> tuple[FloatArray, Vectors, IntArray]:
        """The same, and a triangle of the nearest plane ``(*batch,)``."""
        phi, g, triangles = nearest(self.surface, self.planes, points)
        if self.curved is not None:
            self.curved.replace(points, triangles, phi, g)
        return phi, g, triangles

    @property
    def pairs(self) -> SamplePairs:
        """All pairs of samples; made when readings with normals first ask for them, as they take some megabytes."""
        if not self._pairs:
            self._pairs.append(_pairs(self.samples, self.normals, self.gaps))
        return self._pairs[0]


def prepare_target(part: Part | PartModel, samples: int = SAMPLES) -> Target:
    """Prepare a part; takes some tenths of a second, once: what has the usual samples is kept with the part."""
    model = part if isinstance(part, PartModel) else None
    part = model.part if model is not None else part  # type: ignore[assignment]
    assert isinstance(part, Part)
    if samples != SAMPLES:
        return _prepared(part, model, samples)
    if "target" not in part.derived:
        part.derived["target"] = _prepared(part, model, samples)
    target: Target = part.derived["target"]
    return target


def _prepared(part: Part, model: PartModel | None, samples: int) -> Target:
    surface = model.surface if model is not None else Surface(part.vertices, part.triangles)
    points, triangles = _spread(part, samples)
    normals = surface.normals[triangles]
    gaps = np.linalg.norm(points[:, None] - points, axis=-1).astype(np.float32)
    spacing = float(np.sqrt(part.area / samples) * 0.6)
    turns = _half_turns(part, points)
    field = distance_field(surface)
    planes = near_planes(surface, field)
    curved = exact_faces(part, surface.normals)
    exact = spins_about(part, curved), borders(surface), curved
    return Target(part, surface, field, planes, points, normals, gaps, spacing, turns, *exact)


def as_targets(name: str, parts: Any) -> tuple[Target, ...]:
    """Parts, or one, as targets; what is prepared stays as it is.

    Raises:
        InputError: paths, or something else in the place of parts.
    """
    return tuple(part if isinstance(part, Target) else prepare_target(part) for part in as_parts(name, parts))


def finer(target: Target, spacing: float, most: int = MOST_SAMPLES) -> Target:
    """The same part with samples so close, for readings that lie close together; itself if it has them.

    Args:
        target: the part.
        spacing: that is wanted [m].
        most: samples, however close they should be.
    """
    count = min(most, int(np.ceil(len(target.samples) * (target.spacing / spacing) ** 2)))
    if count <= len(target.samples):
        return target
    points, triangles = _spread(target.part, count, _POOL_OF_MANY)
    gaps = np.sqrt(np.maximum(_squared_gaps(points.astype(np.float32)), 0.0))
    own = {"samples": points, "normals": target.surface.normals[triangles], "gaps": gaps}
    return replace(target, **own, spacing=target.spacing * np.sqrt(len(target.samples) / count), _pairs=[])


def _squared_gaps(points: np.ndarray) -> np.ndarray:
    p = points - points.mean(axis=0)
    own = np.sum(p * p, axis=1)
    return np.asarray(own[:, None] + own - 2 * p @ p.T)


def _half_turns(part: Part, samples: Vectors) -> Transforms:
    """Motions after which many a part nearly fills its old place."""
    principal = np.linalg.eigh(np.cov(samples.T))[1].T
    axes = np.concatenate([np.eye(3), principal])
    centres = np.concatenate([np.tile(part.box.mean(axis=0), (3, 1)), np.tile(samples.mean(axis=0), (3, 1))])
    R = 2 * axes[:, :, None] * axes[:, None] - np.eye(3)
    return SE3.from_parts(R, centres - SE3.apply(R, centres))


def _pairs(points: Vectors, normals: Vectors, gaps: np.ndarray) -> SamplePairs:
    order = np.argsort(gaps, axis=None)[len(points) :]  # without those of a sample with itself
    first, second = np.divmod(order, len(points))
    gap = np.maximum(gaps.ravel()[order].astype(np.float64), 1e-12)
    heights = normals @ points.T  # of sample b over the plane of normal a: heights[a, b] - heights[a, a]
    own = np.diagonal(heights)
    starts = (heights[first, second] - own[first]) / gap
    ends = (own[second] - heights[second, first]) / gap
    return SamplePairs(gap, first, second, (normals @ normals.T).ravel()[order], starts, ends)


def _spread(part: Part, count: int, pool_size: int = _POOL) -> tuple[Vectors, IntArray]:
    """Evenly spread surface points: a random pool (fixed seed) thinned by farthest-point sampling."""
    rng = np.random.default_rng(1991)
    corners = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    triangles = rng.choice(len(corners), size=pool_size * count, p=areas / areas.sum())
    u, v = np.sort(rng.uniform(size=(2, len(triangles), 1)), axis=0)
    a, b, c = corners[triangles].transpose(1, 0, 2)
    pool = u * a + (v - u) * b + (1 - v) * c
    chosen = np.empty(count, dtype=np.int64)
    nearest = np.full(len(pool), np.inf)
    chosen[0] = 0
    for k in range(count):
        if k:
            chosen[k] = int(np.argmax(nearest))
        np.minimum(nearest, np.sum((pool - pool[chosen[k]]) ** 2, axis=1), out=nearest)
    return pool[chosen], triangles[chosen]
