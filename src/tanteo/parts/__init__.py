"""CAD file -> :class:`Part`: a closed mesh in metres, its planes, straight edges, corners and symmetry."""

from typing import TYPE_CHECKING

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.parts.exact import exact_faces
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

__all__ = [
    "READABLE",
    "Face",
    "ModelEdges",
    "ModelPlanes",
    "ModelVertices",
    "Part",
    "SurfaceKind",
    "SymmetryGroup",
    "exact_faces",
    "mirror_part",
    "read_part",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "exact": "exact_faces",
        "mirror": "mirror_part",
        "part": "Face ModelEdges ModelPlanes ModelVertices Part SurfaceKind SymmetryGroup",
        "reading": "READABLE read_part",
    },
)
