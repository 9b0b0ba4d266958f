"""What a CAD file becomes: a mesh in metres with its faces, planes, straight edges and corners."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo.parts.elements import Face, ModelEdges, ModelPlanes, ModelVertices, SymmetryGroup, freeze_as
from tanteo.typing import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Part:
    """A part as read from a CAD file: everything in metres, in the file's own frame.

    Attributes:
        name: unique within one call of ``read_parts``; the file's stem where possible.
        source: the path as it was given.
        unit: the unit the file was read in (``mm``, ``m``, ``in``, ...).
        vertices: ``(V, 3)`` [m].
        triangles: ``(T, 3)``, corners counter-clockwise seen from outside. A closed mesh, as a rule; a surface that
            does not close ends at rims, and has its triangles twice, facing both ways, where its outside is not known.
        triangle_face: ``(T,)``, the entry of :attr:`faces` that each triangle belongs to.
        faces: all faces, planar and curved.
        planes: the planar ones as arrays.
        edges: the sharp straight edges as arrays.
        corners: the corners as arrays.
        symmetry: the rotations that map the part onto itself.
        volume: of the mesh [m^3]; 0 of one that does not close.
        area: of the mesh [m^2].
        centroid: ``(3,)``, centre of volume of the mesh [m]; of area where it does not close.
        box: ``(2, 3)``, lowest and highest coordinates [m].
        radius: of the sphere about :attr:`centroid` that holds every vertex [m].
        repairs: one sentence for each thing that was repaired on reading.
        derived: what was computed from the part alone and is kept as long as the part, by name; not part of its value.

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
        """A part of which some attributes are known; each of the others is loaded when it is first used.

        Args:
            load: gives the value of an attribute by its name, arrays read-only.
            known: attributes by name.
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
        """Of what goes to another process or into a copy, what was derived is left out: it can be derived again."""
        return [{} if f.name == "derived" else getattr(self, f.name) for f in fields(self)]

    def __post_init__(self) -> None:
        freeze_as(self, vertices=np.float64, triangles=np.int64, triangle_face=np.int64)
        freeze_as(self, centroid=np.float64, box=np.float64)

    @property
    def closed(self) -> bool:
        """Whether the mesh has an inside; a surface that does not close has none."""
        return self.volume > 0.0

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of :attr:`box` [m]."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    def __repr__(self) -> str:
        size = " x ".join(f"{1e3 * side:.4g}" for side in self.box[1] - self.box[0])
        counts = f"{len(self.planes)} planes, {len(self.edges)} edges, {len(self.corners)} corners"
        return f"Part({self.name!r}, {size} mm, {counts}, {len(self.faces) - len(self.planes)} curved faces)"
