"""Build a :class:`Part` from a mesh whose triangles are assigned to faces, and mirror a part."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.parts.faces.edges import build_edges
from tanteo.parts.faces.elements import SymmetryGroup
from tanteo.parts.faces.planes import build_faces, build_planes
from tanteo.parts.part import Part
from tanteo.parts.readers.topology import Draft, mesh_edges, triangle_geometry, volume_and_centroid
from tanteo.parts.symmetry import find_symmetry


def build_part(draft: Draft, *, name: str, source: str, unit: str, repairs: tuple[str, ...]) -> Part:
    """Return a part with its features, measures and symmetry.

    Args:
        draft: mesh whose triangles are assigned to faces.
        name: name of the part.
        source: path of the file; empty without a file.
        unit: length unit of the file.
        repairs: one sentence for each repair.
    """
    links = draft.edges or mesh_edges(draft.triangles)
    faces = build_faces(draft, links)
    planes = build_planes(draft, faces, links)
    edges, corners = build_edges(draft, faces, links)
    _, areas = triangle_geometry(draft.vertices, draft.triangles)
    volume, centroid = volume_and_centroid(draft.vertices, draft.triangles)
    if links.rims.any():  # an open surface encloses nothing
        volume = 0.0
        centroid = areas @ draft.vertices[draft.triangles].mean(axis=1) / areas.sum()
    box = np.stack([draft.vertices.min(axis=0), draft.vertices.max(axis=0)])
    part = Part(
        name=name,
        source=source,
        unit=unit,
        vertices=draft.vertices,
        triangles=draft.triangles,
        triangle_face=draft.triangle_face,
        faces=faces,
        planes=planes,
        edges=edges,
        corners=corners,
        symmetry=SymmetryGroup(np.eye(4)[None]),
        volume=volume,
        area=float(areas.sum()),
        centroid=centroid,
        box=box,
        radius=float(np.linalg.norm(draft.vertices - centroid, axis=1).max()),
        repairs=repairs,
    )
    return replace(part, symmetry=find_symmetry(part))


def mirror_part(part: Part, *, name: str | None = None) -> Part:
    """Return the mirror image of a part in its own x = 0 plane.

    Args:
        part: any part.
        name: name of the mirror image; None for ``<name>_mirrored``.

    Returns:
        Part with the same lengths, areas and angles, of opposite handedness, with the same face numbers.
    """
    flip = np.array([-1.0, 1.0, 1.0])
    kinds = []
    for face in part.faces:
        fields = {
            "radius": face.radius,
            "minor_radius": face.minor_radius,
            "half_angle": face.half_angle,
            "convex": face.convex,
            "axis_point": None if face.axis_point is None else face.axis_point * flip,
            "axis_direction": None if face.axis_direction is None else face.axis_direction * flip,
        }
        kinds.append((face.surface, fields))
    draft = Draft(part.vertices * flip, part.triangles[:, ::-1], part.triangle_face, tuple(kinds), None)
    title = name or f"{part.name}_mirrored"
    return build_part(draft, name=title, source=part.source, unit=part.unit, repairs=part.repairs)
