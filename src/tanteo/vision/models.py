"""A part prepared for images: its edges, points of its surface, its stable poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.catalogue import known_stable_poses
from tanteo.catalogue.stability import StablePose
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.vision.settings import SEARCH
from tanteo.vision.wireframe import Wireframe, wireframe


def lay(part: Part, rest: StablePose, T_table_part: Transforms) -> Transforms:
    """Return the pose in a stable pose that is nearest to a given pose in position and yaw ``(*batch, 4, 4)``."""
    M = T_table_part[..., :3, :3] @ rest.T_table_part[:3, :3].T
    yaw = np.arctan2(M[..., 1, 0] - M[..., 0, 1], M[..., 0, 0] + M[..., 1, 1])
    middle = SE3.apply(T_table_part, part.centroid)
    middle[..., 2] = 0.0
    return np.asarray(SE3.from_parts(SO3.axis_rotation(2, yaw), middle) @ rest.T_table_part)


@dataclass(frozen=True, slots=True, eq=False)
class VisionModel:
    """Data of a part for images, computed once from the CAD.

    Attributes:
        part: the part.
        frame: samples of its edges.
        coarse: few samples of its edges, for the first rounds.
        inner: evenly dense points of its surface ``(k, 3)``, part frame [m].
        rests: its stable poses on a table.
        areas: area of the convex hull of the part as seen from above, in each stable pose ``(k,)`` [m^2].
        seen: the part compiled for the image factor.
        seen_coarsely: the same with few samples of its edges.
    """

    part: Part
    frame: Wireframe
    coarse: Wireframe
    inner: Vectors
    rests: tuple[StablePose, ...]
    areas: FloatArray
    seen: _core.EdgePart
    seen_coarsely: _core.EdgePart


def prepare_vision(part: Part) -> VisionModel:
    """Prepare a part for images. The result stays with the part."""
    if "vision" not in part.derived:
        frame, ways = wireframe(part), known_stable_poses(part)
        # first poses are half of the angle between two yaws off
        coarse = wireframe(part, SEARCH.coarse, np.pi / SEARCH.yaws)
        inner, _ = spread(part)
        part.derived["vision"] = VisionModel(
            part, frame, coarse, inner, ways, _areas(part, ways), _seen(frame, part), _seen(coarse, part)
        )
    model: VisionModel = part.derived["vision"]
    return model


def _areas(part: Part, rests: Sequence[StablePose]) -> FloatArray:
    """Return the area of the convex hull of a part as seen from above, in each stable pose ``(k,)`` [m^2]."""
    from scipy.spatial import ConvexHull

    return np.array([ConvexHull(SE3.apply(one.T_table_part, part.vertices)[:, :2]).volume for one in rests])


def _seen(frame: Wireframe, part: Part) -> _core.EdgePart:
    """Compile the edges of a part for the image factor."""
    return _core.make_edge_part(frame.compiled, frame.groups.astype(np.int32), frame.bends, _marks(part))


def _marks(part: Part) -> Vectors:
    """Return points ``(k, 3)`` that a motion moves unless it is a turn that maps the part onto itself."""
    symmetry, size = part.symmetry, part.diagonal
    if symmetry.spherical:
        return np.ascontiguousarray(part.centroid[None])
    if symmetry.axis is not None:
        return np.ascontiguousarray(symmetry.axis[0] + size * np.outer([-0.5, 0.5], symmetry.axis[1]))
    return np.ascontiguousarray(part.centroid + size * np.concatenate([np.zeros((1, 3)), np.eye(3)]))


def spread(part: Part, count: int = SEARCH.coarse) -> tuple[Vectors, Vectors]:
    """Return evenly dense places of a surface, with their normals (Kronecker's sequence; Roberts 2018)."""
    a, b, c = np.moveaxis(part.vertices[part.triangles], 1, 0)
    upto = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    k = np.searchsorted(upto, (np.arange(count) + 0.5) / count * upto[-1])
    u, v = ((0.5 + share * np.arange(count)) % 1.0 for share in (0.7548776662, 0.5698402910))
    folded = np.where(u + v > 1, [1 - u, 1 - v], [u, v])[..., None]
    normals = np.cross(b - a, c - a)[k]
    places = a[k] + folded[0] * (b[k] - a[k]) + folded[1] * (c[k] - a[k])
    return places, normals / np.linalg.norm(normals, axis=1, keepdims=True)
