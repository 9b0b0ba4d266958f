"""Edges of the part at its pose against edge points of the image: which meet, and the pose at which they meet best.

A sample of the part's edge at pixel ``u`` with normal ``n`` meets the nearest edge point ``e`` that runs the same way;
``d = n (e - u)`` is what the pose is fitted to. All poses of one part are worked on together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.vision.camera import Camera
from tanteo.vision.edges import CORRELATION, EdgeMap
from tanteo.vision.wireframe import Seen, Wireframe, see_edges

BIAS = 0.1
"""Standard deviation of what moves a whole edge: shading, blur, wear [px]."""

REACHES = (12.0, 9.0, 7.0, 5.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.2, 1.0)
"""How far off an edge point may be to be taken for the sample's own, round by round [px]."""

BESIDE, WAYS = 1.5, 8
"""How far beside a pose others are started [px], and in how many directions of the table."""

_ASKED = (0, 3, 6)
"""Rounds in which the part is asked again what of it is hidden."""


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMatches:
    """Samples of a wireframe at some poses and the edge points they meet.

    Attributes:
        seen: which samples make edges.
        inside: ``(*batch, N)``, those of them in the image.
        pixels: ``(*batch, N, 2)``, of the samples [px].
        normals: ``(*batch, N, 2)``, unit, across the edges in the image.
        spans: ``(*batch, N)``, length of image edge that a sample stands for [px].
        hits: ``(*batch, N)``, whether an edge point is within reach.
        offsets: ``(*batch, N)``, its distance along the normal [px]; 0 without.
        sds: ``(*batch, N)``, its standard deviation [px]; 1 without.
        points: ``(*batch, N)``, its index; -1 without.
        jacobian: ``(*batch, N, 6)``, ``offset(T exp(xi)) ~ offset - jacobian xi`` [px/m, px/rad].
    """

    seen: Seen
    inside: BoolArray
    pixels: FloatArray
    normals: FloatArray
    spans: FloatArray
    hits: BoolArray
    offsets: FloatArray
    sds: FloatArray
    points: IntArray
    jacobian: FloatArray


def meet(
    frame: Wireframe, camera: Camera, edges: EdgeMap, T_camera_part: Transforms, reach: float, seen: Seen | None = None
) -> EdgeMatches:
    """Find the edge points within reach [px] that the part's edges meet at poses ``(*batch, 4, 4)``."""
    seen = see_edges(frame, T_camera_part) if seen is None else seen
    batch, N = T_camera_part.shape[:-2], len(frame.points)
    numbers, points, inside = _core.meet_edges(
        frame.compiled, camera.numbers, edges.nearest, edges.points.pixels, edges.points.sds,
        np.ascontiguousarray(T_camera_part.reshape(-1, 4, 4)), np.ascontiguousarray(seen.shown.reshape(-1, N)), reach,
    )  # fmt: skip
    n = numbers.reshape(*batch, N, 13)
    point = points.reshape(*batch, N).astype(np.int64)
    return EdgeMatches(
        seen, inside.reshape(*batch, N), n[..., :2], n[..., 2:4], n[..., 4], point >= 0, n[..., 5],
        n[..., 6], point, n[..., 7:],
    )  # fmt: skip


def refine(
    frame: Wireframe,
    camera: Camera,
    edges: EdgeMap,
    T_camera_part: Transforms,
    *,
    prior: FloatArray | None = None,
    start: Transforms | None = None,
    reaches: tuple[float, ...] = REACHES,
) -> Transforms:
    """Better poses, by robust Gauss-Newton on the offsets.

    Args:
        frame: of the part.
        camera: that took the image.
        edges: of the image.
        T_camera_part: pose proposals ``(B, 4, 4)``.
        prior: information on ``Log(T_start^-1 T)`` ``(B, 6, 6)``; none if not given.
        start: where the prior puts the part ``(B, 4, 4)``; the pose proposals if not given.
        reaches: how far to look, round by round [px].
    """
    T, scale = np.ascontiguousarray(T_camera_part), frame.scale
    held = np.zeros((6, 6)) if prior is None else scale.T @ prior @ scale
    held, first = (
        np.ascontiguousarray(np.broadcast_to(a, (len(T), *a.shape[-2:]))) for a in (held, T if start is None else start)
    )
    return _core.refine_edges(
        frame.compiled, camera.numbers, edges.nearest, edges.points.pixels, edges.points.sds, T, first, held,
        np.array(reaches), np.isin(np.arange(len(reaches)), _ASKED), BIAS, CORRELATION,
    )  # fmt: skip


def beside(camera: Camera, T_camera_part: Transforms, T_camera_table: Transforms, centre: Vectors) -> Transforms:
    """A pose and :data:`WAYS` of the same part moved over the table by :data:`BESIDE` ``(1 + WAYS, 4, 4)``."""
    ways = 2 * np.pi * np.arange(WAYS) / WAYS
    flat = np.stack([np.cos(ways), np.sin(ways), np.zeros(WAYS)], axis=-1) @ T_camera_table[:3, :3].T
    moves = np.concatenate([np.zeros((1, 3)), flat * BESIDE * pixel_length(camera, T_camera_part, centre)])
    return np.asarray(SE3.from_parts(np.eye(3), moves) @ T_camera_part)


def pixel_length(camera: Camera, T_camera_part: Transforms, centre: Vectors) -> float:
    """What a pixel is long at a part's ``centre`` [m]."""
    return float(SE3.apply(T_camera_part, centre)[2] / camera.focal.mean())
