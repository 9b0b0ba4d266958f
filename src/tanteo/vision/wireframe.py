"""Edges of a part in an image: sharp edges, and silhouette edges of curved faces.

Samples of the rims of holes and bosses are on their circles, not on the chords of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from tanteo import _core
from tanteo.fitting.localization import motion_scale
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part, Rim, Surface, round_features
from tanteo.parts.readers import mesh_edges
from tanteo.values import Value, lock
from tanteo.vision.settings import SEARCH

_EXACT = 1e-4
"""Numerical: sine of the angle between triangles of one plane; distance of a vertex from the circle that it is on, as a
share of the part's diagonal. Meshes have more digits."""

_VIEW_STEP = 2e-3
"""Numerical: angle between cameras that share a view [rad], so that the poses of one maximum share a few views."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Wireframe(Value):
    """Samples of a part's edges.

    Attributes:
        points: samples ``(N, 3)``, part frame [m].
        tangents: unit vectors along the edge ``(N, 3)``.
        bends: vectors from the samples to the centre of their rim, over the square of its radius ``(N, 3)`` [1/m]; zero
            elsewhere.
        normals: outward normals of the two adjacent faces ``(N, 2, 3)``.
        lengths: lengths of edge that the samples represent ``(N,)`` [m].
        sharp: whether the edge is sharp ``(N,)``. A smooth edge is visible only as a silhouette.
        groups: number of the pair of faces of the edge ``(N,)``.
        surface: surface of the part.
        diagonal: diagonal of the box of the part [m].
        middle: centroid of the part, about which it moves ``(3,)``, part frame [m].
        view_step: angle between two places of the camera from which the same samples are visible [rad].
        scale: motions by the diagonal, or by a radian about the middle, as columns ``(6, 6)`` [m, rad].
        to_unit: inverse of the scale.
        compiled: the wireframe for the core.
    """

    points: Vectors
    tangents: Vectors
    bends: Vectors
    normals: FloatArray
    lengths: FloatArray
    sharp: BoolArray
    groups: IntArray
    surface: Surface
    diagonal: float
    middle: Vectors
    view_step: float = _VIEW_STEP
    scale: FloatArray = field(init=False, repr=False)
    to_unit: FloatArray = field(init=False, repr=False)
    compiled: _core.EdgeFrame = field(init=False, repr=False)

    def __post_init__(self) -> None:
        compiled = _core.make_edge_frame(
            self.points, self.tangents, self.normals, self.lengths, self.sharp,
            self.surface.vertices[self.surface.triangles], self.diagonal, self.middle, 2 * _EXACT * self.diagonal,
            self.view_step,
        )  # fmt: skip
        scale = motion_scale(self.diagonal, self.middle)
        for name, value in (("scale", scale), ("to_unit", np.linalg.inv(scale)), ("compiled", compiled)):
            object.__setattr__(self, name, value)
        lock(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what copies and other processes need; the rest is computed again."""
        return Wireframe, tuple(getattr(self, one.name) for one in fields(self) if one.init)

    def __len__(self) -> int:
        return len(self.points)


