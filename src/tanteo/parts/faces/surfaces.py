"""Compute distances from simple curved surfaces, exact surfaces of a mesh, and merge faces on one surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.parts.faces.elements import Face, SurfaceKind
from tanteo.parts.part import Part
from tanteo.parts.readers.topology import components, mesh_edges, triangle_geometry, unique_rows
from tanteo.parts.shapes.revolved import Profiles, Revolved, revolved


def surface_offsets(kind: SurfaceKind, fields: Mapping[str, Any], points: FloatArray) -> FloatArray:
    """Return signed distances of points from a curved surface, positive away from its axis or centre ``(N,)`` [m].

    Points are on a plane or free form by definition.

    Args:
        kind: kind of the surface.
        fields: fields of :class:`Face` that describe it.
        points: points ``(N, 3)`` [m].
    """
    if kind in ("plane", "freeform"):
        return np.zeros(len(points))
    radial = points - fields["axis_point"]
    if kind == "sphere":
        return np.asarray(np.linalg.norm(radial, axis=1) - fields["radius"])
    along = radial @ fields["axis_direction"]
    across = np.linalg.norm(radial - along[:, None] * fields["axis_direction"], axis=1)
    if kind == "cylinder":
        return np.asarray(across - fields["radius"])
    if kind == "cone":
        return np.asarray(across * np.cos(fields["half_angle"]) - along * np.sin(fields["half_angle"]))
    return np.asarray(np.hypot(across - fields["radius"], along) - fields["minor_radius"])


_PRECISION = 0.1, 1e-6
"""Largest distance of mesh vertices from their surface: in sagittas of the face, plus in diagonals of the part."""


def exact_faces(part: Part, normals: Vectors) -> Revolved | None:
    """Return the cylinders, cones, spheres and tori of a part, for distances more exact than its mesh.

    Args:
        part: part as read; faces whose mesh does not lie on their surface (wrong fit, repaired mesh) are excluded.
        normals: unit normals of its triangles ``(T, 3)``.

    Returns:
        Exact surfaces; None for a part with only planes and free forms.
    """
    known = [(k, _profile(face)) for k, face in enumerate(part.faces)]
    rows = np.full(len(part.faces), -1)
    found = [(k, p) for k, p in known if p is not None]
    if not found:
        return None
    rows[[k for k, _ in found]] = np.arange(len(found))
    table = np.array([p for _, p in found])
    sagittas = np.array([part.faces[k].sagitta for k, _ in found])
    profiles = Profiles(table[:, :3], table[:, 3:6], table[:, 6], table[:, 7], table[:, 8], np.ones(len(found)))
    precision = _PRECISION[0] * sagittas + _PRECISION[1] * part.diagonal
    return revolved(profiles, rows[part.triangle_face], part.vertices[part.triangles], normals, precision)


def _profile(face: Face) -> FloatArray | None:
    """Return point, axis, offset, slope and radius of a face's profile ``(9,)``; None if unknown."""
    shape = {
        "cylinder": (face.radius, 0.0, 0.0),
        "cone": (0.0, face.half_angle, 0.0),
        "sphere": (0.0, 0.0, face.radius),
        "torus": (face.radius, 0.0, face.minor_radius),
    }.get(face.surface)
    axis = np.array([0.0, 0.0, 1.0]) if face.surface == "sphere" else face.axis_direction
    if shape is None or face.axis_point is None or axis is None or any(x is None for x in shape):
        return None
    return np.array([*face.axis_point, *axis, *shape], dtype=np.float64)


Kinds = list[tuple[SurfaceKind, dict[str, Any]]]

ANGLE = 1e-5
"""Angle below which directions are equal [rad]."""

LENGTH = 1e-6
"""Difference below which positions and radii are equal, relative to the diagonal."""


def merge_faces(
    vertices: FloatArray, triangles: IntArray, owners: IntArray, kinds: Kinds
) -> tuple[IntArray, tuple[tuple[SurfaceKind, dict[str, Any]], ...]]:
    """Merge adjacent faces on the same plane, cylinder, cone, sphere or torus.

    Args:
        vertices: vertices ``(V, 3)``.
        triangles: vertex indices ``(T, 3)``.
        owners: face of each triangle ``(T,)``.
        kinds: surface kind and fields of each face.

    Returns:
        New owners and kinds, numbered by first appearance.
    """
    edges = mesh_edges(triangles)
    pairs = np.sort(np.stack([owners[edges.left], owners[edges.right]], axis=1), axis=1)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    pairs = pairs[unique_rows(pairs)[0]]
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
