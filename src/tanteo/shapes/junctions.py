"""Where two or more faces of a mesh meet: the faces as planes, and the lines at which they end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.shapes.surface import Surface
from tanteo.typing import BoolArray, FloatArray, IntArray, Vectors

SHARP = np.deg2rad(20.0)
"""Triangles that meet at less than this are one smooth face [rad]."""

FACES = 4
"""Faces at one corner; where more meet, only the two of the nearest edge are looked at."""

_SEAM = 0.004
"""A face that goes on this far past an edge, in diagonals of the mesh, only has a seam there."""


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
        triangles: one of each face there ``(*batch, 4)``.
    """

    normals: FloatArray
    offsets: FloatArray
    inward: FloatArray
    limits: FloatArray
    widths: FloatArray
    reflex: BoolArray
    valid: BoolArray
    triangles: IntArray

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


def at_edges(surface: Surface, edges: IntArray, sides: IntArray, smooth: IntArray) -> Junctions:
    """The two faces of each edge.

    Args:
        surface: the mesh.
        edges: pairs of vertices ``(E, 2)``.
        sides: the two triangles of each ``(E, 2)``.
        smooth: number of the smooth face that each triangle belongs to ``(T,)``.
    """
    out = _empty(len(edges))
    a, b = surface.vertices[edges[:, 0]], surface.vertices[edges[:, 1]]
    for side in range(2):
        n = surface.normals[sides[:, side]]
        m = _into(n, a, b, surface.vertices[surface.triangles[sides[:, side]]].mean(axis=1))
        m[_goes_on(surface, 0.5 * (a + b), n, m)] = 0.0
        out.normals[:, side], out.inward[:, side, 0] = n, m
        out.offsets[:, side], out.limits[:, side, 0] = np.sum(n * a, axis=1), np.sum(m * a, axis=1)
        out.widths[:, side, 0] = _widths(surface, smooth, smooth[sides[:, side]], m) - out.limits[:, side, 0]
        out.valid[:, side], out.triangles[:, side] = True, sides[:, side]
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
        np.zeros((count, FACES), dtype=np.int64),
    )  # fmt: skip


def at_corner(
    surface: Surface, vertex: int, triangles: IntArray, sharp: set[tuple[int, int]], smooth: IntArray
) -> Junctions | None:
    """The faces about a vertex, each a fan of triangles between two sharp edges; none if it is not that simple.

    Args:
        surface: the mesh.
        vertex: which one.
        triangles: all that have it.
        sharp: edges, lower vertex first.
        smooth: number of the smooth face that each triangle belongs to ``(T,)``.
    """
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
        out.reflex[0, k], out.triangles[0, k] = angles.sum() > np.pi, fan[0]
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
