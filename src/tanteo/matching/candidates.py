"""The features of a part that a sensed one may be: faces, edges in both directions, corners, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.features import EDGE
from tanteo.parts import Part
from tanteo.typing import FloatArray, IntArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """The model features that a sensed feature of one kind may be.

    Attributes:
        Ts_part_feature: frames ``(N, 4, 4)``; an edge appears twice, once in each direction.
        directions: normal or direction ``(N, 3)``; zero for vertices.
        weights: probability that a sensed feature of the kind is this one, by area or length ``(N,)``.
        measures: area [m2] or length [m] of the candidate, 1 for vertices ``(N,)``.
        tolerance_scale: sd of each perturbation row for a unit sd of the made surface ``(N, size)`` [1, 1/m].
        radii: of a sphere about the frame's origin that holds the feature ``(N,)`` [m].
        spans: a bound on the distance of two of its points ``(N,)`` [m].
        widths: a bound on the least width of a plane ``(N,)`` [m]; infinite for edges and vertices.
        points: its extreme points ``(sum, 3)`` [m].
        starts: where the points of each begin ``(N,)``.
        names: for reports, ``plane 12``.
    """

    Ts_part_feature: Transforms
    directions: FloatArray
    weights: FloatArray
    measures: FloatArray
    tolerance_scale: FloatArray
    radii: FloatArray
    spans: FloatArray
    widths: FloatArray
    points: FloatArray
    starts: IntArray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.weights)


def candidates_of(part: Part) -> dict[str, Candidates]:
    """Those of a part by kind name; no kind of which it has none."""
    candidates = {"plane": _planes(part), "edge": _edges(part), "vertex": _vertices(part)}
    return {k: c for k, c in candidates.items() if len(c)}


def _planes(part: Part) -> Candidates:
    planes = part.planes
    starts = planes.boundary_start[:-1]
    spans = np.repeat(np.arange(len(planes)), np.diff(planes.boundary_start))
    away = np.linalg.norm(planes.boundary - planes.centroids[spans], axis=1)
    tilt = 1 / np.maximum(planes.gyration, 1e-9)
    return Candidates(
        planes.Ts_part_feature,
        planes.normals,
        planes.areas / max(part.area, planes.areas.sum()),
        planes.areas,
        np.column_stack([np.ones(len(planes)), tilt[:, 1], tilt[:, 0]]),
        np.maximum.reduceat(away, starts) if len(planes) else np.zeros(0),
        *_plane_sizes(part, spans),
        planes.boundary,
        starts,
        tuple(part.faces[i].name.replace("face", "plane") for i in planes.faces),
    )


def _plane_sizes(part: Part, spans: IntArray) -> tuple[FloatArray, FloatArray]:
    """Diagonal and shorter side of each face's rectangle along its principal axes."""
    planes, starts = part.planes, part.planes.boundary_start[:-1]
    if not len(planes):
        return np.zeros(0), np.zeros(0)
    local = np.einsum("ni,nij->nj", planes.boundary, planes.Ts_part_feature[spans, :3, :2])
    sides = np.maximum.reduceat(local, starts) - np.minimum.reduceat(local, starts)
    return np.linalg.norm(sides, axis=1), sides.min(axis=1)


def _edges(part: Part) -> Candidates:
    edges = part.edges
    n = len(edges)
    Ts = np.concatenate([edges.Ts_part_feature, edges.Ts_part_feature @ EDGE.symmetries[1]])
    lengths = np.tile(edges.lengths, 2)
    tilt = np.sqrt(12.0) / np.maximum(lengths, 1e-9)
    return Candidates(
        Ts,
        Ts[:, :3, 0],
        lengths / max(edges.lengths.sum(), 1e-300),
        lengths,
        np.column_stack([np.ones(2 * n), np.ones(2 * n), tilt, tilt]),
        lengths / 2,
        lengths,
        np.full(2 * n, np.inf),
        np.tile(edges.ends.reshape(-1, 3), (2, 1)),
        np.arange(0, 4 * n, 2),
        tuple(f"edge {i}" for i in range(n)) * 2,
    )


def _vertices(part: Part) -> Candidates:
    n = len(part.corners)
    Ts = np.tile(np.eye(4), (n, 1, 1))
    Ts[:, :3, 3] = part.corners.points
    ones = np.ones(n)
    names = tuple(f"corner {i}" for i in range(n))
    points = part.corners.points
    sizes = (np.zeros(n), np.zeros(n), np.full(n, np.inf))
    return Candidates(
        Ts, np.zeros((n, 3)), ones / max(n, 1), ones, np.ones((n, 3)), *sizes, points, np.arange(n), names
    )
