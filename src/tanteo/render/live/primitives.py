"""Primitives of a picture: meshes, lines, dots, arrows and labels, world frame [m].

Each primitive has a unique name, and a layer that the user can hide. Without a layer it is always visible.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from trimesh.convex import convex_hull
from trimesh.creation import icosphere

from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms, Vectors
from tanteo.hand import Body
from tanteo.parts import Surface
from tanteo.parts.readers import mesh_edges

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Surface with vertices ``(V, 3)`` in its own frame, pose ``T`` in the world, and triangles ``(T, 3)``."""

    name: str
    vertices: FloatArray
    triangles: IntArray
    colour: Colour
    opacity: float = 1.0
    T: Transforms = field(default_factory=lambda: np.eye(4))
    layer: str = ""

    def same_shape(self, other: Primitive) -> bool:
        """Return whether another mesh differs only in pose and opacity."""
        return (
            isinstance(other, Mesh)
            and self.vertices is other.vertices
            and self.triangles is other.triangles
            and self.colour == other.colour
        )


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """Straight lines ``(n, 2, 3)`` in their own frame, with pose ``T`` in the world and width [px]."""

    name: str
    segments: FloatArray
    colour: Colour
    width: float = 1.5
    T: Transforms = field(default_factory=lambda: np.eye(4))
    layer: str = ""

    def same_shape(self, other: Primitive) -> bool:
        """Return whether other lines differ only in their pose."""
        return isinstance(other, Lines) and self.segments is other.segments and self.colour == other.colour


@dataclass(frozen=True, slots=True, eq=False)
class Dots:
    """Points ``(n, 3)`` with one size [m] and one shape: ``circle``, ``diamond`` or ``square``."""

    name: str
    points: Vectors
    colour: Colour
    size: float
    shape: str = "circle"
    layer: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Arrow:
    """Arrow with the radius of its shaft [m]."""

    name: str
    start: Vectors
    end: Vectors
    colour: Colour
    radius: float
    layer: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Label:
    """Text at a point ``(3,)`` [m]."""

    name: str
    text: str
    place: Vectors
    layer: str = ""


Primitive = Mesh | Lines | Dots | Arrow | Label


_SHARP = np.cos(np.radians(25.0))
"""Cosine of the smallest angle between two triangles at a drawn edge."""

_DASHES = 24
"""Largest number of dashes of a line."""


def _faces(mesh: Any) -> tuple[FloatArray, IntArray]:
    return np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)


def ball(subdivisions: int = 2) -> tuple[FloatArray, IntArray]:
    """Return a unit sphere as a mesh: vertices ``(V, 3)`` and triangles ``(T, 3)``.

    Args:
        subdivisions: number of subdivisions of an icosahedron.
    """
    return _faces(icosphere(subdivisions))


def ellipsoids(points: Vectors, covariances: Covariances, sds: float) -> tuple[FloatArray, IntArray]:
    """Return the uncertainty ellipsoids of points as one mesh: vertices and triangles.

    Args:
        points: centres ``(n, 3)`` [m].
        covariances: covariances of the points ``(n, 3, 3)`` [m^2].
        sds: half axes in standard deviations.
    """
    vertices, triangles = ball(1)
    variances, axes = np.linalg.eigh(covariances)
    stretched = axes * (sds * np.sqrt(np.maximum(variances, 1e-12)))[:, None, :]
    # a mirrored frame would turn the surface inside out
    stretched[np.linalg.det(axes) < 0, :, 0] *= -1
    placed = points[:, None] + vertices @ np.swapaxes(stretched, 1, 2)
    return joined([(v, triangles) for v in placed])


def hand_mesh(body: Body) -> tuple[FloatArray, IntArray]:
    """Return the body of a hand as one mesh: vertices ``(V, 3)`` [m] and triangles ``(T, 3)``.

    Spheres in a line along z form one smooth solid.

    Args:
        body: model of the hand as spheres.
    """
    columns: dict[tuple[float, ...], list[int]] = {}
    for k, (centre, blind) in enumerate(zip(body.centres, body.blind, strict=True)):
        columns.setdefault((*np.round(centre[:2], 6).tolist(), float(blind)), []).append(k)
    unit = ball()[0]
    return joined(
        [
            _faces(convex_hull((body.centres[rows, None] + body.radii[rows, None, None] * unit).reshape(-1, 3)))
            for rows in columns.values()
        ]
    )


def chain_mesh(centres: Vectors, radii: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return spheres as one mesh, each joined with the next one of the same radius.

    Args:
        centres: centres ``(k, 3)`` [m].
        radii: radii ``(k,)`` [m].
    """
    unit = ball()[0]
    meshes = []
    for k, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
        following = k + 1 if k + 1 < len(radii) and np.isclose(radii[k + 1], radius) else k
        points = np.concatenate([centre + radius * unit, centres[following] + radius * unit])
        meshes.append(_faces(convex_hull(points)))
    return joined(meshes)


def joined(meshes: list[tuple[FloatArray, IntArray]]) -> tuple[FloatArray, IntArray]:
    """Return several meshes as one mesh.

    Args:
        meshes: vertices and triangles of each mesh.
    """
    if not meshes:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])
    vertices, triangles = zip(*meshes, strict=True)
    return np.concatenate(vertices), np.concatenate([t + k for t, k in zip(triangles, starts, strict=False)])


def outline(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the sharp edges and borders of a mesh as line segments ``(n, 2, 3)`` [m].

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: indices of the vertices ``(T, 3)``.
    """
    edges, normals = mesh_edges(triangles), Surface(vertices, triangles).normals
    sharp = np.sum(normals[edges.left] * normals[edges.right], axis=1) < _SHARP
    return np.asarray(vertices[edges.ends[sharp | edges.rims]])


def dashed(starts: Vectors, ends: Vectors, dash: float) -> FloatArray:
    """Return dashed lines as segments ``(n, 2, 3)`` [m], with gaps as long as the dashes.

    Args:
        starts: starts of the lines ``(m, 3)`` [m].
        ends: ends of the lines ``(m, 3)`` [m].
        dash: smallest length of a dash [m]; long lines have longer ones.
    """
    out = [np.zeros((0, 2, 3))]
    for a, b in zip(starts, ends, strict=True):
        count = int(np.clip(np.linalg.norm(b - a) / (2 * dash), 1, _DASHES))
        shares = (np.arange(count)[:, None] + [0.0, 0.5]) / count
        out.append(a + shares[..., None] * (b - a))
    return np.concatenate(out)