def wireframe(part: Part, samples: int = SEARCH.samples, view_step: float = _VIEW_STEP) -> Wireframe:
    """Sample the edges of a part, with about ``samples`` samples on its sharp edges.

    Vertices are numbered by their coordinates, so that another order of vertices in the file gives the same samples.
    """
    order = np.lexsort(part.vertices.T)
    vertices = part.vertices[order]
    edges = mesh_edges(np.argsort(order)[part.triangles])
    surface = Surface(part.vertices, part.triangles)
    normals = np.stack([surface.normals[edges.left], surface.normals[edges.right]], axis=1)
    turn = np.arccos(np.clip(np.sum(normals[:, 0] * normals[:, 1], axis=1), -1.0, 1.0))
    faces = np.sort(np.stack([part.triangle_face[edges.left], part.triangle_face[edges.right]], axis=1), axis=1)
    sharp = (turn > SEARCH.sharp) & (faces[:, 0] != faces[:, 1]) | edges.rims
    rims = _rims_of(part, vertices, edges.ends, sharp)
    pieces = [_sampled(vertices, edges.ends, chosen, samples, rims) for chosen in (sharp, ~sharp & (turn > _EXACT))]
    edge = np.concatenate([piece[0] for piece in pieces])
    _, groups = np.unique(faces[edge], axis=0, return_inverse=True)
    a, b = vertices[edges.ends[edge, 0]], vertices[edges.ends[edge, 1]]
    chords = a + np.concatenate([piece[1] for piece in pieces])[:, None] * (b - a)
    points, tangents, bends = _rounded(chords, (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True), rims, edge)
    return Wireframe(
        points=points,
        tangents=tangents,
        bends=bends,
        normals=normals[edge],
        lengths=np.concatenate([piece[2] for piece in pieces]),
        sharp=sharp[edge],
        groups=groups.ravel(),
        surface=surface,
        diagonal=part.diagonal,
        middle=part.centroid,
        view_step=view_step,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Rims:
    """Rims of holes and bosses, and the number of the rim of each mesh edge ``(E,)``, -1 for none."""

    rims: tuple[Rim, ...]
    which: IntArray


def _rims_of(part: Part, vertices: Vectors, ends: IntArray, sharp: BoolArray) -> _Rims:
    rims = tuple(rim for feature in round_features(part) for rim in feature.rims)
    which = np.full(len(ends), -1, dtype=np.int64)
    for k, rim in enumerate(rims):
        local = vertices - rim.centre
        height = local @ rim.axis
        out = np.linalg.norm(local - height[:, None] * rim.axis, axis=1) - rim.radius
        on = np.hypot(height, out) < _EXACT * part.diagonal
        which[on[ends].all(axis=1) & sharp] = k
    return _Rims(rims, which)


def _rounded(chords: Vectors, tangents: Vectors, rims: _Rims, edge: IntArray) -> tuple[Vectors, Vectors, Vectors]:
    """Return points, tangents and bends of samples, those on chords of a rim moved to its circle."""
    points, tangents, bends = chords.copy(), tangents.copy(), np.zeros_like(chords)
    for k, rim in enumerate(rims.rims):
        own = np.flatnonzero(rims.which[edge] == k)
        local = chords[own] - rim.centre
        local = local - (local @ rim.axis)[:, None] * rim.axis
        out = local / np.linalg.norm(local, axis=1, keepdims=True)
        points[own] = rim.centre + rim.radius * out
        tangents[own] = np.cross(rim.axis, out)
        bends[own] = -out / rim.radius
    return points, tangents, bends


def _sampled(
    vertices: Vectors, ends: IntArray, chosen: BoolArray, samples: int, rims: _Rims
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return samples at equal steps along mesh edges: edge, position along it, and length of edge for each."""
    index = np.flatnonzero(chosen)
    lengths = np.linalg.norm(vertices[ends[index, 1]] - vertices[ends[index, 0]], axis=1)
    total = float(lengths.sum())
    if not total:
        return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
    spacing = np.array([2 * np.pi * rim.radius for rim in rims.rims] + [np.inf]) / max(
        samples * SEARCH.rim_samples // SEARCH.samples, 1
    )
    step = np.minimum(total / samples, spacing[rims.which[index]])
    # a long edge has a whole number of samples; of short chords of a curve every n-th has one
    whole = np.where(lengths > step, np.ceil(lengths / step), lengths / step)
    short = np.flatnonzero(lengths <= step)
    order = np.r_[np.flatnonzero(lengths > step), short[_along_curves(ends[index[short]])]]
    index, lengths, whole = index[order], lengths[order], whole[order]
    upto = np.cumsum(whole)
    at = np.arange(0.5, upto[-1])
    k = np.searchsorted(upto, at, side="right")
    share = (at - (upto[k] - whole[k])) / whole[k]
    return index[k], share, lengths[k] / whole[k]


def _along_curves(ends: IntArray) -> IntArray:
    """Return the numbers of edges in the order in which they follow one another along curves."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import depth_first_order

    links = np.unique(ends, return_inverse=True)[1].reshape(-1, 2)
    more = int(links.max(initial=-1)) + 1  # one more node is linked to all others
    pairs = np.concatenate([links.T, [np.full(more, more), np.arange(more)]], axis=1)
    graph = coo_array((np.ones(pairs.shape[1]), pairs), shape=(more + 1, more + 1)).tocsr()
    visited = depth_first_order(graph, more, directed=False, return_predecessors=False)
    return np.asarray(np.argsort(np.argsort(visited)[links].max(axis=1), kind="stable"))


def in_camera(T_camera_part: Transforms, points: Vectors) -> Vectors:
    """Return points ``(N, 3)`` of a part in the camera's frame at every pose ``(*batch, N, 3)``."""
    return np.asarray(points @ np.swapaxes(T_camera_part[..., :3, :3], -1, -2) + T_camera_part[..., None, :3, 3])


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Visibility of the samples of a wireframe at poses.

    Attributes:
        shown: whether a sample makes an edge in the image ``(*batch, N)``.
        rims: whether the part ends there, because one of the two faces is turned away ``(*batch, N)``.
    """

    shown: BoolArray
    rims: BoolArray


def see_edges(frame: Wireframe, T_camera_part: Transforms, *, hidden: bool = True) -> Seen:
    """Return which samples make edges in the image at poses ``(*batch, 4, 4)``.

    Args:
        frame: wireframe of the part.
        T_camera_part: poses ``(*batch, 4, 4)``.
        hidden: whether the part hides its own edges.
    """
    poses = np.ascontiguousarray(T_camera_part.reshape(-1, 4, 4))
    shape = *T_camera_part.shape[:-2], len(frame)
    shown, rims = (a.reshape(shape) for a in _core.visible_edges(frame.compiled, poses, hidden))
    return Seen(shown, rims)
