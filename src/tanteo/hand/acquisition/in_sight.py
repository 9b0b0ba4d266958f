"""Faces, edges and corners of a part that a hand can come to, each as the guess of its kind has it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.hand.acquisition.look import FACING, Look
from tanteo.parts import Part

_INSET = 0.1
"""An edge or corner is in sight if its face is, this share of the edge's length inside of it."""


@dataclass(frozen=True, slots=True, eq=False)
class InSight:
    """A feature of a part that the hand can come to, in the part's frame.

    Attributes:
        name: Of the feature.
        faces: Indices of its faces, that from which it is sensed first.
        point: Where the guess of its kind has it ``(3,)`` [m].
        directions: Likewise, each ``(3,)``.
        value: By which features of one kind are compared.
        more: What else the guess of its kind takes.
    """

    name: str
    faces: Sequence[int]
    point: FloatArray
    directions: tuple[FloatArray, ...]
    value: float
    more: Mapping[str, Any] = field(default_factory=dict)


Finder: TypeAlias = Callable[[Look], Iterator[InSight]]
"""The features of one kind of a part as the hand comes to it."""


def faces(look: Look) -> Iterator[InSight]:
    """Flat faces."""
    planes = look.part.planes
    for k in range(len(planes)):
        if look.cosine(k) < FACING:
            continue
        for point in (planes.centroids[k], _middle_of_largest(look.part, int(planes.faces[k]))):
            if look.open(k, point):
                face = int(planes.faces[k])
                yield InSight(look.part.faces[face].name, [face], point, (planes.normals[k],), look.value(k, point))
                break


def edges(look: Look) -> Iterator[InSight]:
    """Straight convex edges, each once for either face from which it can be sensed."""
    part = look.part
    for k, plane, direction in _sides(look):
        inward = np.cross(part.planes.normals[plane], direction)
        point, length = part.edges.midpoints[k], float(part.edges.lengths[k])
        if look.open(plane, point + _INSET * length * inward):
            own, directions = _first(part, k, plane), (direction, part.planes.normals[plane])
            yield InSight(_name("edge", part, own), own, point, directions, look.value(plane, point, length))


def corners(look: Look) -> Iterator[InSight]:
    """Corners of flat faces."""
    part = look.part
    sides, ends = list(_sides(look)), np.split(part.corners.edges, part.corners.edges_start[1:-1])
    for point, edges in zip(part.corners.points, ends, strict=False):
        here = [side for side in sides if side[0] in edges]
        for k, plane, arriving in here:
            length = float(part.edges.lengths[k])
            if (point - part.edges.midpoints[k]) @ arriving < 0:
                continue
            for other, same, leaving in here:
                if same != plane or other == k or (point - part.edges.midpoints[other]) @ leaving > 0:
                    continue
                n, shorter = part.planes.normals[plane], min(length, float(part.edges.lengths[other]))
                if look.open(plane, point + _INSET * shorter * (leaving - arriving)):
                    own = list(dict.fromkeys(_first(part, k, plane) + _first(part, other, plane)))
                    value = look.value(plane, point, shorter)
                    yield InSight(_name("corner", part, own), own, point, (arriving, leaving, n), value)


def _sides(look: Look) -> Iterator[tuple[int, int, FloatArray]]:
    """Convex edges with each plane beside them that faces the hand, directed with the plane on their left."""
    part = look.part
    row = {int(f): k for k, f in enumerate(part.planes.faces)}
    for k in np.flatnonzero(part.edges.convex):
        for face, sign in zip(part.edges.faces[k], (1.0, -1.0), strict=True):
            plane = row.get(int(face))
            if plane is not None and look.cosine(plane) >= FACING:
                yield int(k), plane, sign * part.edges.directions[k]


def _first(part: Part, edge: int, plane: int) -> list[int]:
    """Both faces of an edge, that of the plane first."""
    own = int(part.planes.faces[plane])
    return [own, *(int(f) for f in part.edges.faces[edge] if f != own)]


def _middle_of_largest(part: Part, face: int) -> FloatArray:
    """Middle of the largest triangle of a face: on it wherever its centroid may be."""
    corners = part.vertices[part.triangles[part.triangle_face == face]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(corners[int(np.argmax(np.sum(across**2, axis=1)))].mean(axis=0))


def _name(what: str, part: Part, faces: Sequence[int]) -> str:
    *others, last = (part.faces[f].name for f in faces)
    return f"{what} of {', '.join(others)} and {last}"
