"""Matching of a part's edges with edge points of the image, and the pose at which they match best.

A sample of the part's edge at pixel ``u`` with normal ``n`` matches the nearest edge point ``e`` of the same direction.
The pose minimizes the offsets ``d = n (e - u)``. One call refines all poses of a part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.vision.camera import Camera
from tanteo.vision.edges import EdgeMap
from tanteo.vision.settings import EDGES, EVIDENCE, SEARCH
from tanteo.vision.wireframe import Seen, Wireframe, see_edges


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMatches:
    """Samples of a wireframe at poses, and the edge points that they match.

    Attributes:
        seen: which samples make edges.
        inside: whether a visible sample is in the image ``(*batch, N)``.
        pixels: pixels of the samples ``(*batch, N, 2)`` [px].
        normals: unit normals of the edges in the image ``(*batch, N, 2)``.
        spans: length of image edge for each sample ``(*batch, N)`` [px].
        hits: whether an edge point is within reach ``(*batch, N)``.
        offsets: distance of that point along the normal ``(*batch, N)`` [px]; 0 without a point.
        sds: standard deviation of that point ``(*batch, N)`` [px]; 1 without a point.
        points: index of that point ``(*batch, N)``; -1 without a point.
        jacobian: derivative ``(*batch, N, 6)``: ``offset(T exp(xi)) ~ offset - jacobian xi`` [px/m, px/rad].
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
    """Find the edge points within reach [px] that match the part's edges at poses ``(*batch, 4, 4)``."""
    seen = see_edges(frame, T_camera_part) if seen is None else seen
    batch, N = T_camera_part.shape[:-2], len(frame.points)
    numbers, points, inside = _core.match_edges(
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
    reaches: Sequence[float] | FloatArray | None = None,
) -> Transforms:
    """Refine poses by robust Gauss-Newton on the offsets.

    Args:
        frame: wireframe of the part.
        camera: camera of the image.
        edges: edges of the image.
        T_camera_part: pose proposals ``(B, 4, 4)``.
        prior: information on ``Log(T_start^-1 T)`` ``(B, 6, 6)``; none if not given.
        start: mean of the prior ``(B, 4, 4)``; the pose proposals if not given.
        reaches: largest distance of an edge point in each round [px]; all rounds if not given.
    """
    reaches = SEARCH.reaches(EVIDENCE.stretch) if reaches is None else reaches
    T, scale = np.ascontiguousarray(T_camera_part), frame.scale
    information = np.zeros((6, 6)) if prior is None else scale.T @ prior @ scale
    mean = T if start is None else start
    information, first = (
        np.ascontiguousarray(np.broadcast_to(a, (len(T), *a.shape[-2:]))) for a in (information, mean)
    )
    return _core.refine_edges(
        frame.compiled, camera.numbers, edges.nearest, edges.points.pixels, edges.points.sds, T, first, information,
        np.asarray(reaches), np.arange(len(reaches)) % 3 == 0, EDGES.bias, EDGES.correlation,
    )  # fmt: skip


def beside(camera: Camera, T_camera_part: Transforms, T_camera_table: Transforms, centre: Vectors) -> Transforms:
    """Return a pose, and poses of the part moved over the table, in one direction for each channel ``(k, 4, 4)``."""
    ways = 2 * EDGES.direction * np.arange(EDGES.channels)
    flat = np.stack([np.cos(ways), np.sin(ways), np.zeros(len(ways))], axis=-1) @ T_camera_table[:3, :3].T
    moves = np.concatenate([np.zeros((1, 3)), flat * SEARCH.beside * pixel_length(camera, T_camera_part, centre)])
    return np.asarray(SE3.from_parts(np.eye(3), moves) @ T_camera_part)


def principal_moves(frame: Wireframe, camera: Camera, edges: EdgeMap, T_camera_part: Transforms) -> Transforms:
    """Return a pose, and poses moved both ways along the principal axes of its information ``(13, 4, 4)``.

    Each motion moves the visible edges by ``SearchSettings.beside`` (rms). Motions that edges hardly show, such as
    depth with tilt in one image, are large. None turns the part by more than the angle between two channels.

    Args:
        frame: wireframe of the part.
        camera: camera of the image.
        edges: edges of the image.
        T_camera_part: pose ``(4, 4)``.
    """
    matches = meet(frame, camera, edges, T_camera_part[None], EVIDENCE.reach)
    rows = matches.inside[0]
    J, spans = matches.jacobian[0, rows] @ frame.scale, matches.spans[0, rows]
    values, axes = np.linalg.eigh((J.T * spans) @ J / max(float(spans.sum()), 1e-12))
    sizes = np.minimum(SEARCH.beside / np.sqrt(np.maximum(values, 1e-12)), EDGES.direction)
    steps = (axes * sizes).T @ frame.scale.T
    return np.asarray(T_camera_part @ SE3.exp(np.concatenate([np.zeros((1, 6)), steps, -steps])))


def pixel_length(camera: Camera, T_camera_part: Transforms, centre: Vectors) -> float:
    """Return the length of a pixel at the centre of a part [m]."""
    return float(SE3.apply(T_camera_part, centre)[2] / camera.focal.mean())
