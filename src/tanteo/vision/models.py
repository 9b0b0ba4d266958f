"""A part made ready to be looked for: its edges, points of its surface, its stable poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.catalogue import StablePose, known_stable_poses
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.parts import Part
from tanteo.vision.regions import area_from_above
from tanteo.vision.wireframe import Wireframe, wireframe


def lay(part: Part, rest: StablePose, T_table_part: Transforms) -> Transforms:
    """The pose ``(*batch, 4, 4)`` at which the part lies exactly, nearest to a given one in place and yaw."""
    M = T_table_part[..., :3, :3] @ rest.T_table_part[:3, :3].T
    yaw = np.arctan2(M[..., 1, 0] - M[..., 0, 1], M[..., 0, 0] + M[..., 1, 1])
    middle = SE3.apply(T_table_part, part.centroid)
    middle[..., 2] = 0.0
    return np.asarray(SE3.from_parts(SO3.axis_rotation(2, yaw), middle) @ rest.T_table_part)


COARSE = 80
"""About how many samples of edges the first search uses."""


COVER = 400
"""Places of the surface by which the image factor measures how much of the silhouette lies on bare table: a part of
100 px has one for 25 px^2, a sixth of a square stretch."""

INNER = 48
"""How many points of the surface are asked whether they lie on bare table."""


@dataclass(frozen=True, slots=True, eq=False)
class VisionModel:
    """Computed once from the CAD.

    Attributes:
        part: the part.
        frame: samples of its edges.
        coarse: fewer of them, for the first search.
        inner: points all over its surface ``(INNER, 3)``, which are within its silhouette, part frame [m].
        rests: its stable poses on a table.
        area: from straight above, of the middle one of them [m^2].
        seen: the part as the image factor sees it.
        seen_coarsely: the same with few samples of its edges.
    """

    part: Part
    frame: Wireframe
    coarse: Wireframe
    inner: Vectors
    rests: tuple[StablePose, ...]
    area: float
    seen: _core.EdgePart
    seen_coarsely: _core.EdgePart


def prepare_vision(part: Part) -> VisionModel:
    """Make a part ready; what was made is kept with the part, for further images."""
    if "vision" not in part.derived:
        frame, coarse, ways = wireframe(part), wireframe(part, COARSE), known_stable_poses(part)
        area = float(np.median([area_from_above(frame.surface, rest.T_table_part) for rest in ways]))
        inner, _ = spread(part)
        part.derived["vision"] = VisionModel(
            part, frame, coarse, inner, ways, area, _seen(frame, part), _seen(coarse, part)
        )
    model: VisionModel = part.derived["vision"]
    return model


def _seen(frame: Wireframe, part: Part) -> _core.EdgePart:
    """Compile the edges of a part, and places of its surface, for the image factor."""
    cover, normals = spread(part, COVER)
    return _core.make_edge_part(
        frame.compiled, frame.groups.astype(np.int32), frame.bends, cover, normals, part.area / COVER, _marks(part)
    )


def _marks(part: Part) -> Vectors:
    """Return points ``(k, 3)`` that a motion moves unless it is a turn that maps the part onto itself."""
    symmetry, size = part.symmetry, part.diagonal
    if symmetry.spherical:
        return np.ascontiguousarray(part.centroid[None])
    if symmetry.axis is not None:
        return np.ascontiguousarray(symmetry.axis[0] + size * np.outer([-0.5, 0.5], symmetry.axis[1]))
    return np.ascontiguousarray(part.centroid + size * np.concatenate([np.zeros((1, 3)), np.eye(3)]))


def spread(part: Part, count: int = INNER) -> tuple[Vectors, Vectors]:
    """Return evenly dense places of a surface, with their normals (Kronecker's sequence; Roberts 2018)."""
    a, b, c = np.moveaxis(part.vertices[part.triangles], 1, 0)
    upto = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    k = np.searchsorted(upto, (np.arange(count) + 0.5) / count * upto[-1])
    u, v = ((0.5 + share * np.arange(count)) % 1.0 for share in (0.7548776662, 0.5698402910))
    folded = np.where(u + v > 1, [1 - u, 1 - v], [u, v])[..., None]
    normals = np.cross(b - a, c - a)[k]
    places = a[k] + folded[0] * (b[k] - a[k]) + folded[1] * (c[k] - a[k])
    return places, normals / np.linalg.norm(normals, axis=1, keepdims=True)
