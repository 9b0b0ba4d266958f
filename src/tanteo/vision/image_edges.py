"""The edges of an image as a factor of the posterior: what the compiled core needs to know of image and part.

The formula is in ``_core/factors/image_edges.hpp``. The camera's pose and a shift of the whole image by the lens are
shared errors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tanteo import _core
from tanteo.factors import PoseFactor
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.vision.camera import Camera, opencv
from tanteo.vision.edges import BY_DRIFT, CHANNELS, CORRELATION, FLOOR, EdgeMap, EdgePoints
from tanteo.vision.models import VisionModel, prepare_vision

REACH = 2.5
"""Largest distance of an edge point from the sample of a part's edge that meets it [px]
(``python benchmarks/vision_fit.py`` fits the weights with it)."""

STRETCH = 12.0
"""Length of edge that is one observation [px] (decision 23)."""

_WHOLE = 60.0
"""Length from which more of the same edge adds little [px]; from 30 to 120 px the fit is as good (decision 38)."""

_RIM_SHOWS, _CREASE_SHOWS = 0.85, 0.65
"""Probability that an edge shows in the image: where the part ends, and between two faces (decision 23)."""

_DISPLACED, _DISPLACED_SD = 0.3, 0.8
"""Share of edges that shadows, occluders and roundings displace, and by how much [px] (decision 23)."""

_SPREAD = 0.15
"""Offsets of edges from a pose that is about right, those of displaced ones apart [px] (decision 23)."""

ASTRAY = 0.02
"""Density of an edge that is another's, relative to that of the part's own at its place: three in ten edges are
another's, a pixel off (decision 32), where own ones are some hundredths (``python benchmarks/vision_poses.py 12``)."""

SAME_TURN, SAME_SHIFT = 0.04, 0.02
"""Poses nearer than this are one that the image suggests [rad, diagonals]."""

_NEAR = 4 * (SAME_SHIFT + 0.5 * SAME_TURN) / 2
"""Motion of the part's points, over their spread, up to which a pose has the constant of one that the image suggests:
points half a diagonal from the middle move by so much where two poses are just one, twice over."""

_INEXACT = 0.02
"""Probability that all edges of an image are less exact than stated, each by half of ``_DISPLACED_SD`` more. With 0.3
a wrong part is too probable (``python benchmarks/vision.py step_12mm,step_15mm 40 0.3 77``)."""

_OF_LENS = np.sqrt(0.5)
"""Share of a lens's error, as a deviation, that shifts all edges alike; the same share is each edge's own
(decision 43)."""

_EXACT = 1e-4
"""A lens whose error is smaller adds no state [px]."""

_BESIDE, _ALONG = 4.0, 0.9
"""Samples meet the same place of the image within this distance, or what they stand for, and within this cosine of
their directions [px] (decision 38)."""

_MOST_PULLED = 0.5
"""The displacement of a blurred rim is corrected up to this: beyond, the formula does not hold [px] (decision 73)."""


_NO_LEVELS = np.zeros((0, 4, 4)), np.zeros(0)

