"""Features of a part by their names: ``face 3``, ``plane 3``, ``edge 4``, ``vertex 2``; part frame, metres."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.parts.part import Part

_NAME = re.compile(r"(\w+) (\d+)")

_MOST = 64
"""Definition: largest number of points of a curved face."""

_ARM = 0.03
"""Half length of the cross that is drawn at a vertex, as a share of the part's diagonal."""


@dataclass(frozen=True, slots=True, eq=False)
class NamedFace:
    """A face, flat or curved.

    Attributes:
        part: part that has it.
        number: number among its kind.
        kind: first word of its name, as a user writes it.
        is_labelled: whether only the readings of a label are paired with such a feature.
    """

    kind: ClassVar[str] = "face"
    is_labelled: ClassVar[bool] = False
    part: Part
    number: int

    @classmethod
    def count(cls, part: Part) -> int:
        """Return the number of faces of a part."""
        return len(part.faces)

    @property
    def outline(self) -> FloatArray:
        """Line segments of its border ``(L, 2, 3)`` [m]."""
        part = self.part
        corners = part.triangles[part.triangle_face == self.number][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        pairs, count = np.unique(np.sort(corners, axis=1), axis=0, return_counts=True)
        return part.vertices[pairs[count == 1]]

    @property
    def places(self) -> tuple[Vectors, FloatArray]:
        """Points of the face ``(K, 3)`` [m], and projectors on its normals there ``(K, 3, 3)``."""
        part = self.part
        (planar,) = np.nonzero(part.planes.faces == self.number)
        if len(planar):
            i = int(planar[0])
            points = part.planes.boundary[slice(*part.planes.boundary_start[[i, i + 1]])]
            normals = np.broadcast_to(part.planes.normals[i], points.shape)
        else:
            corners = part.vertices[part.triangles[part.triangle_face == self.number]]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
            points, normals = corners.reshape(-1, 3), np.repeat(normals, 3, axis=0)
            rows = np.linspace(0, len(points) - 1, min(len(points), _MOST)).astype(np.int64)
            points, normals = points[rows], normals[rows]
        return points, normals[:, :, None] * normals[:, None]

    def nearest(self, point: Vectors) -> tuple[Vectors, Vectors] | None:
        """Return the nearest point and the directions across the feature ``(k, 3)``; None for those of the surface."""
        return None


class NamedPlane(NamedFace):
    """A flat face, by the number of the face, that the readings of a label determine."""

    __slots__ = ()
    is_labelled: ClassVar[bool] = True

    @property
    def _row(self) -> int:
        return int(np.flatnonzero(self.part.planes.faces == self.number)[0])

    def nearest(self, point: Vectors) -> tuple[Vectors, Vectors] | None:
        """Return the foot of a point on the plane, and the normal."""
        planes, k = self.part.planes, self._row
        n = planes.normals[k]
        return point - n * (n @ (point - planes.centroids[k])), n[None]


class NamedEdge(NamedFace):
    """A straight edge."""

    __slots__ = ()
    kind: ClassVar[str] = "edge"
    is_labelled: ClassVar[bool] = True

    @classmethod
    def count(cls, part: Part) -> int:
        """Return how many straight edges a part has."""
        return len(part.edges)

    @property
    def outline(self) -> FloatArray:
        """The edge ``(1, 2, 3)``."""
        return self.part.edges.ends[[self.number]]

    @property
    def places(self) -> tuple[Vectors, FloatArray]:
        """Its ends, and projectors across it."""
        u = self.part.edges.directions[self.number]
        return self.part.edges.ends[self.number], np.broadcast_to(np.eye(3) - np.outer(u, u), (2, 3, 3))

    def nearest(self, point: Vectors) -> tuple[Vectors, Vectors] | None:
        """Return the foot of a point on the edge's line, and two directions across it."""
        T = self.part.edges.Ts_part_feature[self.number]
        x = T[:3, 0]
        return T[:3, 3] + x * (x @ (point - T[:3, 3])), T[:3, 1:].T[:2]


class NamedVertex(NamedFace):
    """A corner of straight edges."""

    __slots__ = ()
    kind: ClassVar[str] = "vertex"
    is_labelled: ClassVar[bool] = True

    @classmethod
    def count(cls, part: Part) -> int:
        """Return how many corners a part has."""
        return len(part.corners)

    @property
    def outline(self) -> FloatArray:
        """A cross at it ``(3, 2, 3)``."""
        arms = _ARM * self.part.diagonal * np.eye(3)
        return self.part.corners.points[self.number] + np.stack([-arms, arms], axis=1)

    @property
    def places(self) -> tuple[Vectors, FloatArray]:
        """Its place, fixed in all directions."""
        return self.part.corners.points[[self.number]], np.eye(3)[None]

    def nearest(self, point: Vectors) -> tuple[Vectors, Vectors] | None:
        """Return its place and the three axes."""
        return self.part.corners.points[self.number], np.eye(3)


NAMED: dict[str, type[NamedFace]] = {"face": NamedFace, "plane": NamedPlane, "edge": NamedEdge, "vertex": NamedVertex}
"""Classes of features by the first word of their names."""


def named_class(name: str) -> type[NamedFace] | None:
    """Return the class of a feature's name, such as ``edge 4``; None if it is not a name of a feature."""
    match = _NAME.fullmatch(name)
    return None if match is None else NAMED.get(match[1])


def named_feature(part: Part, name: str) -> NamedFace | None:
    """Return the feature of a part that has a name; None if it has no such feature.

    Example:
        >>> named_feature(part, "edge 4").kind
        'edge'
    """
    cls = named_class(name)
    if cls is None:
        return None
    number = int(name.split()[1])
    return cls(part, number) if number < cls.count(part) else None
