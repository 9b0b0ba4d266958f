"""Pieces of one surface that a CAD system split -> one face."""

from __future__ import annotations

from typing import Any

import numpy as np

from tanteo.parts.part import SurfaceKind
from tanteo.parts.topology import components, mesh_edges, triangle_geometry
from tanteo.typing import FloatArray, IntArray

Kinds = list[tuple[SurfaceKind, dict[str, Any]]]

ANGLE = 1e-5
"""Directions closer than this are one [rad]."""

LENGTH = 1e-6
"""Positions and radii closer than this are one, relative to the diagonal."""


def merge_faces(
    vertices: FloatArray, triangles: IntArray, owners: IntArray, kinds: Kinds
) -> tuple[IntArray, tuple[tuple[SurfaceKind, dict[str, Any]], ...]]:
    """Join faces that touch and lie on the same plane, cylinder, cone, sphere or torus.

    Args:
        vertices: ``(V, 3)`` [mm].
        triangles: ``(T, 3)``, closed, outward.
        owners: ``(T,)``, index into ``kinds``.
        kinds: of the faces, as the file has them, with fields in metres.

    Returns:
        New owners and kinds, numbered by first appearance.
    """
    edges = mesh_edges(triangles)
    pairs = np.sort(np.stack([owners[edges.left], owners[edges.right]], axis=1), axis=1)
    pairs = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    normals, areas = triangle_geometry(vertices, triangles)
    count = len(kinds)
    weighted = normals * areas[:, None]
    summed = np.stack([np.bincount(owners, weighted[:, k], count) for k in range(3)], axis=1)
    unit = summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300)
    first = vertices[triangles[np.unique(owners, return_index=True)[1], 0]]
    anchors = np.zeros((count, 3))
    anchors[np.unique(owners)] = first
    same = [
        _same_plane(unit[a], unit[b], anchors[a], anchors[b], diagonal)
        if kinds[a][0] == kinds[b][0] == "plane"
        else _same_curved(kinds[a], kinds[b], diagonal * 1e-3)
        for a, b in pairs
    ]
    joined = pairs[np.array(same, dtype=np.bool_)]
    labels = components(count, joined[:, 0], joined[:, 1])[owners]
    _, lowest, new = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.empty(len(lowest), dtype=np.int64)
    rank[np.argsort(lowest)] = np.arange(len(lowest))
    kept = tuple(kinds[owners[index]] for index in np.sort(lowest))
    return rank[new.reshape(-1)], kept


def _same_plane(n1: FloatArray, n2: FloatArray, p1: FloatArray, p2: FloatArray, diagonal: float) -> bool:
    aligned = float(np.linalg.norm(n1 - n2)) < 10.0 * ANGLE
    return aligned and abs(float((p2 - p1) @ (n1 + n2))) / 2.0 < 10.0 * LENGTH * diagonal


def _same_curved(
    first: tuple[SurfaceKind, dict[str, Any]], second: tuple[SurfaceKind, dict[str, Any]], diagonal: float
) -> bool:
    (kind, a), (other, b) = first, second
    if kind != other or kind in ("plane", "freeform") or a["convex"] != b["convex"]:
        return False
    near = LENGTH * diagonal * 10.0
    for name in ("radius", "minor_radius"):
        if name in a and abs(a[name] - b[name]) > near:
            return False
    if "half_angle" in a and abs(a["half_angle"] - b["half_angle"]) > ANGLE:
        return False
    apart = b["axis_point"] - a["axis_point"]
    if "axis_direction" not in a:
        return bool(np.linalg.norm(apart) < near)
    axis = a["axis_direction"]
    if np.linalg.norm(np.cross(axis, b["axis_direction"])) > ANGLE:
        return False
    if kind == "cylinder":
        return bool(np.linalg.norm(np.cross(apart, axis)) < near)
    return bool(np.linalg.norm(apart) < near)
