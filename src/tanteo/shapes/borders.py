"""Where faces end: the sharp edges of a mesh and the corners where they meet, each with the faces around it.

A reading near an edge may belong to either face, and each face holds only the part of its noise that is on it. Far
from every edge a surface is a plane as far as the noise reaches, and none of this matters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from tanteo.shapes.surface import Surface
from tanteo.typing import BoolArray, FloatArray, IntArray, Vectors

SHARP = np.deg2rad(20.0)
"""Triangles that meet at less than this are one smooth face [rad]."""

FACES = 4
"""Faces at one corner; where more meet, only the two of the nearest edge are looked at."""

_SEAM = 0.004
"""A face that goes on this far past an edge, in diagonals of the mesh, only has a seam there."""

_CELLS = 24
"""Cells of the grid of distances, along its longest side."""


@dataclass(frozen=True, slots=True, eq=False)
class Junctions:
    """Places where faces meet, an edge or a corner each: the faces as planes, and the lines at which they end.

    A face ends at one line at an edge, at two at a corner. Rows that do not exist are not ``valid``. There is room for
    four faces (:data:`FACES`), or more where others were put beside them.

    Attributes:
        normals: of the faces, outward ``(*batch, 4, 3)``.
        offsets: planes are ``n . x = offset`` ``(*batch, 4)`` [m].
        inward: in the face, across a line, into the face ``(*batch, 4, 2, 3)``; zero for a line that is not there.
        limits: a point is on the face where ``inward . x >= limit`` ``(*batch, 4, 2)`` [m].
        widths: how far the face reaches from there ``(*batch, 4, 2)`` [m].
        reflex: the face fills more than a half turn about the corner: past one of the lines is enough ``(*batch, 4)``.
        valid: whether there is such a face ``(*batch, 4)``.
    """

    normals: FloatArray
    offsets: FloatArray
    inward: FloatArray
    limits: FloatArray
    widths: FloatArray
    reflex: BoolArray
    valid: BoolArray

    def take(self, index: IntArray) -> Junctions:
        """Some of the places."""
        return Junctions(*(getattr(self, name)[index] for name in self.__slots__))

    def first(self, count: int) -> Junctions:
        """The same places with the first faces of each only."""
        return Junctions(*(getattr(self, name)[:, :count] for name in self.__slots__))

    def beside(self, others: Junctions) -> Junctions:
        """The same places with more faces."""
        arrays = ((getattr(self, name), getattr(others, name)) for name in self.__slots__)
        return Junctions(*(np.concatenate(pair, axis=1) for pair in arrays))

    @classmethod
    def joined(cls, parts: list[Junctions]) -> Junctions:
        """All of them in one."""
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__))


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """The sharp edges of a mesh, ready to be asked for the nearest one.

    Attributes:
        vertices: of the mesh ``(V, 3)`` [m].
        edges: pairs of vertices ``(E, 2)``.
        junctions: of the edges, and after them of the corners ``(E + C, ...)``.
        corners: row of the junction of each vertex; -1 for one that is no corner ``(V,)``.
        narrowest: least width of the faces at each junction ``(E + C,)`` [m].
    """

    vertices: FloatArray
    edges: IntArray
    junctions: Junctions
    corners: IntArray
    narrowest: FloatArray
    _tree: Any
    _origin: FloatArray
    _step: float
    _grid: FloatArray

    def near(self, points: Vectors, reach: FloatArray) -> BoolArray:
        """Whether an edge may be within reach: never wrong when it says no.

        Args:
            points: ``(*batch, 3)`` in the frame of the mesh [m].
            reach: ``(*batch,)`` [m].
        """
        if not len(self.edges):
            return np.zeros(np.shape(points)[:-1], dtype=bool)
        shape = np.array(self._grid.shape)
        local = (points - self._origin) / self._step
        cell = np.clip(np.rint(local), 0, shape - 1)
        index = ((cell[..., 0] * shape[1] + cell[..., 1]) * shape[2] + cell[..., 2]).astype(np.int64)
        away = self._step * np.sqrt(np.sum((local - cell) ** 2, axis=-1))
        beyond = self._step * np.sqrt(np.sum(np.maximum(np.maximum(-local, local - shape + 1), 0.0) ** 2, axis=-1))
        return np.asarray(np.maximum(self._grid.ravel()[index] - away, beyond) <= reach)

    def nearest(self, points: Vectors, reach: FloatArray) -> tuple[FloatArray, IntArray]:
        """The junction nearest to each point: a corner if one is within reach of the nearest edge's foot.

        Args:
            points: ``(n, 3)`` in the frame of the mesh [m].
            reach: ``(n,)`` [m].

        Returns:
            Distance from the edge [m], and row of :attr:`junctions`.
        """
        squared, edge, foot = self._tree.squared_distance(self.vertices, self.edges, np.ascontiguousarray(points))
        edge = np.asarray(edge, dtype=np.int64).reshape(-1)
        ends = self.edges[edge]
        gaps = np.linalg.norm(self.vertices[ends] - np.asarray(foot)[:, None], axis=-1)
        corner = np.where(gaps < reach[:, None], self.corners[ends], -1)
        closer = np.take_along_axis(corner, np.argmin(np.where(corner >= 0, gaps, np.inf), axis=1)[:, None], axis=1)
        rows = np.where(closer[:, 0] >= 0, closer[:, 0], edge)
        return np.sqrt(np.maximum(np.asarray(squared).reshape(-1), 0.0)), rows


def borders(surface: Surface) -> Borders:
    """Find the sharp edges of a mesh and what meets there.

    Args:
        surface: a mesh; edges that do not have exactly two triangles are left out.
    """
    edges, sides = _sharp_edges(surface)
    smooth = _smooth_faces(surface, edges)
    junctions, corners = [_at_edges(surface, edges, sides, smooth)], np.full(len(surface.vertices), -1)
    valence = np.bincount(edges.ravel(), minlength=len(surface.vertices))
    incident = _incident(surface, np.flatnonzero(valence >= 3))
    sharp = {(int(a), int(b)) for a, b in edges}
    for vertex, triangles in incident.items():
        found = _at_corner(surface, vertex, triangles, sharp, smooth)
        if found is not None:
            corners[vertex] = sum(len(j.offsets) for j in junctions)
            junctions.append(found)
    tree = igl.AABB()
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    step = float((high - low).max()) / _CELLS
    all_ = Junctions.joined(junctions)
    widths = np.where(np.any(all_.inward != 0, axis=-1), all_.widths, np.inf).min(axis=(1, 2))
    if not len(edges):
        return Borders(surface.vertices, edges, all_, corners, widths, tree, low, step, np.full((1, 1, 1), np.inf))
    tree.init(surface.vertices, edges)
    shape = np.ceil((high - low) / step).astype(int) + 3
    origin = low - step
    axes = [origin[k] + step * np.arange(shape[k]) for k in range(3)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    squared, _, _ = tree.squared_distance(surface.vertices, edges, np.ascontiguousarray(centres))
    grid = np.sqrt(np.maximum(np.asarray(squared), 0.0)).reshape(shape)
    return Borders(surface.vertices, edges, all_, corners, widths, tree, origin, step, grid)


def _sharp_edges(surface: Surface) -> tuple[IntArray, IntArray]:
    """Vertices ``(E, 2)`` and the two triangles ``(E, 2)`` of the sharp edges."""
    T = surface.triangles
    ends = np.sort(T[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    owner = np.repeat(np.arange(len(T)), 3)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, owner = ends[order], owner[order]
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    first = first[count == 2]
    sides = np.stack([owner[first], owner[first + 1]], axis=1)
    n = surface.normals[sides]
    sharp = (np.sum(n[:, 0] * n[:, 1], axis=1) < np.cos(SHARP)) & np.all(np.any(n != 0, axis=2), axis=1)
    return np.ascontiguousarray(ends[first][sharp], dtype=np.int64), sides[sharp]


def _smooth_faces(surface: Surface, sharp: IntArray) -> IntArray:
    """Number of the smooth face that each triangle belongs to ``(T,)``: across shared edges that are not sharp."""
    T, V = surface.triangles, len(surface.vertices)
    ends = np.sort(T[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    keys, owner = ends[:, 0] * V + ends[:, 1], np.repeat(np.arange(len(T)), 3)
    order = np.argsort(keys, kind="stable")
    keys, owner = keys[order], owner[order]
    joined = (keys[1:] == keys[:-1]) & ~np.isin(keys[1:], sharp[:, 0] * V + sharp[:, 1])
    a, b = owner[:-1][joined], owner[1:][joined]
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(len(T), len(T)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def _at_edges(surface: Surface, edges: IntArray, sides: IntArray, smooth: IntArray) -> Junctions:
    out = _empty(len(edges))
    a, b = surface.vertices[edges[:, 0]], surface.vertices[edges[:, 1]]
    for side in range(2):
        n = surface.normals[sides[:, side]]
        m = _into(n, a, b, surface.vertices[surface.triangles[sides[:, side]]].mean(axis=1))
        m[_goes_on(surface, 0.5 * (a + b), n, m)] = 0.0
        out.normals[:, side], out.inward[:, side, 0] = n, m
        out.offsets[:, side], out.limits[:, side, 0] = np.sum(n * a, axis=1), np.sum(m * a, axis=1)
        out.widths[:, side, 0] = _widths(surface, smooth, smooth[sides[:, side]], m) - out.limits[:, side, 0]
        out.valid[:, side] = True
    return out


def _goes_on(surface: Surface, points: Vectors, normals: Vectors, inward: Vectors) -> BoolArray:
    """Whether faces go on past points of their border, on a plate or body beside them: a seam, not an edge."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    step = _SEAM * float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    near = surface.closest(points - step * inward)
    alike = np.sum(surface.normals[near.triangles] * normals, axis=1) > np.cos(SHARP)
    return np.asarray(alike & (near.distances < 0.25 * step))


