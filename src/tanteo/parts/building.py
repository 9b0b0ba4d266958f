"""A closed mesh whose triangles are sorted into faces -> :class:`Part`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.parts.draft import Draft
from tanteo.parts.edges import build_edges
from tanteo.parts.part import Part, SymmetryGroup
from tanteo.parts.planes import build_faces, build_planes
from tanteo.parts.symmetry import find_symmetry
from tanteo.parts.topology import mesh_edges, triangle_geometry, volume_and_centroid


def build_part(draft: Draft, *, name: str, source: str, unit: str, repairs: tuple[str, ...]) -> Part:
    """Take features, measures and symmetry from a closed mesh whose triangles are sorted into faces.

    Args:
        draft: closed, outward mesh in metres.
        name: of the part.
        source: where it came from.
        unit: short name of the unit it was read in.
        repairs: sentences on what was repaired.

    Returns:
        The finished part.
    """
    links = mesh_edges(draft.triangles)
    faces = build_faces(draft, links)
    planes = build_planes(draft, faces, links)
    edges, corners = build_edges(draft, faces, links)
    volume, centroid = volume_and_centroid(draft.vertices, draft.triangles)
    _, areas = triangle_geometry(draft.vertices, draft.triangles)
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
