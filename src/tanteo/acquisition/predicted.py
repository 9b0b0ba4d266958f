"""Ideas from a part and about where it is: the faces, edges and corners that a hand can best go to.

What an image or a belief says of a part's pose says where its features are, and how well that is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tanteo.acquisition.guesses import EdgeGuess, FaceGuess, VertexGuess
from tanteo.errors import InputError
from tanteo.lie import SE3, SO3
from tanteo.parts import Part
from tanteo.shapes import Surface
from tanteo.typing import Covariances, FloatArray, Transforms

Guess = FaceGuess | EdgeGuess | VertexGuess
_GUESSES: dict[str, Callable[..., Guess]] = {"plane": FaceGuess, "edge": EdgeGuess, "vertex": VertexGuess}

_FACING = 0.5
"""A face is gone to if its normal has at least this product with the direction towards the hand."""

_WIDTH = 12**0.5
"""Width of a strip over the standard deviation of its area across."""

_AROUND, _RISE = (0.02, 0.04), 0.005
"""What rises beside a place, at these distances and by more than this, is in the hand's way [m]."""

_INSET = 0.1
"""An edge or corner is in sight if its face is, this share of the edge's length inside of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """A feature of a part where a pose puts it.

    Attributes:
        name: ``face 3``, ``edge of face 3 and face 5``, ``corner of face 3, face 5 and face 7``.
        faces: Names of its faces, that from which it is sensed first.
        guess: In the world; its spread is that of the pose there, the largest over all directions.
        value: By which features of one kind are compared: the size of what the hand would sense, seen from it.
    """

    name: str
    faces: tuple[str, ...]
    guess: Guess
    value: float


def predicted(
    kind: str, part: Part, T_world_part: Transforms, covariance: Covariances, towards: FloatArray
) -> tuple[Predicted, ...]:
    """Features of a part that face the hand with nothing before them, those with the most to sense first.

    Args:
        kind: ``plane``, ``edge`` or ``vertex``.
        part: The part.
        T_world_part: About its pose ``(4, 4)``.
        covariance: Of the pose, in the part's frame ``(6, 6)`` [m, rad].
        towards: Direction towards the hand, in the world ``(3,)``.

    Raises:
        InputError: A kind that does not exist.
    """
    kinds = {"plane": _faces, "edge": _edges, "vertex": _corners}
    if kind not in kinds:
        raise InputError(f"kind: expected plane, edge or vertex, got '{kind}'. Use one of these.")
    R = T_world_part[:3, :3]
    look = _Look(part, Surface(part.vertices, part.triangles), R.T @ (towards / np.linalg.norm(towards)))
    out = []
    for faces, point, directions, value in kinds[kind](look):
        J = np.concatenate([np.eye(3), -SO3.hat(point)], axis=1)
        place, turn = (np.linalg.eigvalsh(C)[-1] for C in (J @ covariance @ J.T, covariance[3:, 3:]))
        sd, turn_sd = float(np.sqrt(place)), float(np.sqrt(turn))
        guess = _GUESSES[kind](SE3.apply(T_world_part, point), *(R @ d for d in directions), sd, turn_sd)
        names = tuple(part.faces[f].name for f in faces)
        out.append(Predicted(_name(kind, names), names, guess, value))
    return tuple(sorted(out, key=lambda p: -p.value))


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """A part as the hand comes to it, in the part's frame."""

    part: Part
    surface: Surface
    towards: FloatArray

    def cosine(self, plane: int) -> float:
        """How squarely a plane faces the hand."""
        return float(self.part.planes.normals[plane] @ self.towards)

    def value(self, plane: int, point: FloatArray, length: float = np.inf) -> float:
        """Of a plane, or of an edge so long: what of its lesser width the hand sees, less where it has no room."""
        width = min(length, _WIDTH * float(self.part.planes.gyration[plane, 1]))
        return width * self.cosine(plane) * self._room(plane, point)

    def _room(self, plane: int, point: FloatArray) -> float:
        """Share of the places around a point beside which nothing rises over its plane; a little at least."""
        T, away = self.part.planes.Ts_part_feature[plane], 2 * self.part.diagonal
        turns = np.arange(8) * np.pi / 4
        ring = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ T[:3, :2].T
        places = point + np.concatenate([r * ring for r in _AROUND])
        hits = self.surface.cast(places + away * T[:3, 2], np.broadcast_to(-T[:3, 2], places.shape)).distances
        return float(np.mean(hits > away - _RISE)) + 0.05

    def open(self, plane: int, point: FloatArray) -> bool:
        """Whether a place of a plane is met first by what comes along its normal."""
        normal, away = self.part.planes.normals[plane], 2 * self.part.diagonal
        hit = self.surface.cast(point + away * normal, -normal)
        return bool(abs(float(hit.distances) - away) < 1e-6 * away) and self._on(plane, int(hit.triangles))

    def _on(self, plane: int, triangle: int) -> bool:
        return bool(self.part.triangle_face[triangle] == self.part.planes.faces[plane])


_Found = Iterator[tuple[list[int], FloatArray, tuple[FloatArray, ...], float]]
"""Indices of the faces, a point, directions as the idea has them (all in the part), and the value of each feature."""


def _faces(look: _Look) -> _Found:
    planes = look.part.planes
    for k in range(len(planes)):
        if look.cosine(k) < _FACING:
            continue
        for point in (planes.centroids[k], _middle_of_largest(look.part, int(planes.faces[k]))):
            if look.open(k, point):
                yield [int(planes.faces[k])], point, (planes.normals[k],), look.value(k, point)
                break


def _edges(look: _Look) -> _Found:
    part = look.part
    for k, plane, direction in _sides(look):
        inward = np.cross(part.planes.normals[plane], direction)
        point, length = part.edges.midpoints[k], float(part.edges.lengths[k])
        if look.open(plane, point + _INSET * length * inward):
            yield (
                _first(part, k, plane),
                point,
                (direction, part.planes.normals[plane]),
                look.value(plane, point, length),
            )


def _corners(look: _Look) -> _Found:
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
                    faces = dict.fromkeys(_first(part, k, plane) + _first(part, other, plane))
                    yield list(faces), point, (arriving, leaving, n), look.value(plane, point, shorter)


def _sides(look: _Look) -> Iterator[tuple[int, int, FloatArray]]:
    """Convex edges with each plane beside them that faces the hand, directed with the plane on their left."""
    part = look.part
    row = {int(f): k for k, f in enumerate(part.planes.faces)}
    for k in np.flatnonzero(part.edges.convex):
        for face, sign in zip(part.edges.faces[k], (1.0, -1.0), strict=True):
            plane = row.get(int(face))
            if plane is not None and look.cosine(plane) >= _FACING:
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


def _name(kind: str, faces: tuple[str, ...]) -> str:
    if kind == "plane":
        return faces[0]
    return f"{'edge' if kind == 'edge' else 'corner'} of {', '.join(faces[:-1])} and {faces[-1]}"
