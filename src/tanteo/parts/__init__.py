"""Read CAD files as :class:`Part`: a mesh in metres with its planes, straight edges, corners and symmetry."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.parts.building import mirror_part
    from tanteo.parts.elements import Face, ModelEdges, ModelPlanes, ModelVertices, SurfaceKind, SymmetryGroup
    from tanteo.parts.facets import FLOAT32
    from tanteo.parts.files import LARGEST_FILE, METRES, check_file, unit_name
    from tanteo.parts.from_mesh import checked_mesh, part_of_mesh
    from tanteo.parts.named_features import NamedFace, named_class, named_feature
    from tanteo.parts.part import Part
    from tanteo.parts.patterns import HolePattern, hole_patterns
    from tanteo.parts.readers import CAD_READERS, CadMesh, CadReader, is_unitless, readable_suffixes
    from tanteo.parts.reading import StoredParts, as_part, as_parts, part_named, read_part
    from tanteo.parts.rounds import CentredFace, Rim, RoundFeature, centred_faces, round_features
    from tanteo.parts.surfaces import exact_faces
    from tanteo.parts.topology import components, mesh_edges, near_groups

__all__ = [
    "CAD_READERS", "FLOAT32", "LARGEST_FILE", "METRES", "CadMesh", "CadReader", "CentredFace", "Face", "HolePattern",
    "ModelEdges", "ModelPlanes", "ModelVertices", "NamedFace", "Part", "Rim", "RoundFeature", "StoredParts",
    "SurfaceKind", "SymmetryGroup", "as_part", "as_parts", "centred_faces", "check_file", "checked_mesh", "components",
    "exact_faces", "hole_patterns", "is_unitless", "mesh_edges", "mirror_part", "named_class", "named_feature",
    "near_groups", "part_named",
    "part_of_mesh", "read_part", "readable_suffixes", "round_features", "unit_name",
]  # fmt: skip

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "building": "mirror_part",
        "facets": "FLOAT32",
        "files": "LARGEST_FILE METRES check_file unit_name",
        "elements": "Face ModelEdges ModelPlanes ModelVertices SurfaceKind SymmetryGroup",
        "from_mesh": "checked_mesh part_of_mesh",
        "named_features": "NamedFace named_class named_feature",
        "part": "Part",
        "readers": "CAD_READERS CadMesh CadReader is_unitless readable_suffixes",
        "reading": "StoredParts as_part as_parts part_named read_part",
        "patterns": "HolePattern hole_patterns",
        "rounds": "CentredFace Rim RoundFeature centred_faces round_features",
        "surfaces": "exact_faces",
        "topology": "components mesh_edges near_groups",
    },
)
