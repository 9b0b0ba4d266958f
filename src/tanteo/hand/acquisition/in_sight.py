"""List the faces, edges and corners of a part that a hand can approach, in the form of guesses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.hand.acquisition.approach_view import FACING, ApproachView
from tanteo.parts import Part

_INSET = 0.1
"""Distance inside of an edge or corner at which its face must be accessible, as a fraction of the edge's length."""


@dataclass(frozen=True, slots=True, eq=False)
class InSight:
    """Feature of a part that the hand can approach, in the part's frame.

    Attributes:
        name: name of the feature.
        faces: indices of its faces; the first is the one from which the hand senses it.
        point: point of the guess ``(3,)`` [m].
        directions: directions of the guess, each ``(3,)``.
        value: value for the comparison of features of one kind.
        more: further arguments of the guess.
    """

    name: str
    faces: Sequence[int]
    point: FloatArray
    directions: tuple[FloatArray, ...]
    value: float
    more: Mapping[str, Any] = field(default_factory=dict)


Finder: TypeAlias = Callable[[ApproachView], Iterator[InSight]]
"""Function that yields the features of one kind that the hand can approach."""


def faces(view: ApproachView) -> Iterator[InSight]:
    """Yield the flat faces that the hand can approach.

    Args:
        view: part and direction of approach.
    """
    planes = view.part.planes
    for k in range(len(planes)):
        if view.cosine(k) < FACING:
            continue
        for point in (planes.centroids[k], _middle_of_largest(view.part, int(planes.faces[k]))):
            if view.open(k, point):
                face = int(planes.faces[k])
                yield InSight(view.part.faces[face].name, [face], point, (planes.normals[k],), view.value(k, point))
                break


def edges(view: ApproachView) -> Iterator[InSight]:
    """Yield the straight convex edges, once for each face from which the hand can sense them.

    Args:
        view: part and direction of approach.
    """
    part = view.part
    for k, plane, direction in _sides(view):
        inward = np.cross(part.planes.normals[plane], direction)
        point, length = part.edges.midpoints[k], float(part.edges.lengths[k])
        if view.open(plane, point + _INSET * length * inward):
            own, directions = _first(part, k, plane), (direction, part.planes.normals[plane])
            yield InSight(_name("edge", part, own), own, point, directions, view.value(plane, point, length))


def corners(view: ApproachView) -> Iterator[InSight]:
    """Yield the corners of flat faces that the hand can approach.

    Args:
        view: part and direction of approach.
    """
    part = view.part
    sides, ends = list(_sides(view)), np.split(part.corners.edges, part.corners.edges_start[1:-1])
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
                if view.open(plane, point + _INSET * shorter * (leaving - arriving)):
                    own = list(dict.fromkeys(_first(part, k, plane) + _first(part, other, plane)))
                    value = view.value(plane, point, shorter)
                    yield InSight(_name("corner", part, own), own, point, (arriving, leaving, n), value)


def _sides(view: ApproachView) -> Iterator[tuple[int, int, FloatArray]]:
    """Yield the convex edges with each adjacent plane that faces the hand, directed with the plane on their left."""
    part = view.part
    row = {int(f): k for k, f in enumerate(part.planes.faces)}
    for k in np.flatnonzero(part.edges.convex):
        for face, sign in zip(part.edges.faces[k], (1.0, -1.0), strict=True):
            plane = row.get(int(face))
            if plane is not None and view.cosine(plane) >= FACING:
                yield int(k), plane, sign * part.edges.directions[k]


def _first(part: Part, edge: int, plane: int) -> list[int]:
    """Return both faces of an edge, that of the plane first."""
    own = int(part.planes.faces[plane])
    return [own, *(int(f) for f in part.edges.faces[edge] if f != own)]


def _middle_of_largest(part: Part, face: int) -> FloatArray:
    """Return the centroid of the largest triangle of a face, which lies on the face even if its centroid does not."""
    corners = part.vertices[part.triangles[part.triangle_face == face]]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(corners[int(np.argmax(np.sum(across**2, axis=1)))].mean(axis=0))


def _name(what: str, part: Part, faces: Sequence[int]) -> str:
    *others, last = (part.faces[f].name for f in faces)
    return f"{what} of {', '.join(others)} and {last}"
