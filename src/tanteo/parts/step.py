"""STEP files -> a closed mesh whose triangles are sorted into the faces of the B-rep, through OpenCASCADE."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.Standard import Standard_Failure

from tanteo.errors import PartError
from tanteo.parts.brep import brep_faces, diagonal_of, healed, read_shape, solids_of
from tanteo.parts.cuts import wound_alike
from tanteo.parts.planes import face_normals
from tanteo.parts.repair import merge_vertices
from tanteo.parts.surfaces import Kinds, merge_faces, surface_offsets
from tanteo.parts.topology import Draft, edge_counts, volume_and_centroid
from tanteo.typing import FloatArray, IntArray

LINEAR_DEFLECTION = 3e-4
"""How far the mesh may lie off a curved face, relative to the diagonal of the box."""

ANGULAR_DEFLECTION = 0.25
"""How far neighbouring facets of a curved face may turn [rad]."""

WELDS = (1e-7, 1e-6, 1e-5, 1e-4)
"""Distances below which corners of neighbouring faces are one, tried in turn, relative to the diagonal."""

FLATNESS = 2e-4
"""How thick the mesh of a planar face may be, relative to the diagonal."""

ROUNDNESS = 1e-3
"""How far the mesh of a cylinder, cone, sphere or torus may lie off it, relative to the diagonal."""

_MM = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class _SolidMesh:
    """A closed mesh [mm], the face each triangle belongs to, and the chords of curved edges."""

    vertices: FloatArray
    triangles: IntArray
    owners: IntArray
    kinds: Kinds
    chords: IntArray


def load_step(path: Path, label: str) -> tuple[Draft, str, list[str]]:
    """Read a STEP file.

    Returns:
        The mesh in metres with the faces of the B-rep, the short name of the file's unit, and repairs.

    Raises:
        MissingExtraError: the CAD kernel is not installed.
        PartError: not a STEP file, no solid in it, or a solid that cannot be closed.
    """
    shape, unit = read_shape(path, label)

    try:
        draft, repairs = _draft(shape, label)
    except Standard_Failure as error:
        raise PartError(f"{label}: expected a sound solid, got a failure of the CAD kernel ({error}).") from error
    return draft, unit, repairs


def _draft(shape: Any, label: str) -> tuple[Draft, list[str]]:
    """Mesh every solid of a shape and sort the triangles into the faces of the B-rep."""
    solids, repairs = solids_of(shape, label)
    diagonal = diagonal_of(solids)
    meshes = []
    for solid in solids:
        mesh = _mesh(solid, diagonal)
        if mesh is None:
            mesh = _mesh(healed(solid, diagonal), diagonal)
            repairs.append("Sewed and healed the faces of a solid: they did not join.")
        if mesh is None:
            raise PartError(f"{label}: expected a closed solid, got faces that do not join. Export it again.")
        meshes.append(mesh)
    whole = _joined(meshes)
    if volume_and_centroid(whole.vertices, whole.triangles)[0] < 1e-9 * diagonal**3:
        raise PartError(f"{label}: expected a solid, got one without volume. Export the part again.")
    labels, kinds = merge_faces(whole.vertices, whole.triangles, whole.owners, whole.kinds)
    draft = Draft(whole.vertices * _MM, whole.triangles, labels, kinds, whole.chords)
    _check_flat(draft, diagonal * _MM, label)
    _check_curved(draft, diagonal * _MM, label)
    return draft, repairs


def _check_flat(draft: Draft, diagonal: float, label: str) -> None:
    """Refuse planes whose border is not in them: the file contradicts itself."""
    normals, points = face_normals(draft)[draft.triangle_face], draft.vertices[draft.triangles]
    offsets = np.einsum("tki,ti->tk", points, normals)
    low, high = np.full(len(draft.kinds), np.inf), np.full(len(draft.kinds), -np.inf)
    np.minimum.at(low, draft.triangle_face, offsets.min(axis=1))
    np.maximum.at(high, draft.triangle_face, offsets.max(axis=1))
    planar = np.array([kind == "plane" for kind, _ in draft.kinds])
    worst = float(np.where(planar, high - low, 0.0).max())
    if worst > FLATNESS * diagonal:
        raise PartError(
            f"{label}: expected flat faces where the file says plane, got one whose border leaves it by "
            f"{worst * 1e3:.3g} mm. Export the part again."
        )


def _check_curved(draft: Draft, diagonal: float, label: str) -> None:
    """Refuse cylinders, cones, spheres and tori whose mesh is elsewhere: the file contradicts itself."""
    order = np.argsort(draft.triangle_face, kind="stable")
    starts = np.searchsorted(draft.triangle_face[order], np.arange(len(draft.kinds) + 1))
    for face, (kind, fields) in enumerate(draft.kinds):
        mine = np.unique(draft.triangles[order[starts[face] : starts[face + 1]]])
        worst = float(np.abs(surface_offsets(kind, fields, draft.vertices[mine])).max())
        if worst > ROUNDNESS * diagonal:
            raise PartError(
                f"{label}: expected a {kind} where the file says so, got a face that leaves it by "
                f"{worst * 1e3:.3g} mm. Export the part again."
            )


def _mesh(solid: Any, diagonal: float) -> _SolidMesh | None:
    """Mesh a solid and weld its faces; None where the result is not closed."""
    BRepTools.Clean_s(solid)
    BRepMesh_IncrementalMesh(solid, LINEAR_DEFLECTION * diagonal, False, ANGULAR_DEFLECTION, False)
    faces = brep_faces(solid, diagonal)
    if not faces or not all(len(face.triangles) for face in faces):
        return None
    starts = np.cumsum([0] + [len(face.points) for face in faces])[:-1]
    points = np.concatenate([face.points for face in faces])
    corners = np.concatenate([face.triangles + start for face, start in zip(faces, starts, strict=True)])
    chords = np.concatenate([face.chords + start for face, start in zip(faces, starts, strict=True)])
    owners = np.repeat(np.arange(len(faces)), [len(face.triangles) for face in faces])
    for weld in WELDS:
        vertices, index = merge_vertices(points, weld * diagonal)
        triangles = index[corners]
        kept = ~(triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
        _, ahead, back = edge_counts(triangles[kept])
        if (ahead + back == 2).all():
            kinds = [(face.kind, face.fields) for face in faces]
            return _outward(_SolidMesh(vertices, triangles[kept], owners[kept], kinds, np.sort(index[chords])))
    return None


def _outward(mesh: _SolidMesh) -> _SolidMesh | None:
    """Turn the mesh of a solid outward; None where its sides cannot be discriminated."""
    triangles = wound_alike(mesh.triangles)
    if triangles is None:
        return None
    if volume_and_centroid(mesh.vertices, triangles)[0] < 0.0:
        triangles = triangles[:, ::-1]
    return replace(mesh, triangles=np.ascontiguousarray(triangles))


def _joined(meshes: list[_SolidMesh]) -> _SolidMesh:
    """Put the meshes of several solids side by side."""
    rows = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])[:-1]
    firsts = np.cumsum([0] + [len(mesh.kinds) for mesh in meshes])[:-1]
    return _SolidMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.triangles + row for mesh, row in zip(meshes, rows, strict=True)]),
        np.concatenate([mesh.owners + first for mesh, first in zip(meshes, firsts, strict=True)]),
        [kind for mesh in meshes for kind in mesh.kinds],
        np.concatenate([mesh.chords + row for mesh, row in zip(meshes, rows, strict=True)]),
    )
