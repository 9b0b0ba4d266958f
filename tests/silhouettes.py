"""How much of a part's silhouette lies on bare table, pixel by pixel: what the image factor is compared with."""

from __future__ import annotations

import numpy as np

from tanteo.vision.camera import project
from tanteo.vision.edges import cell_of
from tanteo.vision.regions import bare_table, silhouette
from tanteo.vision.wireframe import in_camera


def spilled(surface, camera, Ts_camera_part, mask):
    """Return the area of a part's silhouette on bare table at poses ``(B,)`` [px^2]."""
    bare = bare_table(mask)
    return np.array([float(np.count_nonzero(silhouette(surface, camera, T) & bare)) for T in Ts_camera_part])


def bare_share(points, camera, Ts_camera_part, bare):
    """Return the share of a part's points ``(n, 3)`` that lies where ``bare`` table is seen ``(B,)``."""
    row, column, inside = cell_of(bare.shape, project(camera, in_camera(Ts_camera_part, points)))
    return (bare[row, column] & inside).mean(axis=-1)