_AWAY = SE3.from_parts(np.eye(3), np.full(3, 1e6))[None]
"""A pose that no other is near."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Weights of the sums of an image, fitted on rendered scenes of random parts (``benchmarks/vision_fit.py``).

    Edges are not independent of each other, and shadows and occluders make edges of their own. The fit measures what
    that does to the sums.

    Attributes:
        hits: weight of edges of the part that meet edges of the image.
        misses: weight of those that do not.
        unknown: log density of an unknown object for each stretch of the image's edges.
        base: log density of an unknown object without edges.
        spilled: weight of each square of a stretch that the silhouette covers where bare table is seen.
    """

    hits: float = 0.409
    misses: float = 0.103
    unknown: float = 0.151
    base: float = 1.065
    spilled: float = -0.624

    def rules(self, *, located: bool = True) -> FloatArray:
        """Return all constants of the formula, in the order of ``EdgeRules`` ``(18,)``.

        Args:
            located: whether there is a sum of where edges are.
        """
        return np.array([
            STRETCH, _WHOLE, _RIM_SHOWS, _CREASE_SHOWS, REACH, _SPREAD, _DISPLACED, _DISPLACED_SD,
            self.hits, self.misses, self.spilled, _BESIDE, _ALONG, _MOST_PULLED, CORRELATION,
            ASTRAY if located else 0.0, _NEAR, _INEXACT,
        ])  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class ImageEdges(PoseFactor):
    """The edges of one image, of the object in one region of it.

    Attributes:
        camera: camera that took the image; without a place the world is its own frame.
        edges: edge points of the image.
        chance: probability that a random place has an edge of one direction within :data:`REACH`, one for the region
            ``(1,)`` or of each direction and pixel ``(CHANNELS, rows, columns)``.
        bare: pixels that show bare table ``(rows, columns)``; None where there is no table.
        weights: weights of the sums.
        log_unknown: log density of the image if the object is unknown.
        proposed: poses ``T_world_part`` of each part that the image suggests.
        levels: of each part, poses ``T_world_part`` and the constant that is taken from the log density of poses that
            are nearest to each; None if there are none yet.
    """

    camera: Camera
    edges: EdgeMap
    chance: FloatArray
    bare: BoolArray | None = None
    weights: Weights = field(default_factory=Weights)
    log_unknown: float = 0.0
    proposed: Mapping[Part, Transforms] = field(default_factory=dict)
    levels: Mapping[Part, tuple[Transforms, FloatArray]] | None = None
    image: _core.EdgeImage = field(init=False, repr=False)

    def __post_init__(self) -> None:
        points, camera = self.edges.points, self.camera
        root = np.zeros((0, 6)) if camera.covariance is None else _root(camera.covariance)
        shift = float(_OF_LENS * camera.edge_sd)
        # half of the variance of what misplaces a point is common to its edge, half is its own (decision 32)
        misplaced = 0.5 * (FLOOR**2 + (BY_DRIFT * points.drifts) ** 2)
        own, common = np.sqrt(points.sds**2 + FLOOR**2 + misplaced), np.sqrt(misplaced + shift**2)
        image = _core.make_edge_image(
            camera.numbers, np.ascontiguousarray(standing(camera)), root, shift if shift > _EXACT else 0.0,
            self.edges.nearest, points.pixels, own, common, points.widths,
            np.ascontiguousarray(self.chance, dtype=np.float32),
            np.zeros((0, 0), dtype=np.bool_) if self.bare is None else np.ascontiguousarray(self.bare),
        )  # fmt: skip
        object.__setattr__(self, "image", image)

    @property
    def states(self) -> int:
        """Number of shared errors: the camera's pose where it has a covariance, and the shift by the lens."""
        return self.image.states

    def term(self, part: Part, first: int) -> _core.ImageEdges:
        """Compile the factor for one part.

        Of a part for which the image suggests no pose, the constant is the largest of all: the image fixes its pose as
        exactly as those of others, where it shows the part. If it suggests no pose of any part, where edges are does
        not count.
        """
        known = self.levels
        at, constants = _NO_LEVELS if known is None else known.get(part, _NO_LEVELS)
        if known and part not in known:
            at, constants = _AWAY, np.array([max(own.max() for _, own in known.values())])
        rules = self.weights.rules(located=known is None or len(known) > 0)
        return _core.image_edges(prepare_vision(part).seen, self.image, rules, at, constants, REACH, first)

    def poses(self, part: Part) -> Transforms:
        """Return the poses of a part that the image suggests ``(k, 4, 4)``."""
        return self.proposed.get(part, np.zeros((0, 4, 4)))

    def sums_at(self, part: Part, Ts: Transforms, zs: FloatArray) -> Sums:
        """Evaluate poses ``T_world_part`` of a part ``(B, 4, 4)`` and shared errors of the image ``(B, states)``."""
        return Sums(*_core.image_sums(self.term(part, 0), np.ascontiguousarray(Ts), np.ascontiguousarray(zs)).T)

    def sums(self, model: VisionModel, T_camera_part: Transforms, *, coarse: bool = False) -> Sums:
        """Evaluate poses of a part that are not maxima yet: that edges are there, not exactly where.

        Args:
            model: the part.
            T_camera_part: poses ``(B, 4, 4)``.
            coarse: with few samples of its edges, and edge points at twice the distance.
        """
        seen, reach = (model.seen_coarsely, 2 * REACH) if coarse else (model.seen, REACH)
        term = _core.image_edges(seen, self.image, self.weights.rules(located=False), *_NO_LEVELS, reach, 0)
        Ts = np.ascontiguousarray(standing(self.camera) @ T_camera_part)
        return Sums(*_core.image_sums(term, Ts, np.zeros((len(Ts), self.states))).T)


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """The sums behind the log density of an image at poses, each ``(B,)``.

    Attributes:
        log: log density.
        there: the part of it that says that edges are there.
        hits: sum over edges of the part that meet edges of the image.
        misses: sum over those that do not.
        spilled: area of the silhouette on bare table [px^2].
        located: sum of where edges are.
        chi2: chi-square of the offsets of edges that are the part's own.
        freedom: number of independent offsets in it.
        squares: sum of the squares of all offsets [px^2].
        met: number of samples that meet an edge point.
    """

    log: FloatArray
    there: FloatArray
    hits: FloatArray
    misses: FloatArray
    spilled: FloatArray
    located: FloatArray
    chi2: FloatArray
    freedom: FloatArray
    squares: FloatArray
    met: FloatArray


def standing(camera: Camera) -> Transforms:
    """Return the pose of a camera in the world, which is its own frame where its place is not known."""
    return np.eye(4) if camera.T_world_camera is None else camera.T_world_camera


def _root(covariance: FloatArray) -> FloatArray:
    """Return S with S S' = covariance, which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.ascontiguousarray(vectors * np.sqrt(values.clip(0.0)))


def chance_hits(points: EdgePoints, used: BoolArray) -> float:
    """Return the probability that a random place among these edges has one of the same direction within reach.

    Edges of one direction (an eighth of them, if all are as common) cover ``2 REACH`` px for each pixel of length.
    """
    if used.sum() < 2:
        return 0.02
    low, high = points.pixels[used].min(axis=0), points.pixels[used].max(axis=0)
    area = float(np.prod(high - low + 10.0))
    density = float(used.sum()) / area * 2 * REACH * 0.25
    return float(np.clip(density, 0.02, 0.4))


def chance_map(edges: EdgeMap, window: int = 81) -> FloatArray:
    """Measure, in windows of the image, how common edges of each direction are ``(CHANNELS, rows, columns)``."""
    near = (edges.distances < REACH).astype(np.float32)
    shares = np.stack([opencv().blur(near[k], (window, window)) for k in range(CHANNELS)])
    return np.clip(shares, 0.02, 0.6)
