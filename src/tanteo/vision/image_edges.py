"""The edges of an image as a factor of the posterior, compiled for the core.

The formula is in ``_core/factors/image_edges.hpp``. The camera's pose and a shift of the whole image by the lens are
shared errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tanteo import _core
from tanteo.factors import PoseFactor
from tanteo.factors.factor import CommonErrors, state_columns
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.parts import Part
from tanteo.vision.camera import Camera
from tanteo.vision.edges import EdgeMap, EdgePoints, cell_of
from tanteo.vision.fit import meet
from tanteo.vision.models import VisionModel, prepare_vision
from tanteo.vision.regions import dilated
from tanteo.vision.settings import EDGES, EVIDENCE, SPACING

_NO_LEVELS = np.zeros((0, 4, 4)), np.zeros(0)
"""Definition: no poses and no constants."""

_AWAY = SE3.from_parts(np.eye(3), np.full(3, 1e6))[None]
"""Numerical: a pose [m] that is near no other."""


@dataclass(frozen=True, slots=True, eq=False)
class Weights:
    """Weights of the sums of an image, fitted on rendered scenes of random parts (``benchmarks/vision_fit.py``).

    Edges are dependent, and shadows and occluders make further edges. The fit measures the effect on the sums. The
    scale of ``hits`` and ``misses`` is that of decision 23; the others are fitted at that scale.

    Attributes:
        hits: weight of edges of the part that match edges of the image. ``benchmarks/vision_fit.py``.
        misses: weight of edges of the part that match none. ``benchmarks/vision_fit.py``.
        unknown: log density of an unknown object for each nat of the edges that the best candidate explains.
            92 scenes of photographs and drawings (decision 87); ``benchmarks/vision_fit.py``.
        base: log density of an unknown object without edges. As ``unknown``.
    """

    hits: float = 0.409
    misses: float = 0.216
    unknown: float = 0.0647
    base: float = 6.82

    def rules(self, *, located: bool = True) -> FloatArray:
        """Return the constants of the likelihood of image edges, in the order of ``EdgeRules`` in the core ``(17,)``.

        Args:
            located: whether the likelihood includes exact positions of edges; otherwise only whether edges are near.
        """
        e = EVIDENCE
        near = (
            4 * e.same_pose
        )  # twice the motion of points half a diagonal from the middle where two poses are just one
        return np.array([
            e.stretch, e.whole, e.rim_shows, e.crease_shows, e.reach, e.spread, e.displaced, e.displaced_sd,
            self.hits, self.misses, e.same_place, e.same_direction, e.most_pulled, EDGES.correlation,
            e.outlying if located else 0.0, near, e.inexact,
        ])  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class ImageEdges(PoseFactor):
    """The edges of one image, of the object in one region of it.

    Attributes:
        camera: camera of the image; without a pose the world is its own frame.
        edges: edge points of the image.
        chance: probability that a random place has an edge like an edge point within reach, of each point ``(n,)`` or
            one for all ``(1,)``; see :func:`tanteo.vision.edges.chance_hits`.
        weights: weights of the sums.
        log_unknown: log density of the image if the object is unknown.
        proposed: poses ``T_world_part`` of each part that the image suggests.
        levels: for each part, reference poses ``T_world_part`` and a constant for each. The log density of a pose is
            reduced by the constant of the nearest reference pose. None before the constants are known.
        image: camera, edges and chance for the core; compiled if not given.
    """

    camera: Camera
    edges: EdgeMap
    chance: FloatArray
    weights: Weights = field(default_factory=Weights)
    log_unknown: float = 0.0
    proposed: Mapping[Part, Transforms] = field(default_factory=dict)
    levels: Mapping[Part, tuple[Transforms, FloatArray]] | None = None
    image: _core.EdgeImage = field(default=None, repr=False)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.image is not None:
            return
        points, camera = self.edges.points, self.camera
        mounting = camera.mounting
        root, mount = _root(camera.covariance), _root(None if mounting is None else mounting.covariance)
        # half of the variance of the lens shifts all edges together, half is in the edge itself (decision 43)
        shift = float(np.sqrt(0.5) * camera.edge_sd)
        # half of the variance of what misplaces a point is common to its edge, half is its own (decision 32)
        misplaced = 0.5 * (EDGES.floor**2 + (EDGES.by_drift * points.drifts) ** 2)
        noise = (EDGES.extrapolated_noise * points.sds) ** 2
        own, common = np.sqrt(noise + EDGES.floor**2 + misplaced), np.sqrt(misplaced + shift**2)
        image = _core.make_edge_image(
            camera.numbers, np.ascontiguousarray(standing(camera)), root, mount,
            shift if shift > EDGES.floor else 0.0,
            self.edges.nearest, points.pixels, own, common, points.widths, points.normals,
            EDGES.extrapolation * points.drifts, points.responses, EDGES.usual_width,
            np.ascontiguousarray(self.chance, dtype=np.float32),
        )  # fmt: skip
        object.__setattr__(self, "image", image)

    @property
    def states(self) -> int:
        """Number of shared errors: the camera's pose where it has a covariance, and the shift by the lens."""
        return self.image.states

    @property
    def common(self) -> CommonErrors | None:
        """Errors of the mounting of the camera, which all its images have in common; None without a mounting."""
        mounting = self.camera.mounting
        return None if mounting is None else CommonErrors(mounting, 6)

    def term(self, part: Part, first: int, common: int = 0) -> _core.ImageEdges:
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
        return _core.image_edges(
            prepare_vision(part).seen, self.image, rules, at, constants, EVIDENCE.reach, first, common
        )

    def poses(self, part: Part) -> Transforms:
        """Return the poses of a part that the image suggests ``(k, 4, 4)``."""
        return self.proposed.get(part, np.zeros((0, 4, 4)))

    def sums(self, model: VisionModel, T_camera_part: Transforms, *, coarse: bool = False) -> Sums:
        """Evaluate poses of a part before their refinement: whether edges are near, but not their exact positions.

        Args:
            model: part with its edges.
            T_camera_part: poses ``(B, 4, 4)``.
            coarse: whether to use few samples of the part's edges, and edge points at up to twice the distance.
        """
        seen, reach = (model.seen_coarsely, 2 * EVIDENCE.reach) if coarse else (model.seen, EVIDENCE.reach)
        own = self.states
        term = _core.image_edges(seen, self.image, self.weights.rules(located=False), *_NO_LEVELS, reach, 0, own)
        Ts = np.ascontiguousarray(standing(self.camera) @ T_camera_part)
        return Sums(*_core.image_sums(term, Ts, np.zeros((len(Ts), state_columns((self,), 0)[1]))).T)

    def with_unknown(self, model: VisionModel, T_camera_part: Transforms) -> ImageEdges:
        """Return the edges with the log density of an unknown object in the place of a part.

        The unknown object has those edges that the part explains. All other edges in that place are of texture, shadows
        and other objects, whether the part is known or not.

        Args:
            model: part with its edges.
            T_camera_part: its pose ``(4, 4)``.
        """
        points = self.edges.points
        matches = meet(model.frame, self.camera, self.edges, T_camera_part[None], EVIDENCE.reach)
        if not matches.inside.any():
            return replace(self, log_unknown=0.0)
        mask = np.zeros(points.shape, dtype=np.bool_)
        row, column, _ = cell_of(points.shape, points.pixels[matches.points[matches.hits]])
        mask[row, column] = True
        return self.with_unknown_in(dilated(mask, EVIDENCE.same_place))

    def with_unknown_in(self, mask: BoolArray) -> ImageEdges:
        """Return the edges with the log density of an unknown object that has those in a mask ``(rows, columns)``."""
        information = edge_information(self.edges.points, self.chance, mask)
        return replace(self, log_unknown=self.weights.unknown * information + self.weights.base)


