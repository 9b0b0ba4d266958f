"""Shapes that are made here: ellipsoids, the hand, outlines of meshes, dashes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from tanteo.hand import Body
from tanteo.typing import Covariances, FloatArray, IntArray, Vectors

_SHARP = np.cos(np.radians(25.0))
"""Triangles that meet at a larger angle make an edge."""

_DASHES = 24
"""Most dashes of a line."""


def ball(rings: int = 8) -> tuple[FloatArray, IntArray]:
    """A sphere of radius 1: vertices ``(V, 3)`` and triangles ``(T, 3)``."""
    k = np.arange(16 * rings) + 0.5  # evenly on the sphere, along a spiral
    z, turn = 1 - 2 * k / len(k), np.pi * (1 + 5**0.5) * k
    r = np.sqrt(1 - z * z)
    return _hull(np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1))


def ellipsoids(points: Vectors, covariances: Covariances, sds: float) -> tuple[FloatArray, IntArray]:
    """Surfaces at so many standard deviations about points, as one mesh.

    Args:
        points: ``(n, 3)`` [m].
        covariances: ``(n, 3, 3)`` [m^2].
        sds: how many.
    """
    vertices, triangles = ball(4)
    variances, axes = np.linalg.eigh(covariances)
    stretched = axes * (sds * np.sqrt(np.maximum(variances, 1e-12)))[:, None, :]
    # a mirrored frame would turn the surface inside out
    stretched[np.linalg.det(axes) < 0, :, 0] *= -1
    placed = points[:, None] + vertices @ np.swapaxes(stretched, 1, 2)
    return joined([(v, triangles) for v in placed])


def hand_mesh(body: Body) -> tuple[FloatArray, IntArray]:
    """The hand as smooth solids: spheres that stand in one line along its z are one of them."""
    columns: dict[tuple[float, ...], list[int]] = {}
    for k, (centre, blind) in enumerate(zip(body.centres, body.blind, strict=True)):
        columns.setdefault((*np.round(centre[:2], 6).tolist(), float(blind)), []).append(k)
    unit = ball()[0]
    return joined(
        [
            _hull((body.centres[rows, None] + body.radii[rows, None, None] * unit).reshape(-1, 3))
            for rows in columns.values()
        ]
    )


def joined(meshes: list[tuple[FloatArray, IntArray]]) -> tuple[FloatArray, IntArray]:
    """Meshes as one."""
    if not meshes:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])
    vertices, triangles = zip(*meshes, strict=True)
    return np.concatenate(vertices), np.concatenate([t + k for t, k in zip(triangles, starts, strict=False)])


def outline(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Edges of a mesh at which its surface turns sharply ``(n, 2, 3)``."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    pairs = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(triangles)), 3)
    order = np.lexsort(pairs.T)
    pairs, owner = pairs[order], owner[order]
    twin = np.flatnonzero((pairs[1:] == pairs[:-1]).all(axis=1))
    sharp = np.sum(normals[owner[twin]] * normals[owner[twin + 1]], axis=1) < _SHARP
    return np.asarray(vertices[pairs[twin[sharp]]])


def dashed(starts: Vectors, ends: Vectors, dash: float) -> FloatArray:
    """Lines in dashes ``(n, 2, 3)``.

    Args:
        starts: ``(m, 3)`` [m].
        ends: ``(m, 3)`` [m].
        dash: length of a dash and of the gap after it [m]; longer where a line would have very many.
    """
    out = [np.zeros((0, 2, 3))]
    for a, b in zip(starts, ends, strict=True):
        count = int(np.clip(np.linalg.norm(b - a) / (2 * dash), 1, _DASHES))
        shares = (np.arange(count)[:, None] + [0.0, 0.5]) / count
        out.append(a + shares[..., None] * (b - a))
    return np.concatenate(out)


def _hull(points: FloatArray) -> tuple[FloatArray, IntArray]:
    """The convex hull, its triangles counter-clockwise seen from outside."""
    hull = ConvexHull(points)
    used, triangles = np.unique(hull.simplices, return_inverse=True)
    triangles, vertices = triangles.reshape(-1, 3), points[used]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    inward = np.sum(np.cross(b - a, c - a) * hull.equations[:, :3], axis=1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return vertices, triangles
