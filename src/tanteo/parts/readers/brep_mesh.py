"""Mesh bodies of the CAD kernel with their faces as one welded mesh, trying several settings until it closes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools

from tanteo.errors import PartError
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.cuts import consistently_wound, cut
from tanteo.parts.faces.gaps import open_edges
from tanteo.parts.faces.sides import united, with_sides
from tanteo.parts.faces.surfaces import Kinds
from tanteo.parts.readers.bodies import healed
from tanteo.parts.readers.brep import BrepFace, brep_faces
from tanteo.parts.readers.repair import merge_vertices
from tanteo.parts.readers.topology import edge_counts, mesh_edges, volume_and_centroid

SETTINGS = ((3e-4, 0.25), (9e-4, 0.5), (1e-4, 0.12), (3e-3, 0.35))
"""Mesher settings, tried in turn because the mesher fails on some faces at some settings: deflection from a curved face
relative to the diagonal, and angle between facets [rad]."""

WELDS = (1e-7, 1e-6, 1e-5, 1e-4)
"""Distances, relative to the diagonal, below which corners of adjacent faces are merged, tried in turn."""


@dataclass(frozen=True, slots=True, eq=False)
class BrepMesh:
    """Mesh of a B-rep with its faces.

    Attributes:
        vertices: vertices ``(V, 3)`` [mm].
        triangles: vertex indices ``(T, 3)``.
        owners: face of each triangle ``(T,)``.
        kinds: surface kind and fields of each face.
        chords: mesh edges on curved edges of the B-rep ``(C, 2)``.
    """

    vertices: FloatArray
    triangles: IntArray
    owners: IntArray
    kinds: Kinds
    chords: IntArray


def meshed(solid: Any, diagonal: float, label: str) -> tuple[BrepMesh, list[str]]:
    """Return the mesh of a solid with notes; a solid that does not close at any setting stays open.

    Args:
        solid: solid of the CAD kernel.
        diagonal: diagonal of the part [mm].
        label: name of the file.

    Raises:
        PartError: none of its faces can be meshed.
    """
    for rung, faces in enumerate(_meshings(solid, diagonal)):
        mesh = _closed(faces, diagonal)
        if mesh is not None:
            return mesh, [f"Meshed a solid at setting {rung + 1} of {len(SETTINGS)}."] if rung else []
    sewn = healed(solid, diagonal)
    for faces in _meshings(sewn, diagonal):
        mesh = _closed(faces, diagonal)
        if mesh is not None:
            return mesh, ["Sewed and healed the faces of a solid: they did not join."]
    mesh, steps = surface_mesh(solid, diagonal, label)
    return mesh, ["The faces of a solid do not join.", *steps]


def surface_mesh(shape: Any, diagonal: float, label: str) -> tuple[BrepMesh, list[str]]:
    """Return the mesh of an open surface with notes; its outside is determined, or it counts on both sides.

    Args:
        shape: shape of the CAD kernel.
        diagonal: diagonal of the part [mm].
        label: name of the file.

    Raises:
        PartError: none of its faces can be meshed.
    """
    every = list(_meshings(shape, diagonal))
    faces = min(every, key=lambda one: sum(not len(face.triangles) for face in one))
    lost = sum(not len(face.triangles) for face in faces)
    faces = [face for face in faces if len(face.triangles)]
    if not faces:
        raise PartError(f"{label}: expected faces, got none that the CAD kernel can mesh. Export the part again.")
    whole = min((_welded(faces, weld * diagonal) for weld in WELDS), key=lambda one: open_edges(one.triangles))
    mesh, steps = _with_sides(_cut(whole))
    if lost:
        steps.insert(0, f"{lost} of {lost + len(faces)} faces could not be meshed: the surface has a gap there.")
    return mesh, steps


def _meshings(shape: Any, diagonal: float) -> Iterator[list[BrepFace]]:
    """Yield the faces of a shape, meshed at one setting after the other."""
    for deflection, angle in SETTINGS:
        BRepTools.Clean_s(shape)
        BRepMesh_IncrementalMesh(shape, deflection * diagonal, False, angle, False)
        yield brep_faces(shape, diagonal)


def _closed(faces: list[BrepFace], diagonal: float) -> BrepMesh | None:
    """Return faces welded to a closed outward mesh; None if they do not close."""
    if not faces or not all(len(face.triangles) for face in faces):
        return None
    touching = None
    for weld in WELDS:
        mesh = _welded(faces, weld * diagonal)
        _, ahead, back = edge_counts(mesh.triangles)
        if (ahead + back == 2).all():
            return _outward(replace(mesh, triangles=consistently_wound(mesh.triangles)))
        if touching is None and ((ahead + back) % 2 == 0).all():
            touching = mesh
    return None if touching is None else _outward(_cut(touching))


def _welded(faces: list[BrepFace], distance: float) -> BrepMesh:
    starts = np.cumsum([0] + [len(face.points) for face in faces])[:-1]
    corners = np.concatenate([face.triangles + start for face, start in zip(faces, starts, strict=True)])
    chords = np.concatenate([face.chords + start for face, start in zip(faces, starts, strict=True)])
    owners = np.repeat(np.arange(len(faces)), [len(face.triangles) for face in faces])
    vertices, index = merge_vertices(np.concatenate([face.points for face in faces]), distance)
    triangles = index[corners]
    kept = ~(triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    kinds = [(face.kind, face.fields) for face in faces]
    return BrepMesh(vertices, triangles[kept], owners[kept], kinds, np.sort(index[chords]))


def _outward(mesh: BrepMesh) -> BrepMesh | None:
    """Return a closed mesh with outward winding; None if its sides are ambiguous."""
    _, ahead, back = edge_counts(mesh.triangles)
    if ((ahead != 1) | (back != 1)).any():
        return None
    turned = volume_and_centroid(mesh.vertices, mesh.triangles)[0] < 0.0
    return replace(mesh, triangles=np.ascontiguousarray(mesh.triangles[:, ::-1] if turned else mesh.triangles))


def _cut(mesh: BrepMesh) -> BrepMesh:
    """Cut a mesh at edges of more than two triangles, which bodies have that touch themselves."""
    points, triangles, parents = cut(mesh.vertices, consistently_wound(mesh.triangles))
    chords = _carried(mesh, points, triangles)
    return BrepMesh(points, triangles, mesh.owners[parents], mesh.kinds, chords)


def _with_sides(mesh: BrepMesh) -> tuple[BrepMesh, list[str]]:
    points, triangles, doubled, steps = with_sides(mesh.vertices, mesh.triangles)
    kinds = [*mesh.kinds]
    if len(doubled):  # a boss from one side is a bore from the other
        kinds += [(kind, {**f, "convex": not f["convex"]} if "convex" in f else f) for kind, f in mesh.kinds]
    owners = np.concatenate([mesh.owners, mesh.owners[doubled] + len(mesh.kinds)])
    return BrepMesh(points, triangles, owners, kinds, _carried(mesh, points, triangles)), steps


def _carried(mesh: BrepMesh, points: FloatArray, triangles: IntArray) -> IntArray:
    """Return the chords of a mesh among the edges of another whose vertices are copies of its own."""
    from scipy.spatial import cKDTree  # slow to import, and seldom needed

    _, origins = cKDTree(mesh.vertices).query(points)
    ends = mesh_edges(triangles).ends
    pairs = np.sort(origins[ends], axis=1)
    count = len(mesh.vertices)
    known = np.isin(pairs[:, 0] * count + pairs[:, 1], mesh.chords[:, 0] * count + mesh.chords[:, 1])
    return ends[known]


def one_surface(mesh: BrepMesh) -> tuple[BrepMesh, list[str]]:
    """Unite the bodies of a closed mesh that overlap or touch, so that only their outer surface remains.

    Args:
        mesh: closed mesh of one or more bodies.

    Returns:
        Mesh, and a sentence if bodies were united.
    """
    points, triangles, parents, steps = united(mesh.vertices, mesh.triangles)
    if not steps:
        return mesh, []
    owners = mesh.owners[parents]
    seen, owners = np.unique(owners, return_inverse=True)
    chords = _carried(mesh, points, triangles)
    return BrepMesh(points, triangles, owners.reshape(-1), [mesh.kinds[k] for k in seen], chords), steps


def joined(meshes: list[BrepMesh]) -> BrepMesh:
    """Return the meshes of several solids as one.

    Args:
        meshes: meshes of the solids.
    """
    rows = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])[:-1]
    firsts = np.cumsum([0] + [len(mesh.kinds) for mesh in meshes])[:-1]
    return BrepMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.triangles + row for mesh, row in zip(meshes, rows, strict=True)]),
        np.concatenate([mesh.owners + first for mesh, first in zip(meshes, firsts, strict=True)]),
        [kind for mesh in meshes for kind in mesh.kinds],
        np.concatenate([mesh.chords + row for mesh, row in zip(meshes, rows, strict=True)]),
    )
