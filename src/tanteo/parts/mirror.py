"""The mirror image of a part, which no motion brings back onto it unless it has a plane of symmetry."""

from __future__ import annotations

import numpy as np

from tanteo.parts.building import build_part
from tanteo.parts.draft import Draft
from tanteo.parts.part import Part


def mirror_part(part: Part, *, name: str | None = None) -> Part:
    """Reflect a part in its own x = 0 plane.

    Args:
        part: any part.
        name: of the mirror image; ``<name>_mirrored`` where left out.

    Returns:
        A part with the same lengths, areas and angles, of the other hand. Face numbers are kept.
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
