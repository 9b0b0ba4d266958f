"""CAD file -> :class:`Part`: a mesh in metres, its planes, straight edges, corners and symmetry."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.parts.building import mirror_part
    from tanteo.parts.elements import Face, ModelEdges, ModelPlanes, ModelVertices, SurfaceKind, SymmetryGroup
    from tanteo.parts.facets import FLOAT32
    from tanteo.parts.files import LARGEST_FILE, UNITLESS, check_file, unit_name
    from tanteo.parts.part import Part
    from tanteo.parts.patterns import HolePattern, hole_patterns
    from tanteo.parts.reading import READABLE, StoredParts, as_part, as_parts, part_named, read_part
    from tanteo.parts.rounds import CentredFace, Rim, RoundFeature, centred_faces, round_features
    from tanteo.parts.surfaces import exact_faces
    from tanteo.parts.topology import components, mesh_edges, near_groups

__all__ = [
    "FLOAT32", "LARGEST_FILE", "READABLE", "UNITLESS", "CentredFace", "Face", "HolePattern", "ModelEdges",
    "ModelPlanes", "ModelVertices", "Part", "Rim", "RoundFeature", "StoredParts", "SurfaceKind", "SymmetryGroup",
    "as_part", "as_parts", "centred_faces", "check_file", "components", "exact_faces", "hole_patterns",
    "mesh_edges", "mirror_part", "near_groups", "part_named", "read_part", "round_features", "unit_name",
]  # fmt: skip

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "building": "mirror_part",
        "facets": "FLOAT32",
        "files": "LARGEST_FILE UNITLESS check_file unit_name",
        "elements": "Face ModelEdges ModelPlanes ModelVertices SurfaceKind SymmetryGroup",
        "part": "Part",
        "reading": "READABLE StoredParts as_part as_parts part_named read_part",
        "patterns": "HolePattern hole_patterns",
        "rounds": "CentredFace Rim RoundFeature centred_faces round_features",
        "surfaces": "exact_faces",
        "topology": "components mesh_edges near_groups",
    },
)