@dataclass(frozen=True, slots=True, eq=False)
class Sums:
    """The sums behind the log density of an image at poses, each ``(B,)``.

    Attributes:
        log: log density.
        there: the term for edges that are there.
        hits: sum over edges of the part that match edges of the image.
        misses: sum over edges of the part that match none.
        located: sum of where edges are.
        chi2: chi-square of the offsets of edges that are the part's own.
        freedom: number of independent offsets in it.
        squares: sum of the squares of all offsets [px^2].
        matched: number of samples that match an edge point.
    """

    log: FloatArray
    there: FloatArray
    hits: FloatArray
    misses: FloatArray
    located: FloatArray
    chi2: FloatArray
    freedom: FloatArray
    squares: FloatArray
    matched: FloatArray


def sums_of(images: Sequence[ImageEdges], part: Part, Ts: Transforms, zs: FloatArray | None = None) -> list[Sums]:
    """Return the sums of each image at poses ``T_world_part``.

    Args:
        images: the edges of images, all those of one posterior.
        part: the part.
        Ts: poses ``(k, 4, 4)``.
        zs: shared errors of all images at each ``(k, D)``; zeros if not given.
    """
    places, count = state_columns(images, 0)
    zs = np.zeros((len(Ts), count)) if zs is None else zs[:, :count]
    Ts, zs = np.ascontiguousarray(Ts), np.ascontiguousarray(zs)
    return [Sums(*_core.image_sums(image.term(part, *at), Ts, zs).T) for image, at in zip(images, places, strict=True)]


def _root(covariance: FloatArray | None) -> FloatArray:
    """Return a root ``R`` of a covariance ``R R'``, which may be singular ``(6, 6)``; empty without one."""
    if covariance is None:
        return np.zeros((0, 6))
    values, vectors = np.linalg.eigh(covariance)
    return np.ascontiguousarray(vectors * np.sqrt(values.clip(0.0)))


def standing(camera: Camera) -> Transforms:
    """Return the pose of a camera in the world, which is the frame of the camera if its pose is unknown."""
    return np.eye(4) if camera.T_world_camera is None else camera.T_world_camera


def edge_information(edges: EdgePoints, chance: FloatArray, mask: BoolArray) -> float:
    """Return the sum of minus the log probability of random edges over all edges in a mask, in stretches [nats].

    Args:
        edges: edge points of the image.
        chance: probability of a random edge within reach of each ``(n,)``.
        mask: pixels ``(rows, columns)``.
    """
    return float(-np.log(chance[edges.inside(mask)]).sum()) * SPACING / EVIDENCE.stretch
