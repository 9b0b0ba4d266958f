"""Find the holes and bosses of a part with their rims, and whether holes are through or blind.

Its spheres and cones are listed separately, because a sphere has a centre and a cone an apex for any angular extent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.parts.faces.bare_rims import BareRim, bare_rims
from tanteo.parts.faces.elements import Face
from tanteo.parts.faces.surfaces import surface_offsets
from tanteo.parts.faces.walls import SAME, Wall, corners_of, walls_of
from tanteo.parts.part import Part
from tanteo.parts.readers.topology import mesh_edges
from tanteo.parts.shapes.surface import Surface

_TIP = 1.2
"""Distance beyond its wall, in radii, within which material on the axis closes a hole.

A drill tip leaves such material.
"""

_INSIDE = 0.02
"""Depth of a ray along a boss below its surface, as a fraction of the radius."""


@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """Circle at one end of a hole or boss.

    Attributes:
        centre: centre in the part frame ``(3,)`` [m].
        axis: unit axis out of the material at that end: out of a hole, off the free end of a boss ``(3,)``.
        radius: radius [m].
        faces: indices into :attr:`Part.faces` of the faces that meet the wall there.
        open: whether a hole is open there, or a boss ends freely.
    """

    centre: FloatArray
    axis: FloatArray
    radius: float
    faces: tuple[int, ...]
    open: bool


@dataclass(frozen=True, slots=True, eq=False)
class RoundFeature:
    """Hole or boss: a wall about an axis.

    Attributes:
        name: name such as ``hole 3`` or ``boss 4``; the number is the index in :func:`round_features`.
        hole: True for a hole, False for a boss.
        surface: kind of the wall: ``cylinder`` or ``cone``; ``rim`` for an opening in a bare face, without a wall.
        faces: indices into :attr:`Part.faces` of the wall's faces; empty without a wall.
        ends: points of the axis where the wall begins and ends, part frame ``(2, 3)`` [m].
        radii: radii at these ends ``(2,)`` [m]; equal for a cylinder.
        rims: rims at these ends.
        through: whether a hole is open at both ends; None for a boss, and for an open surface.
        residual: largest distance of a mesh vertex from the surface [m].
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
        """Unit direction from the first end to the second ``(3,)``, out of the material at the second."""
        along = self.ends[1] - self.ends[0]
        return np.asarray(along / np.linalg.norm(along))

    @property
    def length(self) -> float:
        """Length of the wall along its axis [m]."""
        return float(np.linalg.norm(self.ends[1] - self.ends[0]))

    @property
    def centre(self) -> FloatArray:
        """Midpoint of the axis ``(3,)`` [m]."""
        return np.asarray(self.ends.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class CentredFace:
    """Spherical or conical face with its centre or apex.

    Attributes:
        surface: kind of the face: ``sphere`` or ``cone``.
        face: index into :attr:`Part.faces`.
        centre: centre or apex in the part frame ``(3,)`` [m].
        axis: unit axis into a cone ``(3,)``; arbitrary for a sphere.
        size: radius [m] or half angle [rad].
        hole: True for a hollow, False for a ball or a boss.
    """

    surface: str
    face: int
    centre: FloatArray
    axis: FloatArray
    size: float
    hole: bool


def centred_faces(part: Part) -> tuple[CentredFace, ...]:
    """Return the spheres and cones among the faces of a part in their order, cached with the part.

    Args:
        part: the part.
    """
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
    """Return the holes and bosses of a part in the order of their first faces, cached with the part.

    Cylinders with equal axis, radius and side that overlap are one wall. Walls that extend over less than about half a
    turn are roundings and are excluded. Circular openings in bare faces are holes without a wall.

    Args:
        part: the part.
    """
    if "rounds" not in part.derived:
        walls = walls_of(part)
        context = _Context.of(part) if walls else None
        found = [_feature(context, k, wall) for k, wall in enumerate(walls) if context]
        rims = [_of_rim(len(found) + k, rim) for k, rim in enumerate(bare_rims(part))]
        part.derived["rounds"] = (*found, *rims)
    rounds: tuple[RoundFeature, ...] = part.derived["rounds"]
    return rounds


@dataclass(frozen=True, slots=True, eq=False)
class _Context:
    """Part with its surface, and mesh edges between faces: midpoints ``(N, 3)`` and faces ``(N, 2)``; empty if open."""

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
        ends = ends[::-1]
        opened = opened[::-1]
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


_FLAT = 1e-6
"""Numerical: length of the axis of a hole without a wall [m], which gives it a direction."""


def _of_rim(number: int, rim: BareRim) -> RoundFeature:
    """Return an opening in a bare face as a hole without a wall."""
    ends = rim.centre + 0.5 * _FLAT * np.array([[-1.0], [1.0]]) * rim.normal
    both = [Rim(end, sign * rim.normal, rim.radius, (rim.face,), True) for end, sign in zip(ends, (-1, 1), strict=True)]
    radii = np.full(2, rim.radius)
    return RoundFeature(f"hole {number}", True, "rim", (), ends, radii, (both[0], both[1]), None, rim.residual)


def _radius_at(face: Face, end: Vectors) -> float:
    if face.surface == "cylinder":
        return float(face.radius or 0.0)
    return float(np.linalg.norm(end - np.asarray(face.axis_point)) * np.tan(face.half_angle or 0.0))


def _open_ends(context: _Context, wall: Wall, hole: bool) -> tuple[bool, bool]:
    """Return whether a hole is open, or a boss ends freely, at its lower and upper end."""
    middle = wall.point + 0.5 * (wall.low + wall.high) * wall.axis
    half = 0.5 * (wall.high - wall.low)
    out = wall.place - wall.point
    out = out - (out @ wall.axis) * wall.axis
    start = middle if hole else middle + (1 - _INSIDE) * out
    origins = np.stack([start, start])
    directions = np.stack([-wall.axis, wall.axis])
    far = context.surface.cast(origins, directions).distances
    if hole:
        beyond = half + _TIP * float(np.linalg.norm(out))
        return bool(far[0] > beyond), bool(far[1] > beyond)
    near = half + _INSIDE * float(np.linalg.norm(out)) + SAME * context.part.diagonal
    return bool(far[0] < near), bool(far[1] < near)


def _meeting(context: _Context, wall: Wall, ends: Vectors) -> list[tuple[int, ...]]:
    """Return the faces that meet a wall at each of its ends."""
    own = np.isin(context.sides, wall.faces)
    rim = own.any(axis=1) & ~own.all(axis=1)
    middles = context.middles[rim]
    others: IntArray = np.where(own[rim, 0], context.sides[rim, 1], context.sides[rim, 0])
    nearer = (middles - ends.mean(axis=0)) @ (ends[1] - ends[0]) > 0
    return [tuple(np.unique(others[nearer == second]).tolist()) for second in (False, True)]
