"""What has to be where it is said to be: all corners of a part's box, or one feature of it by name.

A feature counts in the directions that are its own: a face along its normal, an edge across itself, a vertex in all
directions. Where it slides on itself nothing is seen of it, and nothing is lost.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo.answers import box_corners, point_moves
from tanteo.errors import InputError
from tanteo.parts import Part
from tanteo.typing import Covariances, FloatArray, Vectors

_NAME = re.compile(r"(face|plane|edge|vertex) (\d+)")

_MOST = 64
"""Points of a curved face, no more."""


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Points of a part, each with the directions in which it counts.

    Attributes:
        name: in words, ``all corners of bracket`` or ``edge 4 of bracket``.
        feature: name of the feature; None for the corners of the box.
        points: in the part frame ``(K, 3)`` [m].
        across: projectors on the directions that count ``(K, 3, 3)``, part frame.
    """

    name: str
    feature: str | None
    points: Vectors
    across: FloatArray

    @property
    def worst(self) -> str:
        """What a largest deviation is of, in words."""
        return "largest corner sd" if self.feature is None else self.feature

    @property
    def moves(self) -> FloatArray:
        """How the points move with the part's pose, in the directions that count ``(K, 3, 6)``, part frame."""
        return np.asarray(self.across @ point_moves(self.points))

    def sd(self, covariance: Covariances) -> float:
        """Largest standard deviation of a point, in any direction that counts, for one of the pose ``(6, 6)`` [m]."""
        J = self.moves
        return float(np.sqrt(np.linalg.eigvalsh(J @ covariance @ np.swapaxes(J, 1, 2)).max().clip(0.0)))


def places_of(part: Part, feature: str | None = None) -> Places:
    """The places of a feature, or the corners of the part's box.

    Args:
        part: the part.
        feature: ``face 3``, ``edge 4`` or ``vertex 2``, numbered as ``tanteo part show`` does; None for the corners,
            which are taken, too, of a part that has no such feature.
    """
    found = None if feature is None else _feature(part, feature)
    if found is None:
        corners = box_corners(part)
        return Places(f"all corners of {part.name}", None, corners, np.broadcast_to(np.eye(3), (len(corners), 3, 3)))
    return Places(f"{feature} of {part.name}", feature, *found)


def check_feature(feature: str, parts: Sequence[Part] = ()) -> None:
    """Refuse what names no feature, or none that any of the parts has.

    Raises:
        InputError: with the names that there are.
    """
    if _NAME.fullmatch(feature) is None:
        raise InputError(
            f"feature: expected 'face 3', 'edge 4' or 'vertex 2', got '{feature}'. `tanteo part show` lists them."
        )
    if parts and all(_feature(part, feature) is None for part in parts):
        kind = _kind(feature)
        counts = ", ".join(f"{part.name}: {_range(kind, part)}" for part in parts[:3])
        raise InputError(f"feature: expected one of a part, got '{feature}'. There are, of {counts}.")


def _kind(feature: str) -> str:
    """A plane is a face, by the number of the face; answers call it a plane."""
    return feature.split()[0].replace("plane", "face")


def _count(kind: str, part: Part) -> int:
    return {"face": len(part.faces), "edge": len(part.edges), "vertex": len(part.corners)}[kind]


def _range(kind: str, part: Part) -> str:
    n = _count(kind, part)
    return f"{kind} 0 to {n - 1}" if n else f"no {kind}"


def _feature(part: Part, feature: str) -> tuple[Vectors, FloatArray] | None:
    """Points of a feature and their projectors; None if the part has no such feature."""
    match = _NAME.fullmatch(feature)
    if match is None or int(match[2]) >= _count(_kind(feature), part):
        return None
    kind, k = _kind(feature), int(match[2])
    if kind == "vertex":
        return part.corners.points[[k]], np.eye(3)[None]
    if kind == "edge":
        u = part.edges.directions[k]
        return part.edges.ends[k], np.broadcast_to(np.eye(3) - np.outer(u, u), (2, 3, 3))
    points, normals = _face(part, k)
    return points, normals[:, :, None] * normals[:, None]


def _face(part: Part, k: int) -> tuple[Vectors, Vectors]:
    """Points of a face, among them the extremes of a planar one, with the outward normals there."""
    (planar,) = np.nonzero(part.planes.faces == k)
    if len(planar):
        i = int(planar[0])
        points = part.planes.boundary[slice(*part.planes.boundary_start[[i, i + 1]])]
        return points, np.broadcast_to(part.planes.normals[i], points.shape)
    corners = part.vertices[part.triangles[part.triangle_face == k]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    points, normals = corners.reshape(-1, 3), np.repeat(normals, 3, axis=0)
    rows = np.linspace(0, len(points) - 1, min(len(points), _MOST)).astype(np.int64)
    return points[rows], normals[rows]
