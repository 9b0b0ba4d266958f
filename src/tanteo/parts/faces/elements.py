"""Define the elements of a part: faces, planes, straight edges and corners as arrays, and its symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms

SurfaceKind: TypeAlias = Literal["plane", "cylinder", "cone", "sphere", "torus", "freeform"]


def freeze_as(value: object, **dtypes: Any) -> None:
    """Replace the named arrays of a frozen value by read-only arrays of given types.

    Args:
        value: frozen data class.
        dtypes: type of each array by name.
    """
    for name, dtype in dtypes.items():
        given = getattr(value, name)
        if given is None:
            continue
        array = np.array(given, dtype=dtype, order="C")
        array.setflags(write=False)
        object.__setattr__(value, name, array)


@dataclass(frozen=True, slots=True, eq=False)
class Face:
    """Face of a part: a plane, a simple curved surface, or a free form.

    Attributes:
        name: name such as ``face 12``; the number is the index in :attr:`Part.faces`.
        surface: kind of the surface.
        area: area of the mesh of this face [m^2].
        centroid: area centroid in the part frame ``(3,)`` [m]; off the surface where it is curved.
        axis_point: point of the axis in the part frame ``(3,)`` [m]: apex of a cone, centre of a sphere or torus; None
            if unknown or meaningless.
        axis_direction: unit direction of the axis ``(3,)``, or outward normal of a plane; None for spheres and free
            forms. The axis of a cone points from the apex into the cone.
        radius: radius of a cylinder or sphere, major radius of a torus [m]; None for other kinds.
        minor_radius: minor radius of a torus [m]; None for other kinds.
        half_angle: half angle of a cone [rad]; None for other kinds.
        convex: True for a boss or an outer rounding, False for a bore or a hollow, None if unknown.
        sagitta: largest distance of the mesh of this face from the true surface [m]; zero for planes.
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
    """Planar faces of a part as arrays.

    Attributes:
        Ts_part_feature: frames ``(M, 4, 4)`` [m]: z is the outward normal, the origin the area centroid, x and y the
            principal axes of the face's area (x the longer one).
        faces: index into :attr:`Part.faces` ``(M,)``.
        areas: areas ``(M,)`` [m^2].
        gyration: standard deviations of the face's area along its x and y ``(M, 2)`` [m].
        boundary: vertices of each face's convex outline in the part frame ``(sum, 3)`` [m], counter-clockwise seen from
            outside; a linear function over a face has its extremes at these points.
        boundary_start: offsets ``(M + 1,)``; the vertices of plane i are ``boundary[start[i]:start[i + 1]]``.
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
        """Outward unit normals in the part frame ``(M, 3)``."""
        return self.Ts_part_feature[:, :3, 2]

    @property
    def centroids(self) -> FloatArray:
        """Area centroids in the part frame ``(M, 3)`` [m]."""
        return self.Ts_part_feature[:, :3, 3]


@dataclass(frozen=True, slots=True, eq=False)
class ModelEdges:
    """Sharp straight edges between two faces of which at least one is planar.

    Attributes:
        Ts_part_feature: frames ``(E, 4, 4)`` [m]: x along the edge, the origin at its midpoint, z the bisector of the
            two outward normals, so that z points out of a convex edge's material and into the gap of a concave one.
        lengths: lengths ``(E,)`` [m].
        ends: end points in the part frame ``(E, 2, 3)`` [m]; x runs from the first to the second.
        faces: indices of the **left, right** face in :attr:`Part.faces` ``(E, 2)``. Seen from outside with x pointing
            forward, the first face lies to the left (towards +y) and the second to the right (towards -y). The face
            with the lower index is always the left one, which fixes the direction of x.
        dihedrals: interior angles of the material in (0, 2 pi) ``(E,)`` [rad].
        convex: mask of edges with an interior angle below pi ``(E,)``.
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
        """Unit directions in the part frame ``(E, 3)``."""
        return self.Ts_part_feature[:, :3, 0]

    @property
    def midpoints(self) -> FloatArray:
        """Midpoints in the part frame ``(E, 3)`` [m]."""
        return self.Ts_part_feature[:, :3, 3]


@dataclass(frozen=True, slots=True, eq=False)
class ModelVertices:
    """Corners of a part: points where straight edges of three or more different directions end.

    Attributes:
        points: positions in the part frame ``(C, 3)`` [m].
        edges: indices into :class:`ModelEdges` of the edges that end at each corner ``(sum,)``.
        edges_start: offsets ``(C + 1,)``; the edges of corner i are ``edges[start[i]:start[i + 1]]``.
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
    """Rotations that map a part onto itself, without reflections.

    Attributes:
        Ts: rigid motions of the part frame ``(K, 4, 4)`` [m], the identity first. For a solid of revolution only
            representatives modulo the rotation about the axis: the identity and, if valid, a flip. For a ball only the
            identity.
        axis: point [m] and unit direction of the axis of a solid of revolution, part frame; None for other parts.
        spherical: whether every rotation about the centroid maps the part onto itself.
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
        """Number of motions in :attr:`Ts`; for a solid of revolution modulo its axis."""
        return len(self.Ts)

    @property
    def continuous(self) -> bool:
        """Whether rotations by every angle about some axis map the part onto itself."""
        return self.spherical or self.axis is not None
