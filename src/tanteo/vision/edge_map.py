"""Which edge point is nearest to any place of the image, among those that run in about the same direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.typing import BoolArray, FloatArray, IntArray
from tanteo.vision.cv import opencv
from tanteo.vision.edges import EdgePoints

CHANNELS = 8
"""Directions that are discriminated; a channel holds the edges within one step of its own direction."""

_FAR = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class EdgeMap:
    """Nearest edge points by direction.

    Attributes:
        points: the edge points.
        nearest: ``(CHANNELS, rows, columns)``, index of the nearest point; -1 where a channel is empty; 32 bits.
        distances: ``(CHANNELS, rows, columns)``, how far it is, single precision [px].
    """

    points: EdgePoints
    nearest: np.ndarray
    distances: np.ndarray


def map_edges(points: EdgePoints, used: BoolArray | None = None) -> EdgeMap:
    """Tabulate the nearest edge points.

    Args:
        points: of the image.
        used: which of them count ``(n,)``; all if not given.
    """
    cv2 = opencv()
    rows, columns = points.shape
    at = np.clip(np.rint(points.pixels).astype(np.int64), 0, [columns - 1, rows - 1])
    angle = np.arctan2(points.normals[:, 1], points.normals[:, 0]) % np.pi
    nearest = np.full((CHANNELS, rows, columns), -1, dtype=np.int32)
    distances = np.full((CHANNELS, rows, columns), _FAR, dtype=np.float32)
    for k in range(CHANNELS):
        turn = np.abs((angle - k * np.pi / CHANNELS + np.pi / 2) % np.pi - np.pi / 2)
        members = np.flatnonzero((turn <= np.pi / CHANNELS) & (True if used is None else used))
        if not len(members):
            continue
        free = np.ones((rows, columns), dtype=np.uint8)
        free[at[members, 1], at[members, 0]] = 0
        distance, label = cv2.distanceTransformWithLabels(free, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
        owner = np.zeros(int(label.max()) + 1, dtype=np.int32)
        owner[label[at[members, 1], at[members, 0]]] = members
        nearest[k], distances[k] = owner[label], distance
    return EdgeMap(points, nearest, distances)


def channel_of(normals: FloatArray) -> IntArray:
    """The channel ``(*batch,)`` of edges with normals ``(*batch, 2)``, either sign."""
    angle = np.arctan2(normals[..., 1], normals[..., 0]) * (CHANNELS / np.pi)
    return np.asarray(np.rint(angle).astype(np.int64) % CHANNELS)


def cell_of(shape: tuple[int, int], pixels: FloatArray) -> tuple[IntArray, IntArray, BoolArray]:
    """Row and column of pixels ``(*batch, 2)``, and whether they are in the image; NaN is not."""
    x, y = pixels[..., 0], pixels[..., 1]
    inside = (x > -0.5) & (y > -0.5) & (x < shape[1] - 0.5) & (y < shape[0] - 0.5)
    column = np.where(inside, x, 0.0)
    row = np.where(inside, y, 0.0)
    return np.rint(row).astype(np.int64), np.rint(column).astype(np.int64), inside
