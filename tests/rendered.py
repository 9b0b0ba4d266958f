"""Cameras over tables, and obstacles, for rendered scenes (``tanteo.vision.rendering``)."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.vision import Camera
from tanteo.vision.rendering import RenderedObject


def rendered_slab(outline, height, T_world_slab, paint):
    """Return a slab over a star-shaped outline, counter-clockwise ``(n, 2)``."""
    n = len(outline)
    flat = np.concatenate([outline, outline.mean(axis=0, keepdims=True)])
    vertices = np.concatenate([np.insert(flat, 2, z, axis=1) for z in (0.0, height)])
    i = np.arange(n)
    j = (i + 1) % n
    m = n + 1
    lids = [np.stack([j, i, np.full(n, n)], 1), np.stack([i + m, j + m, np.full(n, n + m)], 1)]
    sides = [np.stack([i, j, j + m], 1), np.stack([i, j + m, i + m], 1)]
    labels = np.concatenate([np.zeros(n), np.ones(n), 2 + i, 2 + i]).astype(int)
    return RenderedObject(SE3.apply(T_world_slab, vertices), np.concatenate([*lids, *sides]), labels, paint)


def table_camera(
    distance=0.6, tilt=25.0, turn=30.0, size=(640, 480), focal=620.0, distortion=(-0.12, 0.05, 4e-4, -3e-4, 0.0)
):
    """Return a camera over the table, directed at its origin from ``tilt`` degrees off the vertical."""
    K = np.array([[focal, 0, size[0] / 2 - 3.2], [0, focal * 1.003, size[1] / 2 + 2.1], [0, 0, 1]])
    R = SO3.exp(np.radians([0, 0, turn])) @ SO3.exp(np.radians([180.0 - tilt, 0.0, 0.0]))
    return Camera(K, size, np.array(distortion), SE3.from_parts(R, -distance * R[:, 2]))