def _widths(surface: Surface, smooth: IntArray, faces: IntArray, inward: Vectors) -> FloatArray:
    """Largest ``inward . x`` over the face of each row."""
    out = np.zeros(len(faces))
    for face in np.unique(faces):
        rows = faces == face
        corners = surface.vertices[np.unique(surface.triangles[smooth == face])]
        out[rows] = (inward[rows] @ corners.T).max(axis=1)
    return out


def _into(normals: Vectors, a: Vectors, b: Vectors, inside: Vectors) -> Vectors:
    """Unit vectors in faces, across lines from ``a`` to ``b``, to the side of points inside."""
    m = np.cross(normals, b - a)
    m /= np.maximum(np.linalg.norm(m, axis=-1, keepdims=True), 1e-300)
    return np.asarray(m * np.sign(np.sum(m * (inside - a), axis=-1, keepdims=True)))


def _empty(count: int) -> Junctions:
    return Junctions(
        np.zeros((count, FACES, 3)), np.zeros((count, FACES)), np.zeros((count, FACES, 2, 3)),
        np.zeros((count, FACES, 2)), np.zeros((count, FACES, 2)),
        np.zeros((count, FACES), dtype=bool), np.zeros((count, FACES), dtype=bool),
    )  # fmt: skip


def _incident(surface: Surface, vertices: IntArray) -> dict[int, IntArray]:
    """Triangles at each of some vertices."""
    chosen = np.isin(surface.triangles, vertices)
    rows, columns = np.nonzero(chosen)
    at = surface.triangles[rows, columns]
    order = np.argsort(at, kind="stable")
    names, starts = np.unique(at[order], return_index=True)
    if not len(names):
        return {}
    return {int(v): some for v, some in zip(names, np.split(rows[order], starts[1:]), strict=True)}


