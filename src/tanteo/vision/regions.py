"""Regions of an image that differ from the table, and the silhouette of a part at a pose.

Most of the image is assumed to show the table, whose brightness is a smooth function of the place and a texture. A
region includes the shadow of its object. Regions propose poses; the evidence is in the edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3, freeze
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.parts import Surface
from tanteo.vision.camera import Camera, opencv, project
from tanteo.vision.edges import EdgePoints, chance_hits, check_image, image_noise
from tanteo.vision.settings import EDGES, EVIDENCE, SEARCH, SPACING

_REJECTED = 3.0
"""Numerical: residual from which the robust fit of the table rejects a pixel, in standard deviations."""


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A region of an image that differs from the table.

    Attributes:
        mask: pixels of the region with its holes ``(rows, columns)``.
        box: first and last column, first and last row [px].
        contour: outline ``(n, 2)``, a point every correlation length, mathematically positive on the screen [px].
        normals: outward unit normals ``(n, 2)``.
        sds: standard deviations of the points along their normals ``(n,)`` [px].
        cut: whether the region leaves the image.
    """

    mask: BoolArray
    box: tuple[int, int, int, int]
    contour: FloatArray
    normals: FloatArray
    sds: FloatArray
    cut: bool

    def __post_init__(self) -> None:
        freeze(self, "contour", "normals", "sds")

    @property
    def centre(self) -> FloatArray:
        """Middle of its pixels ``(2,)`` [px]."""
        rows, columns = np.nonzero(self.mask)
        return np.array([columns.mean(), rows.mean()])


def table_brightness(image: FloatArray) -> FloatArray:
    """Return the brightness of the bare table: a quadratic in x and y, fitted robustly to all pixels."""
    rows, columns = image.shape
    y, x = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    X = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    coarse, target = X[:: EDGES.cell, :: EDGES.cell].reshape(-1, 6), image[:: EDGES.cell, :: EDGES.cell].ravel()
    weights = np.ones(len(target))
    # start from the median, because objects may cover much of the image
    beta = np.r_[np.median(target), np.zeros(5)]
    for k in range(SEARCH.rounds):
        off = target - coarse @ beta
        scale = max(1.4826 * float(np.median(np.abs(off))), 1.0) * (_REJECTED + 1 if k < 4 else _REJECTED)
        weights = np.clip(1 - (off / scale) ** 2, 0.0, None) ** 2
        W = coarse.T * weights
        beta = np.linalg.solve(W @ coarse + 1e-9 * np.eye(6), W @ target)
    return np.asarray(X @ beta)


