"""Describe the places where faces of a mesh meet: the faces as planes, and the lines that bound them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors
from tanteo.parts.shapes.surface import Surface

SHARP = np.deg2rad(20.0)
"""Angle between triangles below which they belong to one smooth face [rad]."""

FACES = 4
"""Largest number of faces at a corner; if more meet, only the two of the nearest edge are used."""

_SEAM = 0.004
"""Distance past an edge, in diagonals of the mesh, at which a continuing face indicates a seam instead of an edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Junctions:
    """Edges and corners: the adjacent faces as planes, and the lines that bound them.

    A face has one bounding line at an edge and two at a corner. Missing faces are not ``valid``. There is space for
    four faces (:data:`FACES`), or more after :meth:`beside`.

    Attributes:
        normals: outward normals of the faces ``(*batch, 4, 3)``.
        offsets: offsets of the planes ``n . x = offset`` ``(*batch, 4)`` [m].
        inward: unit vector in the face, perpendicular to the line, into the face ``(*batch, 4, 2, 3)``; zero for a
            missing line.
        limits: a point is on the face where ``inward . x >= limit`` ``(*batch, 4, 2)`` [m].
        widths: extent of the face from the line ``(*batch, 4, 2)`` [m].
        reflex: whether the face spans more than pi at the corner, so that satisfying one line suffices ``(*batch, 4)``.
        valid: whether the face exists ``(*batch, 4)``.
        triangles: one triangle of each face ``(*batch, 4)``.
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
        """Return the junctions at given rows.

        Args:
            index: row numbers.
        """
        return Junctions(*(getattr(self, name)[index] for name in self.__slots__))

    def first(self, count: int) -> Junctions:
        """Return the same junctions with only the first faces of each.

        Args:
            count: number of faces.
        """
        return Junctions(*(getattr(self, name)[:, :count] for name in self.__slots__))

    def beside(self, others: Junctions) -> Junctions:
        """Return the same junctions with the faces of others appended.

        Args:
            others: junctions with the same batch.
        """
        arrays = ((getattr(self, name), getattr(others, name)) for name in self.__slots__)
        return Junctions(*(np.concatenate(pair, axis=1) for pair in arrays))

    @classmethod
    def joined(cls, parts: list[Junctions]) -> Junctions:
        """Return several sets of junctions as one.

        Args:
            parts: sets of junctions.
        """
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__slots__))


def at_edges(surface: Surface, edges: IntArray, sides: IntArray, smooth: IntArray) -> Junctions:
    """Return the junctions of edges, each with its two faces.

    Args:
        surface: mesh.
        edges: vertex pairs ``(E, 2)``.
        sides: the two triangles of each edge ``(E, 2)``.
        smooth: smooth face number of each triangle ``(T,)``.
    """
    out = _empty(len(edges))
    a = surface.vertices[edges[:, 0]]
    b = surface.vertices[edges[:, 1]]
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
    """Return whether faces continue past points of their border on an adjacent body: a seam, not an edge."""
    if not len(points):
        return np.zeros(0, dtype=bool)
    step = _SEAM * float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    near = surface.closest(points - step * inward)
    parallel = np.sum(surface.normals[near.triangles] * normals, axis=1) > np.cos(SHARP)
    return np.asarray(parallel & (near.distances < 0.25 * step))


def _widths(surface: Surface, smooth: IntArray, faces: IntArray, inward: Vectors) -> FloatArray:
    """Return the largest ``inward . x`` over the face of each row."""
    out = np.zeros(len(faces))
    for face in np.unique(faces):
        rows = faces == face
        corners = surface.vertices[np.unique(surface.triangles[smooth == face])]
        out[rows] = (inward[rows] @ corners.T).max(axis=1)
    return out


def _into(normals: Vectors, a: Vectors, b: Vectors, inside: Vectors) -> Vectors:
    """Return unit vectors in the faces, perpendicular to lines from ``a`` to ``b``, on the side of inner points."""
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
    """Return the junction of a vertex, each face being a fan of triangles between two sharp edges; None if it is not.

    Args:
        surface: mesh.
        vertex: index of the vertex.
        triangles: all triangles of the vertex.
        sharp: sharp edges, lower vertex first.
        smooth: smooth face number of each triangle ``(T,)``.
    """
    fans = _fans(surface, vertex, triangles, sharp)
    if not 3 <= len(fans) <= FACES:
        return None
    out = _empty(1)
    v = surface.vertices[vertex]
    for k, (fan, lines) in enumerate(fans):
        if len(lines) != 2:
            return None
        others = np.array([[w for w in surface.triangles[t] if w != vertex] for t in fan])
        p = surface.vertices[others[:, 0]] - v
        q = surface.vertices[others[:, 1]] - v
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
    """Return fans of triangles about a vertex, with the sharp edges of each.

    Far end, and third vertex of the triangle.
    """
    spokes: dict[int, list[int]] = {}
    for t in triangles:
        for w in surface.triangles[t]:
            if w != vertex:
                spokes.setdefault(int(w), []).append(int(t))
    left = {int(t) for t in triangles}
    out = []
    while left:
        fan = list[int]()
        stack = [left.pop()]
        lines = list[tuple[int, int]]()
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
