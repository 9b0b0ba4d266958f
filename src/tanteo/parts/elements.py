"""What a part is made of: faces of any kind, planes, straight edges and corners as arrays, and its symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms

SurfaceKind: TypeAlias = Literal["plane", "cylinder", "cone", "sphere", "torus", "freeform"]


def freeze_as(value: object, **dtypes: Any) -> None:
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
        freeze_as(self, centroid=np.float64, axis_point=np.float64, axis_direction=np.float64)


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
        freeze_as(self, Ts_part_feature=np.float64, areas=np.float64, gyration=np.float64, boundary=np.float64)
        freeze_as(self, faces=np.int64, boundary_start=np.int64)

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
        freeze_as(self, Ts_part_feature=np.float64, lengths=np.float64, ends=np.float64, dihedrals=np.float64)
        freeze_as(self, faces=np.int64, convex=np.bool_)

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
        freeze_as(self, points=np.float64, edges=np.int64, edges_start=np.int64)

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
        freeze_as(self, Ts=np.float64)
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
