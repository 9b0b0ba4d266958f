"""First poses of a part on the table: every stable pose at every yaw, slid over a region until its edges fall on edges.

Distances to edges are looked up in a small table by direction (chamfer matching; Barrow and others 1977, Shotton and
others 2008). What a part looks like is drawn once for each yaw, in the middle of the region; the perspective is put
right when the pose is refined.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.lie import SE3, SO3
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera, meet_plane, project, rays
from tanteo.vision.edge_map import EdgeMap, channel_of
from tanteo.vision.models import VisionModel
from tanteo.vision.regions import Region
from tanteo.vision.silhouettes import bare_table
from tanteo.vision.wireframe import in_camera, see_edges

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

_MARGIN = 480
"""How far a part may reach out of the image [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """First poses of one part in one region.

    Attributes:
        T_camera_part: ``(k, 4, 4)``.
        rests: ``(k,)``, which stable pose each is.
        costs: ``(k,)``, mean distance of the part's edges to the image's, capped, and what lies on bare table [px].
    """

    T_camera_part: Transforms
    rests: IntArray
    costs: FloatArray


def small_distances(edges: EdgeMap) -> FloatArray:
    """Capped distances on a coarse grid with a margin ``(CHANNELS, rows, columns)``."""
    pad = _MARGIN // _CELL
    low = np.minimum(edges.distances[:, ::_CELL, ::_CELL], _CAP).astype(np.float32)
    return np.pad(low, ((0, 0), (pad, pad), (pad, pad)), constant_values=_CAP)


def _coarse(mask: BoolArray) -> FloatArray:
    """The same grid of a mask: 1 in it, 0 elsewhere and beyond the image."""
    return np.pad(mask[::_CELL, ::_CELL].astype(np.float32), _MARGIN // _CELL)


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
    bare: FloatArray


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
    camera: Camera,
    T_camera_table: Transforms,
    distances: FloatArray,
    places: Slides,
    most: int = 20,
) -> Proposal:
    """First poses of a part in a region.

    Args:
        model: of the part.
        camera: that took the image.
        T_camera_table: the table, z = 0 of its frame.
        distances: of :func:`small_distances`.
        places: of :func:`slides`.
        most: how many poses to keep for each stable pose.
    """
    found = []
    if not len(places.pixels):
        return Proposal(np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64), np.zeros(0))
    for k, rest in enumerate(model.rests):
        turned = SO3.axis_rotation(2, 2 * np.pi * np.arange(YAWS) / YAWS)
        Ts = SE3.from_parts(turned, np.zeros(3)) @ rest.T_table_part
        lift = float((Ts[0, :3, :3] @ model.part.centroid + Ts[0, :3, 3])[2])
        plane = T_camera_table @ SE3.from_parts(np.eye(3), np.array([0.0, 0.0, lift]))
        at = meet_plane(places.rays, plane)
        middle = at[places.middle]
        if not np.all(np.isfinite(at)):
            continue
        shifted = SE3.from_parts(np.eye(3), np.array([middle[0], middle[1], 0.0]))
        costs = _costs(model, camera, T_camera_table @ shifted @ Ts, distances, places)
        yaw, place = _best(costs, places.pixels, most)
        move = SE3.from_parts(np.eye(3), np.concatenate([at[place, :2], np.zeros((len(place), 1))], axis=1))
        found.append((T_camera_table @ move @ Ts[yaw], np.full(len(yaw), k), costs[yaw, place]))
    if not found:
        return Proposal(np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64), np.zeros(0))
    poses, which, cost = (np.concatenate(column) for column in zip(*found, strict=True))
    return Proposal(poses, which, cost)


def _costs(model: VisionModel, camera: Camera, Ts: Transforms, distances: FloatArray, places: Slides) -> FloatArray:
    """Costs ``(yaws, places)`` of the part drawn at ``Ts`` and slid to the places."""
    frame = model.coarse
    seen = see_edges(frame, Ts)
    pixels = project(camera, in_camera(Ts, frame.points))
    along = project(camera, in_camera(Ts, frame.points + 1e-3 * frame.tangents)) - pixels
    span = np.linalg.norm(along, axis=-1) * frame.lengths * seen.shown
    centre = project(camera, SE3.apply(Ts, model.part.centroid))
    total = np.cumsum(span, axis=1)
    at = (np.arange(_DRAWN) + 0.5) / _DRAWN
    chosen = np.stack([np.searchsorted(t, at * t[-1]) for t in total]).clip(0, len(frame) - 1)
    rows = np.arange(len(Ts))[:, None]
    channel = channel_of(np.stack([-along[rows, chosen, 1], along[rows, chosen, 0]], axis=-1))
    drawn = _offsets(distances.shape, pixels[rows, chosen] - centre[:, None], channel)
    inner = _offsets(distances.shape, project(camera, in_camera(Ts, model.inner)) - centre[:, None])
    cell = np.rint(places.pixels / _CELL).astype(np.int64)
    slide = cell[:, 1] * distances.shape[2] + cell[:, 0]
    table, bare = np.asarray(distances, dtype=np.float32), np.asarray(places.bare, dtype=np.float32)
    return _core.slid_costs(table, bare, drawn, inner, slide, SPILLED, SPILL)


def _offsets(shape: tuple[int, ...], offsets: FloatArray, channel: IntArray | int = 0) -> IntArray:
    """Where pixels that are so far from a place ``(*batch, 2)`` stand in flat tables, counted from the place."""
    cell = np.rint((offsets + _MARGIN) / _CELL).astype(np.int64)
    return np.asarray((channel * shape[1] + cell[..., 1]) * shape[2] + cell[..., 0])


def _best(costs: FloatArray, places: FloatArray, most: int) -> tuple[IntArray, IntArray]:
    """The best yaw and place, and the next ones that are not their neighbours."""
    yaws, n = costs.shape
    order = np.argsort(costs, axis=None)[: 40 * most]
    order = order[np.isfinite(costs.ravel()[order])]
    kept: list[tuple[int, int]] = []
    for flat in order:
        yaw, place = divmod(int(flat), n)
        near = any(
            min((yaw - y) % yaws, (y - yaw) % yaws) <= 1 and np.abs(places[place] - places[p]).max() <= STEP
            for y, p in kept
        )
        if not near:
            kept.append((yaw, place))
        if len(kept) == most:
            break
    return np.array([y for y, _ in kept], dtype=np.int64), np.array([p for _, p in kept], dtype=np.int64)
