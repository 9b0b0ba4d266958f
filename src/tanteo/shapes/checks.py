"""Check the arguments of mesh queries: a mesh, points, rays."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.typing import FloatArray, IntArray


def checked_mesh(vertices: npt.ArrayLike, triangles: npt.ArrayLike) -> tuple[FloatArray, IntArray]:
    """Return copies of vertices ``(V, 3)`` and triangles ``(T, 3)``.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.

    Raises:
        InputError: an array has the wrong shape, is empty, not finite, or has an index out of range.
    """
    points = np.array(vertices, dtype=np.float64, order="C")
    if points.ndim != 2 or points.shape[-1] != 3 or len(points) < 3:
        raise InputError(f"vertices: expected shape (V, 3) with V >= 3, got {points.shape}. Pass metres.")
    if not np.isfinite(points).all():
        raise InputError("vertices: expected finite coordinates, got NaN or infinity. Repair the mesh first.")
    given = np.asarray(triangles)
    if given.ndim != 2 or given.shape[-1] != 3 or not len(given) or given.dtype.kind not in "iu":
        got = f"shape {given.shape} of {given.dtype}"
        raise InputError(f"triangles: expected integers of shape (T, 3) with T >= 1, got {got}.")
    corners = np.array(given, dtype=np.int64, order="C")
    if corners.min() < 0 or corners.max() >= len(points):
        got = f"{corners.min()} to {corners.max()}"
        raise InputError(f"triangles: expected indices from 0 to {len(points) - 1}, got {got}.")
    return points, corners


def checked_points(name: str, values: npt.ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
    """Return points as ``(n, 3)``, and the shape of their batch.

    Args:
        name: name of the argument, for messages.
        values: points ``(*batch, 3)``.

    Raises:
        InputError: the last axis is not 3, or a coordinate is not finite.
    """
    points = np.asarray(values, dtype=np.float64)
    if points.ndim < 1 or points.shape[-1] != 3:
        raise InputError(f"{name}: expected shape (*batch, 3), got {points.shape}. Put x, y, z on the last axis.")
    if not np.isfinite(points).all():
        raise InputError(f"{name}: expected finite coordinates, got NaN or infinity. Drop those rows first.")
    return np.ascontiguousarray(points.reshape(-1, 3)), points.shape[:-1]


def checked_rays(origins: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
    """Return origins and unit directions as ``(n, 3)``, and the shape of their batch.

    Args:
        origins: origins ``(*batch, 3)``.
        directions: directions ``(*batch, 3)`` of any length except zero.

    Raises:
        InputError: the arrays are not points and directions, do not broadcast, or a direction is zero.
    """
    checked_points("origins", origins)
    checked_points("directions", directions)
    try:
        starts, rays = np.broadcast_arrays(np.asarray(origins, float), np.asarray(directions, float))
    except ValueError:
        got = f"{np.shape(origins)} and {np.shape(directions)}"
        raise InputError(f"directions: expected a shape that broadcasts with origins, got {got}.") from None
    lengths = np.linalg.norm(rays, axis=-1, keepdims=True)
    if (lengths <= 0.0).any():
        raise InputError("directions: expected vectors with a length, got zero. Drop those rays first.")
    batch = starts.shape[:-1]
    unit = np.ascontiguousarray((rays / lengths).reshape(-1, 3))
    return np.ascontiguousarray(starts.reshape(-1, 3)), unit, batch
