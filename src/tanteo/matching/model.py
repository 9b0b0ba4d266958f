"""A part prepared for matching: its candidates by kind, and what pairs of them look like from outside.

The pair tables are the classical constraints of the interpretation tree (Grimson and Lozano-Perez 1984): the angle
between two directions, the range of one feature's points along the other's normal, and the range of their distance.
They hold for every placement, so a sensed pair can be gated before any pose is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.matching.candidates import Candidates, candidates_of
from tanteo.parts import Part
from tanteo.shapes import Surface
from tanteo.typing import FloatArray, IntArray, Vectors

_KEEP_ENTRIES = 1_000_000
"""Pair tables with more entries than this are computed when asked for and not kept."""

_REPEATS = 6
"""Touches of one face are counted up to this many."""

_PARALLEL = 1e-6
"""Model faces whose normals differ by less than this are parallel [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class PairTable:
    """What candidates ``a`` (rows) and ``b`` (columns) look like to each other.

    Attributes:
        angle: between the directions ``(Na, Nb)`` [rad], in 0..pi.
        low: least of ``n_a . (q - c_a)`` over the points ``q`` of ``b`` ``(Na, Nb)`` [m]; only where ``a`` is a plane.
        high: greatest of the same.
        near: least possible distance between a point of ``a`` and one of ``b`` (bound) [m].
        far: greatest.
    """

    angle: FloatArray | None
    low: FloatArray | None
    high: FloatArray | None
    near: FloatArray
    far: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Sizes:
    """Signed distances between parallel faces, ``n_a . (q_b - q_a)`` [m], with the probability of meeting each.

    Attributes:
        step: between faces that look the same way ``(k,)``.
        step_weights: probabilities, summing to one ``(k,)``.
        thickness: between faces that look opposite ways ``(m,)``; negative where material lies between.
        thickness_weights: probabilities, summing to one ``(m,)``.
        again: of a touch of a face that looks the same way as that of the ``k`` before it, the probability that it is
            the same face, ``(K,)`` from ``k = 1``.
        alike: probability that two touches meet faces that look the same way.
        height: mean of ``n . (x - c)`` over the surface, ``c`` its centroid: three times volume by area [m].
        height_sd: its standard deviation [m].
        place_sd: standard deviation of a surface point's place along its face, each way [m].
    """

    step: FloatArray
    step_weights: FloatArray
    thickness: FloatArray
    thickness_weights: FloatArray
    again: FloatArray
    alike: float
    height: float
    height_sd: float
    place_sd: float


@dataclass(frozen=True, slots=True, eq=False)
class PartModel:
    """A part, or a family of parts, as the tree sees it.

    Attributes:
        name: of the part.
        part: the part; none for a family that is known only by its directions.
        candidates: by kind name.
        radius: of the sphere that holds the part [m].
        resistances: by kind, kept by :mod:`tanteo.matching.freedom`.
        levels: which faces lie in one plane, kept by :mod:`tanteo.matching.verify`.
    """

    name: str
    part: Part | None
    candidates: dict[str, Candidates]
    radius: float
    _tables: dict[tuple[str, str], PairTable] = field(default_factory=dict)
    _surface: list[Surface] = field(default_factory=list)
    _sizes: list[Sizes] = field(default_factory=list)
    resistances: dict[str, FloatArray] = field(default_factory=dict)
    levels: list[IntArray] = field(default_factory=list)

    @property
    def has_extent(self) -> bool:
        """Whether candidates have a place, not only a direction."""
        return self.part is not None

    @property
    def middle(self) -> Vectors:
        """About which its motions are told ``(3,)``, part frame [m]: the origin of the file may lie far from it."""
        return np.zeros(3) if self.part is None else self.part.centroid

    @property
    def surface(self) -> Surface:
        """The part's surface for distance queries, built once."""
        assert self.part is not None
        if not self._surface:
            self._surface.append(Surface(self.part.vertices, self.part.triangles))
        return self._surface[0]

    @property
    def sizes(self) -> Sizes:
        """Distances between its parallel faces, found once."""
        if not self._sizes:
            self._sizes.append(parallel_sizes(self))
        return self._sizes[0]

    def table(self, a: str, b: str) -> PairTable:
        """The whole pair table of two kinds; small ones are kept."""
        if (a, b) in self._tables:
            return self._tables[a, b]
        A, B = self.candidates[a], self.candidates[b]
        table = pair_table(A, B, a == "plane")
        if len(A) * len(B) <= _KEEP_ENTRIES:
            self._tables[a, b] = table
        return table


def pair_table(A: Candidates, B: Candidates, a_is_plane: bool) -> PairTable:
    """The pair table of two sets of candidates."""
    directed = bool(np.any(A.directions)) and bool(np.any(B.directions))
    u, c = A.directions, A.Ts_part_feature[:, :3, 3]
    angle = np.arccos(np.clip(u @ B.directions.T, -1.0, 1.0)) if directed else None
    gap = np.linalg.norm(c[:, None] - B.Ts_part_feature[None, :, :3, 3], axis=-1)
    reach = A.radii[:, None] + B.radii
    low = high = None
    if a_is_plane:
        along = u @ B.points.T - np.sum(u * c, axis=-1)[:, None]
        low = np.minimum.reduceat(along, B.starts, axis=1)
        high = np.maximum.reduceat(along, B.starts, axis=1)
    return PairTable(angle, low, high, np.maximum(gap - reach, 0.0), gap + reach)


def parallel_sizes(model: PartModel) -> Sizes:
    """What distances between parallel faces a part has, and how far out its surface is, by the areas of the faces."""
    if "plane" not in model.candidates:
        none = np.zeros(0)
        return Sizes(
            none,
            none,
            none,
            none,
            again=np.zeros(_REPEATS),
            alike=0.0,
            height=0.0,
            height_sd=model.radius,
            place_sd=model.radius,
        )
    planes, table = model.candidates["plane"], model.table("plane", "plane")
    assert table.angle is not None
    assert table.low is not None
    weights = planes.weights[:, None] * planes.weights
    found: list[FloatArray] = []
    for parallel in (table.angle < _PARALLEL, table.angle > np.pi - _PARALLEL):
        other = parallel & ~np.eye(len(planes), dtype=bool)
        values, index = np.unique(np.round(table.low[other], 6), return_inverse=True)
        w = np.bincount(index, weights[other], minlength=len(values))
        found += [values, w / max(w.sum(), 1e-300)]
    w = planes.weights / planes.weights.sum()
    towards = (table.angle < _PARALLEL) @ w  # weight of all faces that look the same way
    again = np.array([(w ** (k + 1)).sum() / (w**k @ towards) for k in range(1, _REPEATS + 1)])
    step, step_weights, thickness, thickness_weights = found
    return Sizes(step, step_weights, thickness, thickness_weights, again, float(w @ towards), *_surface_moments(model))


def _surface_moments(model: PartModel) -> tuple[float, float, float]:
    """Mean and sd of the height of the planar surface over its centroid, and sd of the place along it."""
    assert model.part is not None
    planes = model.part.planes
    w = planes.areas / planes.areas.sum()
    spokes = planes.centroids - w @ planes.centroids
    heights = np.sum(planes.normals * spokes, axis=1)
    mean = float(w @ heights)
    across = (spokes**2).sum(axis=1) - heights**2 + (planes.gyration**2).sum(axis=1)
    return mean, float(np.sqrt(w @ (heights - mean) ** 2)), float(np.sqrt(w @ across / 2))


def prepare(part: Part) -> PartModel:
    """Candidates of a part; tables follow when they are asked for. Kept with the part."""
    if "model" not in part.derived:
        part.derived["model"] = PartModel(part.name, part, candidates_of(part), part.radius)
    model: PartModel = part.derived["model"]
    return model
