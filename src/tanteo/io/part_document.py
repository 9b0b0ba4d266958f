"""The part document ``tanteo.part/1``: what was read from a CAD file, as strict JSON (``docs/formats.md``)."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from tanteo import __version__

if TYPE_CHECKING:
    from tanteo.parts import Part

SCHEMA = "tanteo.part/1"


def part_document(part: Part) -> dict[str, Any]:
    """The part as plain dictionaries, lists, strings and numbers; metres and radians in the part's own frame."""
    edges, planes = part.edges, part.planes
    return {
        "schema": SCHEMA,
        "version": __version__,
        "part": part.name,
        "file": part.source,
        "unit_of_file": part.unit,
        "box_m": part.box.tolist(),
        "volume_m3": part.volume,
        "area_m2": part.area,
        "centroid_m": part.centroid.tolist(),
        "triangles": len(part.triangles),
        "symmetry": {
            "order": part.symmetry.order,
            "axis": None if part.symmetry.axis is None else [v.tolist() for v in part.symmetry.axis],
            "spherical": part.symmetry.spherical,
            "motions": part.symmetry.Ts.tolist(),
        },
        "planes": [
            {"name": f"face {face}", "area_m2": area, "normal": normal, "centroid_m": centroid}
            for face, area, normal, centroid in zip(
                planes.faces.tolist(),
                planes.areas.tolist(),
                planes.normals.tolist(),
                planes.centroids.tolist(),
                strict=True,
            )
        ],
        "edges": [
            {"name": f"edge {i}", "length_m": length, "ends_m": ends, "interior_angle_rad": angle}
            for i, (length, ends, angle) in enumerate(
                zip(edges.lengths.tolist(), edges.ends.tolist(), edges.dihedrals.tolist(), strict=True)
            )
        ],
        "vertices": [{"name": f"vertex {i}", "point_m": p} for i, p in enumerate(part.corners.points.tolist())],
        "curved_faces": [
            {"name": f.name, "surface": f.surface, "area_m2": f.area, "radius_m": _finite(f.radius), "convex": f.convex}
            for f in part.faces
            if f.surface != "plane"
        ],
        "repairs": list(part.repairs),
    }


def part_json(part: Part) -> str:
    """The part as one JSON document ending in a newline."""
    return json.dumps(part_document(part), indent=2, allow_nan=False) + "\n"


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
