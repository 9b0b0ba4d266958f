"""Holes and bosses of a part, with their rims, and through or blind.

Beside them its spheres and cones, for a sphere has a centre and a cone an apex however far they go around.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.parts.elements import Face
from tanteo.parts.part import Part
from tanteo.parts.surfaces import surface_offsets
from tanteo.parts.topology import mesh_edges
from tanteo.parts.walls import SAME, Wall, corners_of, walls_of
from tanteo.shapes import Surface
from tanteo.typing import FloatArray, IntArray, Vectors

_TIP = 1.2
"""A hole ends where material lies on its axis no farther beyond its wall than so many radii: what a drill leaves."""

_INSIDE = 0.02
"""Share of the radius by which a ray along a boss runs below its surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """The circle at one end of a hole or boss.

    Attributes:
        centre: in the part frame ``(3,)`` [m].
        axis: unit, out of the material at that end: out of a hole, off the free end of a boss ``(3,)``.
        radius: [m].
        faces: that meet the wall there, index into :attr:`Part.faces`.
        open: whether a hole opens there, or a boss ends in the open.
    """

    centre: FloatArray
    axis: FloatArray
    radius: float
    faces: tuple[int, ...]
    open: bool


@dataclass(frozen=True, slots=True, eq=False)
class RoundFeature:
    """A hole or boss: a wall about an axis.

    Attributes:
        name: ``hole 3``, ``boss 4``; the number is the index in :func:`round_features`.
        hole: True of a hole, False of a boss.
        surface: ``cylinder`` or ``cone``.
        faces: of the wall, index into :attr:`Part.faces`.
        ends: of the axis where the wall begins and ends, in the part frame ``(2, 3)`` [m].
        radii: at these ends ``(2,)`` [m]; equal of a cylinder.
        rims: at these ends.
        through: of a hole, whether it is open at both ends; None of a boss, and where the surface does not close.
        residual: largest distance of a corner of the mesh from the surface [m].
    """

    name: str
    hole: bool
    surface: str
    faces: tuple[int, ...]
    ends: FloatArray
    radii: FloatArray
    rims: tuple[Rim, Rim]
    through: bool | None
    residual: float

    @property
    def axis(self) -> FloatArray:
        """Unit direction from the first end to the second ``(3,)``; out of the material at the second."""
        along = self.ends[1] - self.ends[0]
        return np.asarray(along / np.linalg.norm(along))

    @property
    def length(self) -> float:
        """Of the wall along the axis [m]."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    @property
    def centre(self) -> FloatArray:
        """Middle of the axis ``(3,)`` [m]."""
        return np.asarray(self.ends.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class CentredFace:
    """A spherical or conical face, by its centre or apex.

    Attributes:
        surface: ``sphere`` or ``cone``.
        face: index into :attr:`Part.faces`.
        centre: centre or apex in the part frame ``(3,)`` [m].
        axis: of a cone, into it, unit ``(3,)``; any of a sphere.
        size: radius [m] or half angle [rad].
        hole: True of a hollow, False of a ball or a boss.
    """

    surface: str
    face: int
    centre: FloatArray
    axis: FloatArray
    size: float
    hole: bool


def centred_faces(part: Part) -> tuple[CentredFace, ...]:
    """The spheres and cones among the faces of a part, in their order; kept with the part."""
    if "centred" not in part.derived:
        part.derived["centred"] = tuple(one for k, face in enumerate(part.faces) if (one := _centred(k, face)))
    found: tuple[CentredFace, ...] = part.derived["centred"]
    return found


def _centred(k: int, face: Face) -> CentredFace | None:
    size = {"sphere": face.radius, "cone": face.half_angle}.get(face.surface)
    if size is None or face.axis_point is None or face.convex is None:
        return None
    axis = np.array([0.0, 0.0, 1.0]) if face.surface == "sphere" else face.axis_direction
    if axis is None:
        return None
    return CentredFace(face.surface, k, face.axis_point, axis, size, not face.convex)


def round_features(part: Part) -> tuple[RoundFeature, ...]:
    """The holes and bosses of a part, in the order of their first faces; kept with the part.

    Cylinders that share axis, radius and side and overlap are one wall. Walls of less than about half a turn are
    roundings, and left out.
    """
    if "rounds" not in part.derived:
        walls = walls_of(part)
        context = _Context.of(part) if walls else None
        part.derived["rounds"] = tuple(_feature(context, k, wall) for k, wall in enumerate(walls) if context)
    rounds: tuple[RoundFeature, ...] = part.derived["rounds"]
    return rounds


@dataclass(frozen=True, slots=True, eq=False)
class _Context:
    """A part with its surface, and the edges of its mesh with the faces beside them ``(N, 2)``; none if it is open."""

    part: Part
    surface: Surface
    middles: Vectors
    sides: IntArray

    @classmethod
    def of(cls, part: Part) -> _Context:
        surface = Surface(part.vertices, part.triangles)
        if not part.closed:
            return cls(part, surface, np.zeros((0, 3)), np.zeros((0, 2), dtype=np.int64))
        edges = mesh_edges(part.triangles)
        sides = part.triangle_face[np.stack([edges.left, edges.right], axis=1)]
        apart = sides[:, 0] != sides[:, 1]
        return cls(part, surface, part.vertices[edges.ends[apart]].mean(axis=1), sides[apart])


def _feature(context: _Context, number: int, wall: Wall) -> RoundFeature:
    part = context.part
    face = part.faces[wall.faces[0]]
    hole = not face.convex
    ends = wall.point + np.array([[wall.low], [wall.high]]) * wall.axis
    opened = _open_ends(context, wall, hole)
    if opened == (True, False) or (opened[0] == opened[1] and wall.axis[np.argmax(np.abs(wall.axis))] < 0):
        ends, opened = ends[::-1], opened[::-1]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    radii = np.array([_radius_at(face, end) for end in ends])
    meets = _meeting(context, wall, ends)
    rims = tuple(
        Rim(end, sign * along, float(radius), faces, is_open)
        for end, sign, radius, faces, is_open in zip(ends, (-1, 1), radii, meets, opened, strict=True)
    )
    fields = {name: getattr(face, name) for name in ("axis_point", "axis_direction", "radius", "half_angle")}
    residual = float(np.abs(surface_offsets(face.surface, fields, corners_of(part, wall.faces))).max())
    through = all(opened) if hole and part.closed else None
    name = f"{'hole' if hole else 'boss'} {number}"
    return RoundFeature(name, hole, face.surface, wall.faces, ends, radii, (rims[0], rims[1]), through, residual)


def _radius_at(face: Face, end: Vectors) -> float:
    if face.surface == "cylinder":
        return float(face.radius or 0.0)
    return float(np.linalg.norm(end - np.asarray(face.axis_point)) * np.tan(face.half_angle or 0.0))


def _open_ends(context: _Context, wall: Wall, hole: bool) -> tuple[bool, bool]:
    """Whether a hole is open at its lower and upper end; whether a boss ends in the open there."""
    middle = wall.point + 0.5 * (wall.low + wall.high) * wall.axis
    half, out = 0.5 * (wall.high - wall.low), wall.place - wall.point
    out = out - (out @ wall.axis) * wall.axis
    start = middle if hole else middle + (1 - _INSIDE) * out
    origins, directions = np.stack([start, start]), np.stack([-wall.axis, wall.axis])
    far = context.surface.cast(origins, directions).distances
    if hole:
        beyond = half + _TIP * float(np.linalg.norm(out))
        return bool(far[0] > beyond), bool(far[1] > beyond)
    near = half + _INSIDE * float(np.linalg.norm(out)) + SAME * context.part.diagonal
    return bool(far[0] < near), bool(far[1] < near)


def _meeting(context: _Context, wall: Wall, ends: Vectors) -> list[tuple[int, ...]]:
    """Faces that meet a wall at each of its ends."""
    own = np.isin(context.sides, wall.faces)
    rim = own.any(axis=1) & ~own.all(axis=1)
    middles = context.middles[rim]
    others: IntArray = np.where(own[rim, 0], context.sides[rim, 1], context.sides[rim, 0])
    nearer = (middles - ends.mean(axis=0)) @ (ends[1] - ends[0]) > 0
    return [tuple(np.unique(others[nearer == second]).tolist()) for second in (False, True)]
