"""What of a part makes edges in an image: sharp edges, and the rims where the surface turns away from the camera.

Samples of the rims of holes and bosses are on their circles, not on the chords of the mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo import _core
from tanteo.fitting import motion_scale
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors
from tanteo.parts import Part, Rim, Surface, mesh_edges, round_features

SHARP = np.radians(12.0)
"""Two faces that meet at more than this make an edge that may be seen [rad]."""

FLAT = 1e-3
"""Triangles that meet at less than this are one plane: their common side is never seen [rad]."""

SAMPLES = 220
"""About how many samples a part's sharp edges get; rims of curved faces as many again."""

AROUND = 18
"""The rim of a hole or boss gets at least one sample for so many of all: where a hole is discriminates twins."""

_ON_RIM = 1e-4
"""Ends of a mesh edge that are so near to a circle are on it, in diagonals."""

_LIFT = 2e-4
"""How far a sample is lifted off the surface when it is asked whether it is hidden, in diagonals."""


@dataclass(frozen=True, slots=True, eq=False)
class Wireframe:
    """Samples of a part's edges.

    Attributes:
        points: ``(N, 3)``, part frame [m].
        tangents: ``(N, 3)``, unit, along the edge.
        bends: ``(N, 3)``, from the sample to the middle of the rim that it is on, over the square of its radius; zero
            elsewhere [1/m].
        normals: ``(N, 2, 3)``, of the two faces that meet there, outward.
        lengths: ``(N,)``, how much edge each sample stands for [m].
        sharp: ``(N,)``, False for the smooth ones, seen only where they are a rim.
        groups: ``(N,)``, which edge or rim of the part each belongs to: the pair of faces, numbered.
        surface: of the part.
        diagonal: of its box [m].
        middle: its centroid, about which it is moved ``(3,)``, part frame [m].
        scale: motions by its diagonal, or by a radian about its middle, as columns ``(6, 6)`` [m, rad].
        to_unit: the inverse of that.
        compiled: all of it for the core.
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
    scale: FloatArray = field(init=False, repr=False)
    to_unit: FloatArray = field(init=False, repr=False)
    compiled: _core.EdgeFrame = field(init=False, repr=False)

    def __post_init__(self) -> None:
        compiled = _core.make_edge_frame(
            self.points, self.tangents, self.normals, self.lengths, self.sharp,
            self.surface.vertices[self.surface.triangles], self.diagonal, self.middle, _LIFT * self.diagonal,
        )  # fmt: skip
        scale = motion_scale(self.diagonal, self.middle)
        for name, value in (("scale", scale), ("to_unit", np.linalg.inv(scale)), ("compiled", compiled)):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.points)


def wireframe(part: Part, samples: int = SAMPLES) -> Wireframe:
    """Sample the edges of a part, about so many times its sharp ones."""
    edges = mesh_edges(part.triangles)
    surface = Surface(part.vertices, part.triangles)
    normals = np.stack([surface.normals[edges.left], surface.normals[edges.right]], axis=1)
    turn = np.arccos(np.clip(np.sum(normals[:, 0] * normals[:, 1], axis=1), -1.0, 1.0))
    faces = np.sort(np.stack([part.triangle_face[edges.left], part.triangle_face[edges.right]], axis=1), axis=1)
    sharp = (turn > SHARP) & (faces[:, 0] != faces[:, 1]) | edges.rims
    rims = _rims_of(part, edges.ends, sharp)
    pieces = [_sampled(part, edges.ends, chosen, samples, rims) for chosen in (sharp, ~sharp & (turn > FLAT))]
    edge = np.concatenate([piece[0] for piece in pieces])
    _, groups = np.unique(faces[edge], axis=0, return_inverse=True)
    a, b = part.vertices[edges.ends[edge, 0]], part.vertices[edges.ends[edge, 1]]
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
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Rims:
    """Rims of holes and bosses, and on which of them each mesh edge is ``(E,)``; -1 on none."""

    rims: tuple[Rim, ...]
    which: IntArray


def _rims_of(part: Part, ends: IntArray, sharp: BoolArray) -> _Rims:
    rims = tuple(rim for feature in round_features(part) for rim in feature.rims)
    which = np.full(len(ends), -1, dtype=np.int64)
    for k, rim in enumerate(rims):
        local = part.vertices - rim.centre
        height = local @ rim.axis
        out = np.linalg.norm(local - height[:, None] * rim.axis, axis=1) - rim.radius
        on = np.hypot(height, out) < _ON_RIM * part.diagonal
        which[on[ends].all(axis=1) & sharp] = k
    return _Rims(rims, which)


def _rounded(chords: Vectors, tangents: Vectors, rims: _Rims, edge: IntArray) -> tuple[Vectors, Vectors, Vectors]:
    """Samples of chords of a rim, put on its circle: points, tangents and bends."""
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
    part: Part, ends: IntArray, chosen: BoolArray, samples: int, rims: _Rims
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Places at equal steps along the chosen mesh edges, as edge, share of it and length that it stands for."""
    index = np.flatnonzero(chosen)
    lengths = np.linalg.norm(part.vertices[ends[index, 1]] - part.vertices[ends[index, 0]], axis=1)
    total = float(lengths.sum())
    if not total:
        return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0)
    around = np.array([2 * np.pi * rim.radius for rim in rims.rims] + [np.inf]) / max(samples // AROUND, 1)
    step = np.minimum(total / samples, around[rims.which[index]])
    # long edges have whole numbers of samples, chords of curves have every so many of them one
    whole = np.where(lengths > step, np.ceil(lengths / step), lengths / step)
    upto = np.cumsum(whole)
    at = np.arange(0.5, upto[-1])
    k = np.searchsorted(upto, at, side="right")
    share = (at - (upto[k] - whole[k])) / whole[k]
    return index[k], share, lengths[k] / whole[k]


def in_camera(T_camera_part: Transforms, points: Vectors) -> Vectors:
    """Points ``(N, 3)`` of a part in the camera's frame at every pose ``(*batch, N, 3)``."""
    return np.asarray(points @ np.swapaxes(T_camera_part[..., :3, :3], -1, -2) + T_camera_part[..., None, :3, 3])


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Samples of a wireframe as seen at some poses.

    Attributes:
        shown: ``(*batch, N)``, whether each makes an edge in the image.
        rims: ``(*batch, N)``, whether the part ends there: one of the two faces looks away.
    """

    shown: BoolArray
    rims: BoolArray


def see_edges(frame: Wireframe, T_camera_part: Transforms, *, hidden: bool = True) -> Seen:
    """Which samples make edges in the image at poses ``(*batch, 4, 4)``; what the part itself hides only if asked."""
    poses = np.ascontiguousarray(T_camera_part.reshape(-1, 4, 4))
    shape = *T_camera_part.shape[:-2], len(frame)
    shown, rims = (a.reshape(shape) for a in _core.see_edges(frame.compiled, poses, hidden))
    return Seen(shown, rims)
