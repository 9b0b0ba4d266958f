"""Read STEP and IGES files as a mesh whose triangles are assigned to the faces of the B-rep, by OpenCASCADE."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomAbs import GeomAbs_Plane
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopoDS import TopoDS

from tanteo.errors import PartError
from tanteo.parts.faces.mesh_faces import sort_faces
from tanteo.parts.faces.planes import face_normals
from tanteo.parts.faces.surfaces import merge_faces, surface_offsets
from tanteo.parts.readers.bodies import bodies_of, compound, diagonal_of, explore, fused, tessellated
from tanteo.parts.readers.brep import face_mesh
from tanteo.parts.readers.brep_mesh import BrepMesh, joined, meshed, one_surface, surface_mesh
from tanteo.parts.readers.exchange import chosen_body, read_shape
from tanteo.parts.readers.files import third_party_reader
from tanteo.parts.readers.repair import sound_mesh
from tanteo.parts.readers.topology import Draft, mesh_edges, volume_and_centroid

FLATNESS = 2e-4
"""Largest thickness of the mesh of a planar face, relative to the diagonal."""

ROUNDNESS = 1e-3
"""Largest distance of the mesh of a cylinder, cone, sphere or torus from its surface, relative to the diagonal."""

_FUSED = 64
"""Largest number of bodies that the kernel unites, in seconds; more are united as meshes."""

_MM = 1e-3


def load_step(path: Path, label: str, body: str = "") -> tuple[Draft, str, list[str]]:
    """Read a STEP or IGES file.

    Args:
        path: path of the file.
        label: name of the file for messages.
        body: number, from 1, or name of the only body to read; empty for all bodies.

    Returns:
        Mesh in metres with the faces of the B-rep, short name of the file's unit, and repairs.

    Raises:
        PartError: the file is not STEP or IGES, has no face, or has contradictory faces.
    """
    with third_party_reader(path, label):
        shape, unit, notes = read_shape(path, label)
        if body:
            shape = chosen_body(path, body, label)
        draft, repairs = _draft(shape, label)
    return draft, unit, notes + repairs


def _draft(shape: Any, label: str) -> tuple[Draft, list[str]]:
    """Mesh every body of a shape, and assign the triangles to the faces of the B-rep."""
    facets = _facets(shape)
    if facets:
        draft, repairs = _of_triangles(facets, label)
        return draft, [f"The file is a mesh of {len(facets):,} flat faces: its faces were found from them.", *repairs]
    given = tessellated(shape)
    if given and len(given) == len(explore(shape, TopAbs_FACE)):
        draft, repairs = _of_triangles(given, label)
        return draft, ["The file has triangles and no surfaces.", *repairs]
    bodies, sheets, repairs = bodies_of(_exact(shape) if given else shape, label)
    diagonal = diagonal_of([*bodies, *sheets])
    if 1 < len(bodies) <= _FUSED:
        count, bodies = len(bodies), fused(bodies, diagonal)
        if len(bodies) < count:
            repairs.append(f"United {count} bodies that touch or overlap to {len(bodies)}: buried faces are dropped.")
    meshes: list[BrepMesh] = []
    for body in bodies:
        mesh, steps = meshed(body, diagonal, label)
        meshes.append(mesh)
        repairs += [sentence for sentence in steps if sentence not in repairs]
    if sheets:
        mesh, steps = surface_mesh(compound(sheets), diagonal, label)
        meshes.append(mesh)
        repairs += [
            "Its only face encloses nothing." if len(sheets) == 1 else f"Its {len(sheets)} faces enclose nothing.",
            *steps,
        ]
    if given:
        meshes, steps = _beside(meshes, given, label)
        repairs += steps
    whole = joined(meshes)
    closed = not mesh_edges(whole.triangles).rims.any()
    if closed and volume_and_centroid(whole.vertices, whole.triangles)[0] < 1e-9 * diagonal**3:
        raise PartError(f"{label}: expected a solid, got one without volume. Export the part again.")
    if closed and len(meshes) > 1:
        whole, steps = one_surface(whole)
        repairs += steps
    labels, kinds = merge_faces(whole.vertices, whole.triangles, whole.owners, whole.kinds)
    draft = Draft(whole.vertices * _MM, whole.triangles, labels, kinds, whole.chords)
    _check_flat(draft, diagonal * _MM, label)
    _check_curved(draft, diagonal * _MM, label)
    return draft, repairs


_FACETS, _TRIANGULAR = 500, 0.9
"""Smallest number of faces, and of triangles among them, of a file that is a mesh in the form of a B-rep."""


def _facets(shape: Any) -> list[Any]:
    """Return the meshed faces of a shape that is a mesh: very many flat faces, nearly all triangles; none otherwise."""
    faces = [TopoDS.Face(face) for face in explore(shape, TopAbs_FACE)]
    if len(faces) < _FACETS:
        return []
    triangular = sum(len(explore(face, TopAbs_EDGE)) == 3 for face in faces)
    if triangular < _TRIANGULAR * len(faces):
        return []
    if any(BRepAdaptor_Surface(face).GetType() != GeomAbs_Plane for face in faces):
        return []
    BRepMesh_IncrementalMesh(shape, 1e-3 * diagonal_of([shape]), False, 0.5, False)
    return faces


def _exact(shape: Any) -> Any:
    """Return a shape without bodies, shells and faces that have only triangles."""
    every = [
        *explore(shape, TopAbs_SOLID),
        *explore(shape, TopAbs_SHELL, TopAbs_SOLID),
        *explore(shape, TopAbs_FACE, TopAbs_SHELL),
    ]
    return compound([one for one in every if not tessellated(one)])


def _beside(meshes: list[BrepMesh], given: list[Any], label: str) -> tuple[list[BrepMesh], list[str]]:
    """Add tessellated faces to those with surfaces, unless they repeat the same body."""
    draft, steps = _of_triangles(given, label)
    exact = joined(meshes)
    volumes = [volume_and_centroid(exact.vertices * _MM, exact.triangles)[0]]
    volumes.append(volume_and_centroid(draft.vertices, draft.triangles)[0])
    boxes = [np.stack([v.min(axis=0), v.max(axis=0)]) for v in (exact.vertices * _MM, draft.vertices)]
    size = float(np.linalg.norm(boxes[0][1] - boxes[0][0]))
    if np.abs(boxes[0] - boxes[1]).max() < 0.01 * size and abs(volumes[0] - volumes[1]) < 0.02 * size**3:
        return meshes, [f"Excluded {len(given)} faces of triangles: they repeat the body."]
    edges = mesh_edges(draft.triangles)
    curved = np.array([kind != "plane" for kind, _ in draft.kinds])[draft.triangle_face]
    chords = edges.ends[curved[edges.left] | curved[edges.right]]
    more = BrepMesh(draft.vertices / _MM, draft.triangles, draft.triangle_face, list(draft.kinds), chords)
    return [*meshes, more], [f"{len(given)} faces have triangles and no surfaces.", *steps]


def _of_triangles(faces: list[Any], label: str) -> tuple[Draft, list[str]]:
    """Return tessellated faces as those of a mesh file."""
    pieces = [face_mesh(TopoDS.Face(face)) for face in faces]
    starts = np.cumsum([0] + [len(points) for points, _ in pieces])[:-1]
    triangles = np.concatenate([t + start for (_, t), start in zip(pieces, starts, strict=True)])
    points, corners, repairs = sound_mesh(np.concatenate([p for p, _ in pieces]), triangles, label)
    return sort_faces(points * _MM, corners), repairs


def _check_flat(draft: Draft, diagonal: float, label: str) -> None:
    """Refuse planes whose border does not lie in them."""
    normals = face_normals(draft)[draft.triangle_face]
    points = draft.vertices[draft.triangles]
    offsets = np.einsum("tki,ti->tk", points, normals)
    low = np.full(len(draft.kinds), np.inf)
    high = np.full(len(draft.kinds), -np.inf)
    np.minimum.at(low, draft.triangle_face, offsets.min(axis=1))
    np.maximum.at(high, draft.triangle_face, offsets.max(axis=1))
    planar = np.array([kind == "plane" for kind, _ in draft.kinds])
    worst = float(np.where(planar, high - low, 0.0).max())
    if worst > FLATNESS * diagonal:
        raise PartError(
            f"{label}: expected flat faces where the file states a plane, got one whose border leaves it by "
            f"{worst * 1e3:.3g} mm. Export the part again."
        )


def _check_curved(draft: Draft, diagonal: float, label: str) -> None:
    """Refuse cylinders, cones, spheres and tori whose mesh does not lie on them."""
    order = np.argsort(draft.triangle_face, kind="stable")
    starts = np.searchsorted(draft.triangle_face[order], np.arange(len(draft.kinds) + 1))
    for face, (kind, fields) in enumerate(draft.kinds):
        mine = np.unique(draft.triangles[order[starts[face] : starts[face + 1]]])
        worst = float(np.abs(surface_offsets(kind, fields, draft.vertices[mine])).max())
        if worst > ROUNDNESS * diagonal:
            raise PartError(
                f"{label}: expected a {kind} where the file states one, got a face that leaves it by "
                f"{worst * 1e3:.3g} mm. Export the part again."
            )
