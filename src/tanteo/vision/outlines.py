"""The outline of a region on the table, which selects candidates among very many parts.

The posterior includes the parts that it excludes, as it does for readings (decisions 76 and 83).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import FloatArray, IntArray, Transforms, Vectors
from tanteo.posterior import DEFAULTS, SeenOutline
from tanteo.posterior.answers import MISLEADING
from tanteo.vision.camera import Camera, on_plane, opencv, project
from tanteo.vision.edges import EdgePoints, find_edges
from tanteo.vision.image_edges import standing
from tanteo.vision.regions import Region, find_regions
from tanteo.vision.settings import EVIDENCE, SEARCH


def seen_outline(
    camera: Camera, region: Region, T_camera_table: Transforms, T_world_table: Transforms | None = None
) -> SeenOutline | None:
    """Return the convex outline of a region on the table; None if the region leaves the image or the table."""
    points, beside = (
        on_plane(camera, pixels, T_camera_table)[:, :2] for pixels in (region.contour, region.contour + region.normals)
    )
    if region.cut or not np.all(np.isfinite(points)) or not np.all(np.isfinite(beside)):
        return None
    pixel = float(np.linalg.norm(beside - points, axis=1).mean())
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    turns = 2 * np.pi * np.arange(32) / 32
    # a corner lies between two points of the outline
    reach = ((points - middle) @ np.stack([np.cos(turns), np.sin(turns)])).max(axis=0) + 0.5 * pixel
    T_world_table = np.eye(4) if T_world_table is None else T_world_table
    return SeenOutline(reach, middle, SE3.inverse(T_camera_table)[:3, 3], pixel, T_world_table)


@dataclass(frozen=True, slots=True, eq=False)
class Narrowed:
    """Candidate parts of a region, and the likelihood of the excluded parts.

    Attributes:
        rows: rows of the candidate parts, the likeliest first.
        similar: rows of the parts with the likeliest outlines, the likeliest first.
        rests: stable poses of each row that are tried; all of them if none is given.
        left_out: number of excluded parts.
        shares: likelihoods of the rows by their outlines, over the best likelihood ``(m,)``.
        rest: sum of the same likelihoods of all excluded parts.
        misled: prior probability that the object is an excluded part with a misleading outline.
    """

    rows: IntArray
    similar: IntArray
    rests: tuple[IntArray, ...] = ()
    left_out: int = 0
    shares: FloatArray = field(default_factory=lambda: np.zeros(0))
    rest: float = 0.0
    misled: float = 0.0

    def log_left_out(self, evidence: FloatArray, mislead: float) -> float:
        """Return the log evidence of all excluded parts.

        If their outlines fit, they are assumed to explain the edges like the less likely half of the candidates. If
        their outlines mislead, they are assumed to explain the edges like an unknown object.

        Args:
            evidence: log evidence of each row ``(m,)``.
            mislead: log evidence of a part that explains no edge, without its prior.
        """
        if not self.left_out:
            return -np.inf
        half = slice(len(self.rows) // 2, None)
        as_these = float(log_sum(evidence[half])) + float(np.log(max(self.rest, 1e-300) / self.shares[half].sum()))
        return float(log_sum([as_these, mislead + np.log(self.misled)]))


def narrowed(outline: SeenOutline | None, parts: Sequence[Any]) -> Narrowed:
    """Return the candidate parts of an outline: all if they are few, none if they are many and there is no outline."""
    none = np.zeros(0, dtype=np.int64)
    if outline is None:
        return Narrowed(np.arange(len(parts)) if len(parts) <= DEFAULTS.pruning.budget else none, none)
    log = outline.log_likelihood(parts)
    order = np.argsort(-log, kind="stable")
    similar = order[:10]
    if len(log) <= DEFAULTS.pruning.budget:
        return Narrowed(np.arange(len(log)), similar)
    shares = np.exp(log[order] - log[order[0]])
    rest = np.cumsum(shares[::-1])[::-1]  # of each and of all after it
    count = min(max(int(np.searchsorted(-rest, -np.exp(-SEARCH.likely) * rest[0])), 1), DEFAULTS.pruning.least)
    left = len(log) - count
    out = float(rest[count]) if left else 0.0
    rests = tuple(outline.likely(parts, int(row)) for row in order[:count])
    return Narrowed(order[:count], similar, rests, left, shares[:count], out, MISLEADING * left / len(log))


def check_size(image: FloatArray, camera: Camera) -> None:
    """Check that an image has the size of its camera.

    Raises:
        InputError: the sizes differ.
    """
    if np.shape(image) != (camera.size[1], camera.size[0]):
        raise InputError(
            f"image: expected {camera.size[1]} rows x {camera.size[0]} columns as the camera has, got "
            f"{np.shape(image)}. Give the calibration of this camera at this resolution."
        )


@dataclass(frozen=True, slots=True, eq=False)
class OutlineOfReadings:
    """The outline of the object of readings.

    Attributes:
        outline: outline on the table.
        pixels: middle of its region ``(2,)`` [px].
        regions: number of regions in the image.
        beside: number of readings whose pixels are off the region.
    """

    outline: SeenOutline
    pixels: FloatArray
    regions: int
    beside: int


def outline_of_readings(
    image: FloatArray, camera: Camera, points: Vectors, *, T_world_table: Transforms | None = None
) -> OutlineOfReadings:
    """Return the outline of the object of readings in an image: that of the region with most readings.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``.
        camera: calibrated camera with its pose ``camera.T_world_camera``.
        points: sensed points in the same world ``(n, 3)`` [m].
        T_world_table: frame whose plane z = 0 is the table; the world if not given.

    Raises:
        InputError: the pose of the camera is unknown, the readings are not in the image, no object is at their place,
            or the object leaves the image.
        MissingExtraError: OpenCV is not installed.

    Example:
        >>> from dataclasses import replace
        >>> from tanteo.io import read_marks
        >>> from tanteo.vision.table import fit_camera
        >>> from tanteo.vision.outlines import outline_of_readings
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> place = fit_camera(camera, *read_marks("images/marks.csv"))
        >>> camera = replace(camera, T_world_camera=place.T_world_camera)
        >>> sensed = np.array([[0.088, -0.016, 0.06], [0.11, -0.02, 0.055]])
        >>> found = outline_of_readings(tanteo.read_image("images/three_parts.png"), camera, sensed)
        >>> parts = tanteo.read_parts(["parts/block.step", "parts/housing.step"])
        >>> found.regions, int(found.outline.log_odds(parts).argmax())
        (3, 1)
    """
    region, regions, beside = region_of_readings(image, camera, points, find_edges(image))
    T_camera_world = SE3.inverse(standing(camera))
    T_world_table = np.eye(4) if T_world_table is None else T_world_table
    outline = seen_outline(camera, region, T_camera_world @ T_world_table, T_world_table)
    if outline is None:
        raise InputError(
            "image: expected the object of the readings whole in it, got one that leaves it. Take it from farther away."
        )
    return OutlineOfReadings(outline, region.centre, regions, beside)


def region_of_readings(
    image: FloatArray, camera: Camera, points: Vectors, edges: EdgePoints
) -> tuple[Region, int, int]:
    """Return the region of an image on which most readings are, the number of regions, and of readings off it.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``.
        camera: calibrated camera with its pose ``camera.T_world_camera``.
        points: sensed points in the same world ``(n, 3)`` [m].
        edges: edge points of the image.

    Raises:
        InputError: the pose of the camera is unknown, the readings are not in the image, or no object is at their
            place.
    """
    check_size(image, camera)
    if camera.T_world_camera is None:
        raise InputError("camera: expected its pose (T_world_camera), got none. Give --marks, or call fit_camera.")
    pixels = project(camera, SE3.apply(SE3.inverse(camera.T_world_camera), points))
    inside = np.all((pixels >= 0) & (pixels <= np.array(camera.size) - 1.0), axis=1)
    if inside.sum() < 0.5 * len(points) or not len(points):
        raise InputError(
            f"image: expected the places of the readings in it, got {int(inside.sum())} of {len(points)}. Are the "
            "camera and the readings in one world, in one unit?"
        )
    regions = find_regions(image, edges)
    away = np.array([_away(region, pixels[inside]) for region in regions]).reshape(len(regions), int(inside.sum()))
    near = away < 2 * EVIDENCE.stretch
    if not near.any():
        raise InputError(
            f"image: expected an object where the readings are, got {len(regions)} elsewhere. Was it taken before the "
            "object was moved, or is the camera in another world than the readings?"
        )
    best = int(np.lexsort((away.sum(axis=1), -near.sum(axis=1)))[0])
    return regions[best], len(regions), int(len(points) - near[best].sum())


def _away(region: Region, pixels: FloatArray) -> FloatArray:
    """Return the distances of pixels ``(n, 2)`` from a region [px]."""
    away = opencv().distanceTransform((~region.mask).astype(np.uint8), 2, 3)
    at = np.rint(pixels).astype(np.int64)
    return np.asarray(away[at[:, 1], at[:, 0]], dtype=np.float64)
