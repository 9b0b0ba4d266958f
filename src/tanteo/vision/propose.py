"""Pose proposals of a part on the table: each stable pose at each yaw, translated until its edges fall on edges.

Distances to edges are looked up in a small table by direction (chamfer matching; Barrow and others 1977, Shotton and
others 2008). What a part looks like is drawn once for each yaw, in the middle of the region; the perspective is put
right when the pose is refined.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera, meet_plane, rays
from tanteo.vision.edges import EdgeMap
from tanteo.vision.models import VisionModel
from tanteo.vision.regions import Region, bare_table

YAWS = 72
"""Yaws that are tried."""

STEP = 6
"""Steps by which a part is slid [px]."""

_CELL = 4
_CAP = 6.0
"""Farther than this is as good as nowhere [px]."""

_DRAWN = 56
"""Samples of edges that are looked up."""

SPILL, SPILLED = 12.0, 0.4
"""What a part that lies on bare table altogether costs, beside the distances of its edges [px]; the share of it from
which a place is not looked at."""

_MARGIN = 480 // _CELL
"""How far a part may reach out of the image [cells]."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """Pose proposals of one part in one region.

    Attributes:
        T_camera_part: ``(k, 4, 4)``.
        rests: ``(k,)``, which stable pose each is.
        costs: ``(k,)``, mean distance of the part's edges to the image's, capped, and what lies on bare table [px].
    """

    T_camera_part: Transforms
    rests: IntArray
    costs: FloatArray


def small_distances(edges: EdgeMap) -> np.ndarray:
    """Capped distances on a coarse grid with a margin ``(CHANNELS, rows, columns)``, single precision."""
    low = np.minimum(edges.distances[:, ::_CELL, ::_CELL], _CAP).astype(np.float32)
    return np.pad(low, ((0, 0), (_MARGIN, _MARGIN), (_MARGIN, _MARGIN)), constant_values=_CAP)


def _coarse(mask: BoolArray) -> BoolArray:
    """The same grid of a mask: nothing beyond the image."""
    return np.pad(mask[::_CELL, ::_CELL], _MARGIN)


@dataclass(frozen=True, slots=True, eq=False)
class Slides:
    """Places of a region where a part's centre may be: a grid over its pixels.

    Attributes:
        pixels: ``(S, 2)`` [px].
        rays: through them ``(S, 3)``, camera frame, z = 1.
        middle: which of them is nearest to the region's centre.
        bare: where bare table is seen, on the grid of :func:`small_distances`.
    """

    pixels: FloatArray
    rays: FloatArray
    middle: int
    bare: BoolArray


def slides(region: Region, camera: Camera) -> Slides:
    """Where to slide parts over a region."""
    x0, x1, y0, y1 = region.box
    x, y = np.meshgrid(np.arange(x0, x1 + 1, STEP), np.arange(y0, y1 + 1, STEP))
    on = region.mask[y, x]
    pixels = np.stack([x[on], y[on]], axis=-1).astype(np.float64)
    middle = int(np.argmin(np.linalg.norm(pixels - region.centre, axis=1))) if len(pixels) else 0
    return Slides(pixels, rays(camera, pixels), middle, _coarse(bare_table(region.mask)))


def propose(
    model: VisionModel,
    ways: IntArray,
    camera: Camera,
    T_camera_table: Transforms,
    distances: np.ndarray,
    places: Slides,
    most: int = 20,
) -> Proposal:
    """Pose proposals of a part in a region, so many at most of each stable pose whose number ``ways`` has."""
    found = []
    if not len(places.pixels):
        return Proposal(np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64), np.zeros(0))
    for k in ways.tolist():
        rest = model.rests[k]
        turned = SO3.axis_rotation(2, 2 * np.pi * np.arange(YAWS) / YAWS)
        Ts = SE3.from_parts(turned, np.zeros(3)) @ rest.T_table_part
        lift = float((Ts[0, :3, :3] @ model.part.centroid + Ts[0, :3, 3])[2])
        plane = T_camera_table @ SE3.from_parts(np.eye(3), np.array([0.0, 0.0, lift]))
        at = meet_plane(places.rays, plane)
        middle = at[places.middle]
        if not np.all(np.isfinite(at)):
            continue
        shifted = SE3.from_parts(np.eye(3), np.array([middle[0], middle[1], 0.0]))
        yaw, place, cost = _core.slide_edges(
            model.coarse.compiled, camera.numbers, T_camera_table @ shifted @ Ts, model.part.centroid, model.inner,
            distances, places.bare, places.pixels, _CELL, _MARGIN, _DRAWN, SPILLED, SPILL, STEP, most,
        )  # fmt: skip
        move = SE3.from_parts(np.eye(3), np.concatenate([at[place, :2], np.zeros((len(place), 1))], axis=1))
        found.append((T_camera_table @ move @ Ts[yaw], np.full(len(yaw), k), cost))
    if not found:
        return Proposal(np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64), np.zeros(0))
    poses, which, costs = (np.concatenate(column) for column in zip(*found, strict=True))
    return Proposal(poses, which, costs)