def find_regions(image: FloatArray, edges: EdgePoints, chance: FloatArray | None = None) -> tuple[Region, ...]:
    """Find the regions of objects on the table, largest first.

    A region differs from the table by more than noise and texture, or edges that are rare on the table enclose it, or
    it is the convex hull of such edges near one another. Regions only propose where parts may be.

    Args:
        image: grey levels ``(rows, columns)``.
        edges: edge points of the image.
        chance: probability of a random edge like each edge point ``(n,)``; computed if not given.
    """
    cv2 = opencv()
    image = check_image(image)
    off = cv2.GaussianBlur(image - table_brightness(image), (0, 0), 1.0)
    texture = 1.4826 * float(np.median(np.abs(off)))
    least = max(EDGES.strong * image_noise(image) * 0.3, 2 * EDGES.least_step, _REJECTED * texture)
    differs = cv2.morphologyEx((np.abs(off) > least).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    chance = chance_hits(edges) if chance is None else chance
    x, y = np.rint(edges.pixels[chance < EVIDENCE.rare]).astype(np.int64).T
    differs[y.clip(0, image.shape[0] - 1), x.clip(0, image.shape[1] - 1)] = 1
    differs = cv2.morphologyEx(differs, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    outlines, _ = cv2.findContours(differs, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    # lines of edges and of texture are thin
    filled = np.zeros(image.shape, dtype=np.uint8)
    cv2.drawContours(filled, [one for one in outlines if cv2.contourArea(one) > 0], -1, 1, thickness=cv2.FILLED)
    thick = cv2.morphologyEx(filled, cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    outlines, _ = cv2.findContours(thick, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    large = [outline for outline in outlines if cv2.contourArea(outline) > EVIDENCE.stretch**2]
    regions = [_region(image.shape, outline, edges) for outline in large]
    regions += [_region(image.shape, outline, edges) for outline in _gathered(regions, edges, chance)]
    return tuple(sorted(regions, key=lambda region: -int(region.mask.sum())))


def _gathered(regions: Sequence[Region], edges: EdgePoints, chance: FloatArray) -> list[FloatArray]:
    """Return the convex hulls of rare edges near one another that have more evidence than any region, as outlines.

    Where a texture interrupts the outline of an object, no edges enclose it. Texture itself makes many groups of fewer
    rare edges.

    Args:
        regions: regions that edges enclose, or that differ from the table.
        edges: edge points of the image.
        chance: probability of a random edge like each edge point ``(n,)``.
    """
    cv2 = opencv()
    shape = edges.shape
    # nats of the edges, an observation for each stretch
    nats = -np.log(chance) * SPACING / EVIDENCE.stretch
    own = [edges.inside(dilated(region.mask)) for region in regions]
    least = max([EVIDENCE.least_object, *(float(nats[one].sum()) for one in own)])
    free = np.flatnonzero((chance < EVIDENCE.rare) & ~np.any([np.zeros(len(edges), dtype=np.bool_), *own], axis=0))
    x, y = np.minimum(np.rint(edges.pixels[free]).astype(np.int64), np.array(shape[::-1]) - 1).T
    mask = np.zeros(shape, dtype=np.bool_)
    mask[y, x] = True
    count, labels = cv2.connectedComponents(dilated(mask, EVIDENCE.shortest).astype(np.uint8))
    group = labels[y, x]
    strong = np.flatnonzero(np.bincount(group, nats[free], count) > least)
    outlines = [cv2.convexHull(np.stack([x, y], axis=-1)[group == k].astype(np.int32)) for k in strong]
    return [one for one in outlines if cv2.contourArea(one) > EVIDENCE.stretch**2]


def _region(shape: tuple[int, ...], outline: FloatArray, edges: EdgePoints) -> Region:
    cv2 = opencv()
    filled = np.zeros(shape, dtype=np.uint8)
    cv2.drawContours(filled, [outline], -1, 1, thickness=cv2.FILLED)
    points = outline[:, 0].astype(np.float64)
    low, high = points.min(axis=0).astype(int), points.max(axis=0).astype(int)
    cut = bool(np.any(low <= 1) or high[0] >= shape[1] - 2 or high[1] >= shape[0] - 2)
    contour, normals, sds = _snapped(points, edges)
    return Region(filled > 0, (int(low[0]), int(high[0]), int(low[1]), int(high[1])), contour, normals, sds, cut)


def _snapped(points: FloatArray, edges: EdgePoints) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return contour points at equal steps, each moved along its normal onto the nearest edge."""
    if opencv().contourArea(points.astype(np.float32), oriented=True) < 0:
        points = points[::-1]
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    upto = np.r_[0.0, np.cumsum(steps)]
    count = max(8, int(upto[-1] / EDGES.correlation))
    at = np.arange(count) * upto[-1] / count
    closed = np.concatenate([points, points[:1]])
    even = np.stack([np.interp(at, upto, closed[:, k]) for k in (0, 1)], axis=-1)
    tangents = np.roll(even, -1, axis=0) - np.roll(even, 1, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)
    normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=-1)
    sds = np.full(count, 1.0)
    if len(edges):
        which = _core.nearest_pixels(edges.pixels, even, EVIDENCE.reach)
        found = which >= 0
        index = which[found]
        aligned = np.abs(np.sum(edges.normals[index] * normals[found], axis=1)) > 0.5
        rows = np.flatnonzero(found)[aligned]
        own = edges.normals[index[aligned]]
        own = own * np.sign(np.sum(own * normals[rows], axis=1, keepdims=True))
        gap = np.sum((edges.pixels[index[aligned]] - even[rows]) * own, axis=1)
        even[rows] += gap[:, None] * own
        normals[rows], sds[rows] = own, edges.sds[index[aligned]]
    return even, normals, sds


def silhouette(surface: Surface, camera: Camera, T_camera_part: Transforms) -> BoolArray:
    """Return the pixels that a part covers ``(rows, columns)``.

    Args:
        surface: closed surface of the part.
        camera: camera of the image.
        T_camera_part: pose of the part ``(4, 4)``.
    """
    cv2 = opencv()
    width, height = camera.size
    mask = np.zeros((height, width), dtype=np.uint8)
    eye = SE3.inverse(T_camera_part)[:3, 3]
    corners = surface.vertices[surface.triangles[:, 0]]
    front = np.sum((eye - corners) * surface.normals, axis=1) > 0
    pixels = project(camera, SE3.apply(T_camera_part, surface.vertices))
    polygons = pixels[surface.triangles[front]]
    polygons = polygons[np.all(np.isfinite(polygons) & (np.abs(polygons) < 1e4), axis=(1, 2))]
    for polygon in np.rint(polygons * 16).astype(np.int32):
        cv2.fillConvexPoly(mask, polygon, 1, lineType=cv2.LINE_8, shift=4)
    return mask.view(np.bool_)


def hulls(regions: Sequence[Region]) -> BoolArray:
    """Return the pixels in the convex hulls of regions ``(rows, columns)``."""
    cv2 = opencv()
    covered = np.zeros(regions[0].mask.shape, dtype=np.uint8)
    for region in regions:
        cv2.fillConvexPoly(covered, cv2.convexHull(np.rint(region.contour).astype(np.int32)), 1)
    return covered.view(np.bool_)


def hull_area(places: FloatArray) -> float:
    """Return the area of the convex hull of places in a plane ``(n, 2)``, infinite if one is at infinity."""
    if not np.all(np.isfinite(places)):
        return np.inf
    cv2 = opencv()
    return float(cv2.contourArea(cv2.convexHull(places.astype(np.float32))))


def surroundings(region: Region) -> BoolArray:
    """Return the pixels at which parts of a region are proposed ``(rows, columns)``: its convex hull and a margin.

    Faces that look like the table may be in no region.
    """
    return dilated(hulls([region]), 2 * EVIDENCE.stretch)


def dilated(mask: BoolArray, reach: float = EVIDENCE.reach) -> BoolArray:
    """Return the pixels within a reach [px] of a mask ``(rows, columns)``; within that of edges if not given."""
    side = 2 * int(np.ceil(reach)) + 1
    return np.asarray(opencv().dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)) > 0)
