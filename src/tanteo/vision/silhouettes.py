"""The silhouette of a part at a pose: what of the image it covers, and how much of that looks like bare table."""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3
from tanteo.shapes import Surface
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors
from tanteo.vision.camera import Camera, project
from tanteo.vision.cv import opencv
from tanteo.vision.edge_map import cell_of
from tanteo.vision.wireframe import in_camera

MARGIN = 3
"""A silhouette may reach this far over a region before that counts [px]."""


def silhouette(surface: Surface, camera: Camera, T_camera_part: Transforms) -> BoolArray:
    """The pixels that a part covers, rows x columns.

    Args:
        surface: of the part, closed.
        camera: that would take the image.
        T_camera_part: pose ``(4, 4)``.
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


def spilled(surface: Surface, camera: Camera, Ts_camera_part: Transforms, mask: BoolArray) -> FloatArray:
    """How much of a part's silhouette lies where the image shows bare table ``(B,)`` [px of area].

    Args:
        surface: of the part.
        camera: that took the image.
        Ts_camera_part: poses ``(B, 4, 4)``.
        mask: rows x columns, what is not table.
    """
    bare = bare_table(mask)
    return np.array([float(np.count_nonzero(silhouette(surface, camera, T) & bare)) for T in Ts_camera_part])


def bare_table(mask: BoolArray) -> BoolArray:
    """Where bare table is seen, some pixels off what is not ``mask``, rows x columns."""
    return np.asarray(opencv().dilate(mask.astype(np.uint8), np.ones((2 * MARGIN + 1, 2 * MARGIN + 1), np.uint8)) == 0)


def bare_share(points: Vectors, camera: Camera, Ts_camera_part: Transforms, bare: BoolArray) -> FloatArray:
    """Which share of a part's points ``(n, 3)`` lies where ``bare`` table is seen ``(B,)``."""
    row, column, inside = cell_of(bare.shape, project(camera, in_camera(Ts_camera_part, points)))
    return np.asarray((bare[row, column] & inside).mean(axis=-1))
