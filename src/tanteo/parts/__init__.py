"""CAD file -> :class:`Part`: a closed mesh in metres, its planes, straight edges, corners and symmetry."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.parts.exact import exact_faces
    from tanteo.parts.facets import FLOAT32
    from tanteo.parts.files import UNITLESS
    from tanteo.parts.mirror import mirror_part
    from tanteo.parts.part import (
        Face,
        ModelEdges,
        ModelPlanes,
        ModelVertices,
        Part,
        SurfaceKind,
        SymmetryGroup,
    )
    from tanteo.parts.reading import READABLE, read_part
    from tanteo.parts.several import as_part, as_parts
    from tanteo.parts.topology import components, mesh_edges
    from tanteo.parts.units import unit_name

__all__ = [
    "FLOAT32",
    "READABLE",
    "UNITLESS",
    "Face",
    "ModelEdges",
    "ModelPlanes",
    "ModelVertices",
    "Part",
    "SurfaceKind",
    "SymmetryGroup",
    "as_part",
    "as_parts",
    "components",
    "exact_faces",
    "mesh_edges",
    "mirror_part",
    "read_part",
    "unit_name",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "topology": "components mesh_edges",
        "units": "unit_name",
        "files": "UNITLESS",
        "facets": "FLOAT32",
        "several": "as_part as_parts",
        "exact": "exact_faces",
        "mirror": "mirror_part",
        "part": "Face ModelEdges ModelPlanes ModelVertices Part SurfaceKind SymmetryGroup",
        "reading": "READABLE read_part",
    },
)
