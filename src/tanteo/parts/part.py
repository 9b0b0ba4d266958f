"""What a CAD file becomes: a mesh in metres with its faces, planes, straight edges and corners."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms

SurfaceKind: TypeAlias = Literal["plane", "cylinder", "cone", "sphere", "torus", "freeform"]


def _freeze(value: object, **dtypes: Any) -> None:
    """Copy the named arrays of a frozen value to read-only arrays of the given type."""
    for name, dtype in dtypes.items():
        given = getattr(value, name)
        if given is None:
            continue
        array = np.array(given, dtype=dtype, order="C")
        array.setflags(write=False)
        object.__setattr__(value, name, array)


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """One face of the part: a plane, a simple curved surface, or anything else (``freeform``).

    Attributes:
        name: ``face 12``; the number is the index in :attr:`Part.faces`.
        surface: the kind of surface.
        area: of the mesh of this face [m^2].
        centroid: ``(3,)``, area centroid in the part frame [m]; off the surface where it is curved.
        axis_point: ``(3,)``, a point of the axis in the part frame (the apex of a cone, the centre of a sphere
            or torus) [m]; None where it is not known or has no meaning.
        axis_direction: ``(3,)``, unit direction of the axis (the outward normal of a plane); None for spheres and
            free forms. The axis of a cone points from the apex into the cone.
        radius: of a cylinder or sphere, major radius of a torus [m]; None elsewhere.
        minor_radius: of a torus [m]; None elsewhere.
        half_angle: of a cone [rad]; None elsewhere.
        convex: True for a boss or an outer rounding, False for a bore or a hollow, None where it is not known.
        sagitta: how far the mesh of this face may lie off the true surface [m]; zero for planes.
    """

    name: str
    surface: SurfaceKind
    area: float
    centroid: FloatArray
    axis_point: FloatArray | None = None
    axis_direction: FloatArray | None = None
    radius: float | None = None
    minor_radius: float | None = None
    half_angle: float | None = None
    convex: bool | None = None
    sagitta: float = 0.0

    def __post_init__(self) -> None:
        _freeze(self, centroid=np.float64, axis_point=np.float64, axis_direction=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class ModelPlanes:
    """The M planar faces, as arrays.

    Attributes:
        Ts_part_feature: ``(M, 4, 4)``: z is the outward normal, the origin the area centroid, x and y the
            principal axes of the face's area (x the longer one) [m].
        faces: ``(M,)``, index into :attr:`Part.faces`.
        areas: ``(M,)`` [m^2].
        gyration: ``(M, 2)``, standard deviation of the face's area along its x and y [m].
        boundary: ``(sum, 3)``, corners of each face's outer hull in the part frame, counter-clockwise seen from
            outside [m]. A linear function over a face has its extremes at these points.
        boundary_start: ``(M + 1,)``, the corners of plane i are ``boundary[start[i]:start[i + 1]]``.
    """

    Ts_part_feature: Transforms
    faces: IntArray
    areas: FloatArray
    gyration: FloatArray
    boundary: FloatArray
    boundary_start: IntArray

    def __post_init__(self) -> None:
        _freeze(self, Ts_part_feature=np.float64, areas=np.float64, gyration=np.float64, boundary=np.float64)
        _freeze(self, faces=np.int64, boundary_start=np.int64)

    def __len__(self) -> int:
        return len(self.faces)

    @property
    def normals(self) -> FloatArray:
        """``(M, 3)``: outward unit normals in the part frame."""
        return self.Ts_part_feature[:, :3, 2]

    @property
    def centroids(self) -> FloatArray:
        """``(M, 3)``: area centroids in the part frame [m]."""
        return self.Ts_part_feature[:, :3, 3]


@dataclass(frozen=True, slots=True, eq=False)
class ModelEdges:
    """The E sharp straight edges between two faces of which at least one is planar.

    Attributes:
        Ts_part_feature: ``(E, 4, 4)``: x along the edge, the origin at its midpoint, z the bisector of the two
            outward normals, so that z points out of a convex edge's material and into the gap of a concave one [m].
        lengths: ``(E,)`` [m].
        ends: ``(E, 2, 3)``, in the part frame, x runs from the first to the second [m].
        faces: ``(E, 2)``, index into :attr:`Part.faces`: **left, right**. Seen from outside with x pointing
            forward, the first face lies to the left (towards +y) and the second to the right (towards -y). The
            face with the lower index is always the left one, which fixes the direction of x.
        dihedrals: ``(E,)``, interior angle of the material in (0, 2 pi) [rad].
        convex: ``(E,)``, True where the interior angle is below pi.
    """

    Ts_part_feature: Transforms
    lengths: FloatArray
    ends: FloatArray
    faces: IntArray
    dihedrals: FloatArray
    convex: BoolArray

    def __post_init__(self) -> None:
        _freeze(self, Ts_part_feature=np.float64, lengths=np.float64, ends=np.float64, dihedrals=np.float64)
        _freeze(self, faces=np.int64, convex=np.bool_)

    def __len__(self) -> int:
        return len(self.lengths)

    @property
    def directions(self) -> FloatArray:
        """``(E, 3)``: unit directions in the part frame."""
        return self.Ts_part_feature[:, :3, 0]

    @property
    def midpoints(self) -> FloatArray:
        """``(E, 3)``: midpoints in the part frame [m]."""
        return self.Ts_part_feature[:, :3, 3]


@dataclass(frozen=True, slots=True, eq=False)
class ModelVertices:
    """The C corners: points where three or more straight edges end that have three different directions.

    Attributes:
        points: ``(C, 3)``, in the part frame [m].
        edges: ``(sum,)``, the straight edges that end at each corner, index into :class:`ModelEdges`.
        edges_start: ``(C + 1,)``, the edges of corner i are ``edges[start[i]:start[i + 1]]``.
    """

    points: FloatArray
    edges: IntArray
    edges_start: IntArray

    def __post_init__(self) -> None:
        _freeze(self, points=np.float64, edges=np.int64, edges_start=np.int64)

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, slots=True, eq=False)
class SymmetryGroup:
    """The rotations that map the part onto itself (mirror symmetry is not one of them).

    Attributes:
        Ts: ``(K, 4, 4)``, rigid motions of the part frame, the identity first. For a solid of revolution only
            representatives modulo the rotation about the axis: the identity and, where it holds, a flip. For a
            ball only the identity.
        axis: ``(point, unit direction)`` in the part frame [m] of a solid of revolution; None elsewhere.
        spherical: True where every rotation about the centroid maps the part onto itself.
    """

    Ts: Transforms
    axis: tuple[FloatArray, FloatArray] | None = None
    spherical: bool = False

    def __post_init__(self) -> None:
        _freeze(self, Ts=np.float64)
        if self.axis is not None:
            pair = tuple(np.array(vector, dtype=np.float64) for vector in self.axis)
            for vector in pair:
                vector.setflags(write=False)
            object.__setattr__(self, "axis", pair)

    @property
    def order(self) -> int:
        """How many motions :attr:`Ts` holds; of a solid of revolution modulo its axis."""
        return len(self.Ts)

    @property
    def continuous(self) -> bool:
        """Whether some rotation by every angle maps the part onto itself."""
        return self.spherical or self.axis is not None


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
        _freeze(self, vertices=np.float64, triangles=np.int64, triangle_face=np.int64)
        _freeze(self, centroid=np.float64, box=np.float64)

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
