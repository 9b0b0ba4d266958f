"""Define a part: a mesh in metres with its faces, planes, straight edges, corners and symmetry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.elements import Face, ModelEdges, ModelPlanes, ModelVertices, SymmetryGroup, freeze_as


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Part:
    """Part read from a CAD file, in metres, in the file's own frame.

    Attributes:
        name: name, unique within one call of ``read_parts``; the file's stem where possible.
        source: path as given.
        unit: length unit in which the file was read (``mm``, ``m``, ``in``, ...).
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``, counter-clockwise seen from outside. The mesh is usually closed. An open
            surface ends at rims; where its outside is unknown, its triangles occur twice with opposite winding.
        triangle_face: index into :attr:`faces` of each triangle ``(T,)``.
        faces: all faces, planar and curved.
        planes: planar faces as arrays.
        edges: sharp straight edges as arrays.
        corners: corners as arrays.
        symmetry: rotations that map the part onto itself.
        volume: volume of the mesh [m^3]; 0 for an open surface.
        area: area of the mesh [m^2].
        centroid: centre of volume ``(3,)`` [m]; centre of area for an open surface.
        box: lowest and highest coordinates ``(2, 3)`` [m].
        radius: radius of the sphere about :attr:`centroid` that contains every vertex [m].
        repairs: one sentence for each repair made when reading.
        derived: cache of data computed from the part alone, by name; not part of its value.

    Example:
        >>> part = tanteo.read_part("parts/block.step")
        >>> part.name, len(part.faces) > 5, 0.01 < part.radius < 1
        ('block', True, True)
    """

    name: str
    source: str
    unit: str
    vertices: FloatArray
    triangles: IntArray
    triangle_face: IntArray
    faces: tuple[Face, ...]
    planes: ModelPlanes
    edges: ModelEdges
    corners: ModelVertices
    symmetry: SymmetryGroup
    volume: float
    area: float
    centroid: FloatArray
    box: FloatArray
    radius: float
    repairs: tuple[str, ...] = ()
    derived: dict[str, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def opened(cls, load: Callable[[str], Any], **known: Any) -> Part:
        """Return a part with some known attributes; each of the others is loaded at first use.

        Args:
            load: function that returns an attribute by name, with read-only arrays.
            known: known attributes by name.
        """
        part = object.__new__(cls)
        for name, value in {**known, "derived": {"load": load}}.items():
            object.__setattr__(part, name, value)
        return part

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            if name not in self.__slots__ or name == "derived" or "load" not in self.derived:
                raise AttributeError(f"'Part' object has no attribute {name!r}")
            value = self.derived["load"](name)
            object.__setattr__(self, name, value)
            return value

    def __getstate__(self) -> list[Any]:
        """Return the state for copies and other processes, without derived data, which can be computed again."""
        return [{} if f.name == "derived" else getattr(self, f.name) for f in fields(self)]

    def __post_init__(self) -> None:
        freeze_as(self, vertices=np.float64, triangles=np.int64, triangle_face=np.int64)
        freeze_as(self, centroid=np.float64, box=np.float64)

    @property
    def closed(self) -> bool:
        """Whether the mesh is closed, so that it has an inside."""
        return self.volume > 0.0

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of :attr:`box` [m]."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    def summary(self) -> dict[str, str]:
        """Return the size of the part and the numbers of its features, as text by heading."""
        return {
            "size mm": " x ".join(f"{1e3 * side:.4g}" for side in self.box[1] - self.box[0]),
            "planes": str(len(self.planes)),
            "curved faces": str(len(self.faces) - len(self.planes)),
            "edges": str(len(self.edges)),
            "corners": str(len(self.corners)),
            "equal poses": str(self.symmetry.order),
            "repairs": " ".join(self.repairs),
        }

    def __repr__(self) -> str:
        size = " x ".join(f"{1e3 * side:.4g}" for side in self.box[1] - self.box[0])
        counts = f"{len(self.planes)} planes, {len(self.edges)} edges, {len(self.corners)} corners"
        return f"Part({self.name!r}, {size} mm, {counts}, {len(self.faces) - len(self.planes)} curved faces)"

    def _repr_html_(self) -> str:
        from tanteo.parts.picture import part_html

        return part_html(self)