def _at_corner(
    surface: Surface, vertex: int, triangles: IntArray, sharp: set[tuple[int, int]], smooth: IntArray
) -> Junctions | None:
    """The faces about a vertex, each a fan of triangles between two sharp edges; none if it is not that simple."""
    fans = _fans(surface, vertex, triangles, sharp)
    if not 3 <= len(fans) <= FACES:
        return None
    out, v = _empty(1), surface.vertices[vertex]
    for k, (fan, lines) in enumerate(fans):
        if len(lines) != 2:
            return None
        others = np.array([[w for w in surface.triangles[t] if w != vertex] for t in fan])
        p, q = surface.vertices[others[:, 0]] - v, surface.vertices[others[:, 1]] - v
        angles = np.arctan2(np.linalg.norm(np.cross(p, q), axis=1), np.sum(p * q, axis=1))
        n = angles @ surface.normals[fan]
        n /= np.linalg.norm(n)
        out.normals[0, k], out.offsets[0, k], out.valid[0, k] = n, n @ v, True
        out.reflex[0, k] = angles.sum() > np.pi
        for j, (far, inside) in enumerate(lines):
            m = _into(n, v, surface.vertices[far], surface.vertices[inside])
            middle = 0.5 * (v + surface.vertices[far])
            m = m * ~_goes_on(surface, middle[None], n[None], m[None])
            out.inward[0, k, j], out.limits[0, k, j] = m, m @ v
            out.widths[0, k, j] = _widths(surface, smooth, smooth[fan[:1]], m[None])[0] - m @ v
    return out


def _fans(
    surface: Surface, vertex: int, triangles: IntArray, sharp: set[tuple[int, int]]
) -> list[tuple[list[int], list[tuple[int, int]]]]:
    """Triangles about a vertex in groups, with each group's sharp edges: far end, and the third corner there."""
    spokes: dict[int, list[int]] = {}
    for t in triangles:
        for w in surface.triangles[t]:
            if w != vertex:
                spokes.setdefault(int(w), []).append(int(t))
    left, out = {int(t) for t in triangles}, []
    while left:
        fan, stack, lines = list[int](), [left.pop()], list[tuple[int, int]]()
        while stack:
            t = stack.pop()
            fan.append(t)
            ends = [int(w) for w in surface.triangles[t] if w != vertex]
            for w, other in zip(ends, ends[::-1], strict=True):
                if (min(vertex, w), max(vertex, w)) in sharp:
                    lines.append((w, other))
                    continue
                new = [u for u in spokes[w] if u in left]
                left.difference_update(new)
                stack.extend(new)
        out.append((fan, lines))
    return out
