"""Query a triangle mesh for closest points, inside or outside, and rays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from tanteo import _core
from tanteo.errors import InputError
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors


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


_ON_BORDER = 1e-6
"""Barycentric coordinate below which a point counts as lying on an edge or vertex of its triangle."""


@dataclass(frozen=True, slots=True, eq=False)
class Pseudonormals:
    """Barycentric coordinates of each triangle, and normals for its interior, three edges and three vertices.

    Attributes:
        slopes: gradients of the weights of the second and third vertex ``(T, 2, 3)`` [1/m].
        offsets: values of these weights at the origin ``(T, 2)``.
        table: unnormalized normals ``(T, 8, 3)``; bit ``k`` of the column is set if the weight of vertex ``k`` is zero.
    """

    slopes: FloatArray
    offsets: FloatArray
    table: FloatArray

    def at(self, points: Vectors, triangles: IntArray) -> Vectors:
        """Return pseudonormals ``(*batch, 3)`` at surface points.

        Args:
            points: points on the surface ``(*batch, 3)`` [m].
            triangles: triangles of the points ``(*batch,)``.
        """
        weights = (self.slopes[triangles] @ points[..., None])[..., 0] + self.offsets[triangles]
        first = 1.0 - weights[..., 0] - weights[..., 1] < _ON_BORDER
        border = first + 2 * (weights[..., 0] < _ON_BORDER) + 4 * (weights[..., 1] < _ON_BORDER)
        return np.asarray(self.table.reshape(-1, 3)[8 * triangles + border])


def pseudonormals(vertices: FloatArray, triangles: IntArray, normals: FloatArray) -> Pseudonormals | None:
    """Return the pseudonormals of a mesh; None if an edge does not have exactly two triangles.

    Source: Baerentzen and Aanaes 2005, "Signed distance computation using the angle weighted pseudonormal".

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``.
        normals: unit normals of the triangles ``(T, 3)``.
    """
    edges = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    _, edge, count = np.unique(edges[:, 0] * len(vertices) + edges[:, 1], return_inverse=True, return_counts=True)
    corners = vertices[triangles]
    u = corners[:, 1] - corners[:, 0]
    v = corners[:, 2] - corners[:, 0]
    n = np.cross(u, v)
    squared = np.sum(n * n, axis=1)
    if np.any(count != 2) or np.any(squared == 0.0):
        return None
    slopes = np.stack([np.cross(v, n), np.cross(n, u)], axis=1) / squared[:, None, None]
    along_edges = _sums(edge, np.repeat(normals, 3, axis=0))[edge].reshape(-1, 3, 3)
    weighted = (_angles(corners)[..., None] * normals[:, None]).reshape(-1, 3)
    at_corners = _sums(triangles.ravel(), weighted, len(vertices))[triangles]
    e = along_edges.transpose(1, 0, 2)
    c = at_corners.transpose(1, 0, 2)
    table = np.stack([normals, e[0], e[1], c[2], e[2], c[1], c[0], normals], axis=1)
    return Pseudonormals(slopes, -np.einsum("tki,ti->tk", slopes, corners[:, 0]), table)


def _angles(corners: FloatArray) -> FloatArray:
    """Return the angles of triangles ``(T, 3)`` [rad]."""
    a = np.roll(corners, -1, axis=1) - corners
    b = np.roll(corners, 1, axis=1) - corners
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def _sums(index: IntArray, rows: FloatArray, count: int = 0) -> FloatArray:
    """Return sums of rows ``(m, 3)`` by index."""
    return np.stack([np.bincount(index, weights=rows[:, k], minlength=count) for k in range(3)], axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class ClosestPoints:
    """Closest surface point of each query point.

    Attributes:
        distances: unsigned distances ``(*batch,)`` [m].
        points: points on the surface, in its frame ``(*batch, 3)`` [m].
        triangles: triangles that contain the points ``(*batch,)``.
    """

    distances: FloatArray
    points: Vectors
    triangles: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class RayHits:
    """First hit of each ray.

    Attributes:
        distances: distances along the unit directions ``(*batch,)`` [m]; ``inf`` where the ray misses.
        triangles: triangles that were hit ``(*batch,)``; -1 where the ray misses.
    """

    distances: FloatArray
    triangles: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Triangle mesh with search trees that are built once.

    Attributes:
        vertices: vertices in the part frame ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``, counter-clockwise seen from outside.

    Raises:
        InputError: an array has the wrong shape, is empty, not finite, or has an index out of range.
    """

    vertices: FloatArray
    triangles: IntArray
    _normals: FloatArray = field(init=False, repr=False)
    _tree: list[Any] = field(init=False, repr=False)
    _scene: list[Any] = field(init=False, repr=False)
    _pseudonormals: list[Pseudonormals | None] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        vertices, triangles = checked_mesh(self.vertices, self.triangles)
        normals, _ = _core.triangle_geometry(vertices, triangles)
        for array in (vertices, triangles, normals):
            array.setflags(write=False)
        for name, value in (("vertices", vertices), ("triangles", triangles), ("_normals", normals)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_tree", [])
        object.__setattr__(self, "_scene", [])
        object.__setattr__(self, "_pseudonormals", [])

    def __reduce__(self) -> tuple[type[Surface], tuple[FloatArray, IntArray]]:
        # The trees cannot be pickled; a worker process builds its own.
        return Surface, (self.vertices, self.triangles)

    @property
    def normals(self) -> FloatArray:
        """Unit outward normal of each triangle ``(T, 3)``; zero for a triangle without area."""
        return self._normals

    @property
    def pseudonormals(self) -> Pseudonormals | None:
        """Normals of edges and vertices; None if an edge does not have exactly two triangles."""
        if not self._pseudonormals:
            self._pseudonormals.append(pseudonormals(self.vertices, self.triangles, self._normals))
        return self._pseudonormals[0]

    def closest(self, points: npt.ArrayLike) -> ClosestPoints:
        """Return the closest point of the surface to each query point.

        Args:
            points: query points in the surface frame ``(*batch, 3)`` [m].

        Returns:
            Distances, surface points and triangles with the batch axes of ``points``.

        Raises:
            InputError: the last axis is not 3 or a coordinate is not finite.
        """
        queries, batch = checked_points("points", points)
        if not len(queries):
            return ClosestPoints(np.zeros(batch), np.zeros((*batch, 3)), np.zeros(batch, dtype=np.int64))
        squared, triangles, found = self._searchable().squared_distance(self.vertices, self.triangles, queries)
        return ClosestPoints(
            np.sqrt(np.maximum(squared, 0.0)).reshape(batch),
            np.asarray(found, dtype=np.float64).reshape(*batch, 3),
            np.asarray(triangles, dtype=np.int64).reshape(batch),
        )

    def inside(self, points: npt.ArrayLike) -> BoolArray:
        """Return whether each point lies in the material (winding number above one half).

        Args:
            points: query points in the surface frame ``(*batch, 3)`` [m].

        Returns:
            Mask ``(*batch,)``; undefined for points on the surface.

        Raises:
            InputError: the last axis is not 3 or a coordinate is not finite.
        """
        queries, batch = checked_points("points", points)
        if not len(queries):
            return np.zeros(batch, dtype=np.bool_)
        import igl

        winding = igl.fast_winding_number(self.vertices, self.triangles, queries)
        return np.asarray(winding > 0.5, dtype=np.bool_).reshape(batch)

    def cast(self, origins: npt.ArrayLike, directions: npt.ArrayLike) -> RayHits:
        """Return the first triangle that each ray hits, from either side.

        Args:
            origins: starts of the rays in the surface frame ``(*batch, 3)`` [m]; broadcast against ``directions``.
            directions: directions in the surface frame ``(*batch, 3)`` of any length except zero.

        Returns:
            Distances along the unit directions [m] and triangles.

        Raises:
            InputError: the last axis is not 3, a value is not finite, or a direction is zero.
        """
        starts, rays, batch = checked_rays(origins, directions)
        if not len(starts):
            return RayHits(np.zeros(batch), np.zeros(batch, dtype=np.int64))
        scene, centre, radius = self._embree()
        # Single precision needs small numbers: start each ray just outside the bounding sphere, in units of it.
        local = starts - centre
        ahead = np.maximum(0.0, -np.einsum("ni,ni->n", local, rays) - 1.01 * radius)
        local = (local + ahead[:, None] * rays) / radius
        with np.errstate(all="ignore"):
            triangles = np.asarray(scene.run(local.astype(np.float32), rays.astype(np.float32)), dtype=np.int64)
        distances = self._refined(starts, rays, triangles)
        return RayHits(distances.reshape(batch), triangles.reshape(batch))

    def cast_unit(self, starts: FloatArray, rays: FloatArray) -> tuple[FloatArray, IntArray]:
        """Return :meth:`cast` without checks and reshaping, for callers with many thousand calls a second.

        Args:
            starts: finite starts in the surface frame ``(n, 3)`` [m], within a few times the surface's size.
            rays: unit directions ``(n, 3)``.

        Returns:
            Distances ``(n,)`` [m], infinite where a ray misses, and triangles ``(n,)``, -1 there.
        """
        scene, centre, radius = self._embree()
        local = (starts - centre) * (1.0 / radius)
        triangles = scene.run(local.astype(np.float32), rays.astype(np.float32))
        # a miss has index -1, the last row, whose offset is infinite
        normals, offsets = self._plane_table()
        normal = normals[triangles]
        approach = np.einsum("ij,ij->i", normal, rays)
        along = np.einsum("ij,ij->i", normal, starts)
        steep = np.abs(approach) > 1e-9
        distances = np.abs((offsets[triangles] - along) / np.where(steep, approach, 1.0))
        return np.where(steep, distances, np.inf), np.where(steep, triangles, -1)

    def _plane_table(self) -> tuple[FloatArray, FloatArray]:
        """Return normals and offsets of all triangles, with a last row for a ray that misses."""
        if len(self._scene) < 2:
            offsets = np.sum(self._normals * self.vertices[self.triangles[:, 0]], axis=1)
            table = np.vstack([self._normals, np.zeros(3)]), np.append(offsets, np.inf)
            self._scene.append(table)
        return self._scene[1]

    def _searchable(self) -> Any:
        if not self._tree:
            import igl  # slow to import

            tree = igl.AABB()
            tree.init(self.vertices, self.triangles)
            self._tree.append(tree)
        return self._tree[0]

    def _embree(self) -> tuple[Any, FloatArray, float]:
        if not self._scene:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene

            low = self.vertices.min(axis=0)
            high = self.vertices.max(axis=0)
            centre = (low + high) / 2.0
            radius = float(np.linalg.norm(self.vertices - centre, axis=1).max())
            scene = EmbreeScene()
            scaled = ((self.vertices - centre) / radius).astype(np.float32)
            TriangleMesh(scene, scaled, self.triangles.astype(np.int32))
            self._scene.append((scene, centre, radius))
        scene, centre, radius = self._scene[0]
        return scene, centre, radius

    def _refined(self, starts: FloatArray, rays: FloatArray, triangles: IntArray) -> FloatArray:
        """Return distances to the planes of the hit triangles in double precision."""
        hit = triangles >= 0
        distances = np.full(len(starts), np.inf)
        normals = self._normals[triangles[hit]]
        corners = self.vertices[self.triangles[triangles[hit], 0]]
        approach = np.einsum("ni,ni->n", normals, rays[hit])
        offsets = np.einsum("ni,ni->n", normals, corners - starts[hit])
        # A ray parallel to the triangle's plane within rounding counts as a miss.
        steep = np.abs(approach) > 1e-9
        exact = np.divide(offsets, approach, out=np.full(len(offsets), np.inf), where=steep)
        distances[hit] = np.where(steep, np.maximum(exact, 0.0), np.inf)
        triangles[~np.isfinite(distances)] = -1
        return distances
