"""Extract the faces of a meshed B-rep (OpenCASCADE): triangles [mm] with their exact surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from OCP import GeomAbs
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Line
from OCP.GeomLib import GeomLib_IsPlanarSurface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS

from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.elements import SurfaceKind
from tanteo.parts.readers.bodies import explore

_MM = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class BrepFace:
    """Tessellated face.

    Attributes:
        kind: kind of its surface.
        fields: fields of :class:`Face` that describe the surface [m, rad].
        points: nodes of its triangulation ``(N, 3)`` [mm].
        triangles: indices into ``points`` ``(T, 3)``, outward by the orientation of the face.
        chords: indices into ``points`` ``(C, 2)`` of mesh edges on curved edges of the B-rep.
    """

    kind: SurfaceKind
    fields: dict[str, Any]
    points: FloatArray
    triangles: IntArray
    chords: IntArray


def brep_faces(shape: Any, diagonal: float) -> list[BrepFace]:
    """Return the faces of a shape that ``BRepMesh_IncrementalMesh`` has meshed.

    Args:
        shape: meshed shape of the CAD kernel.
        diagonal: diagonal of the part [mm].

    Returns:
        One entry for each face; without triangles where the mesher failed.
    """
    faces = []
    for face in map(TopoDS.Face, explore(shape, TopAbs_FACE)):
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        points, triangles = face_mesh(face)
        if not len(triangles):
            faces.append(BrepFace("freeform", {}, points, triangles, _no_rows(2)))
            continue
        kind, fields = surface_of(face, diagonal)
        faces.append(BrepFace(kind, fields, points, triangles, _chords(face, mesh, location, diagonal)))
    return faces


def face_mesh(face: Any) -> tuple[FloatArray, IntArray]:
    """Return the triangulation of a face, outward by its orientation: points [mm] and triangles; empty if it has none.

    Args:
        face: face of the CAD kernel.
    """
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None or not mesh.NbTriangles():
        return np.zeros((0, 3)), _no_rows(3)
    points = np.array([mesh.Node(i).Coord() for i in range(1, mesh.NbNodes() + 1)])
    if not location.IsIdentity():
        move = location.Transformation()
        rows = np.array([[move.Value(i, k) for k in range(1, 5)] for i in range(1, 4)])
        points = points @ rows[:, :3].T + rows[:, 3]
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64) - 1
    return points, triangles[:, ::-1] if face.Orientation() == TopAbs_REVERSED else triangles


def surface_of(face: Any, diagonal: float) -> tuple[SurfaceKind, dict[str, Any]]:
    """Return the kind of a face's surface, and its axis, radius and angle in metres and radians.

    Surfaces that are flat to a millionth of the part's diagonal are planes, for any type in the file.

    Args:
        face: face of the CAD kernel.
        diagonal: diagonal of the part [mm].
    """
    surface = BRepAdaptor_Surface(face)
    kind = surface.GetType()
    # on a surface with a right-handed frame the natural normal points away from the axis
    away = face.Orientation() != TopAbs_REVERSED
    if kind == GeomAbs.GeomAbs_Plane:
        return "plane", {}
    if kind == GeomAbs.GeomAbs_Cylinder:
        shape = surface.Cylinder()
        fields = {**_axis(shape.Axis()), "radius": shape.Radius() * _MM}
        return "cylinder", {**fields, "convex": away == shape.Direct()}
    if kind == GeomAbs.GeomAbs_Cone:
        shape = surface.Cone()
        angle = shape.SemiAngle()
        fields = _axis(shape.Axis())
        if angle < 0.0:
            fields["axis_direction"] = -fields["axis_direction"]
        apex = shape.Apex()
        fields["axis_point"] = np.array([apex.X(), apex.Y(), apex.Z()]) * _MM
        return "cone", {**fields, "half_angle": abs(angle), "convex": away == shape.Direct()}
    if kind == GeomAbs.GeomAbs_Sphere:
        shape = surface.Sphere()
        centre = shape.Location()
        fields = {"axis_point": np.array([centre.X(), centre.Y(), centre.Z()]) * _MM}
        return "sphere", {**fields, "radius": shape.Radius() * _MM, "convex": away == shape.Direct()}
    if kind == GeomAbs.GeomAbs_Torus:
        shape = surface.Torus()
        radii = {"radius": shape.MajorRadius() * _MM, "minor_radius": shape.MinorRadius() * _MM}
        return "torus", {**_axis(shape.Axis()), **radii, "convex": away == shape.Direct()}
    if GeomLib_IsPlanarSurface(BRep_Tool.Surface_s(face), 1e-6 * diagonal).IsPlanar():
        return "plane", {}
    return "freeform", {}


def _axis(axis: Any) -> dict[str, Any]:
    point = axis.Location()
    direction = axis.Direction()
    return {
        "axis_point": np.array([point.X(), point.Y(), point.Z()]) * _MM,
        "axis_direction": np.array([direction.X(), direction.Y(), direction.Z()]),
    }


def _chords(face: Any, mesh: Any, location: Any, diagonal: float) -> IntArray:
    """Return the mesh edges of a face that lie on curved edges of the B-rep."""
    pairs = []
    for edge in map(TopoDS.Edge, explore(face, TopAbs_EDGE)):
        if BRep_Tool.Degenerated_s(edge) or _straight(edge, diagonal):
            continue
        polygon = BRep_Tool.PolygonOnTriangulation_s(edge, mesh, location)
        if polygon is not None:
            nodes = np.array([polygon.Node(i) for i in range(1, polygon.NbNodes() + 1)], dtype=np.int64) - 1
            pairs.append(np.stack([nodes[:-1], nodes[1:]], axis=1))
    return np.concatenate(pairs) if pairs else _no_rows(2)


def _straight(edge: Any, diagonal: float) -> bool:
    """Return whether an edge is a line by its type or by its points."""
    curve = BRepAdaptor_Curve(edge)
    if curve.GetType() == GeomAbs_Line:
        return True
    first, last = curve.FirstParameter(), curve.LastParameter()
    start, end = (curve.Value(u).Coord() for u in (first, last))
    length = math.dist(start, end)
    if length < 1e-9 * diagonal:
        return False
    ahead = [(b - a) / length for a, b in zip(start, end, strict=True)]
    for k in (4, 1, 2, 3, 5, 6, 7):  # nearly all curved edges leave the chord at its middle
        off = [b - a for a, b in zip(start, curve.Value(first + k / 8 * (last - first)).Coord(), strict=True)]
        along = sum(a * b for a, b in zip(off, ahead, strict=True))
        if math.hypot(*(a - along * b for a, b in zip(off, ahead, strict=True))) >= 1e-6 * diagonal:
            return False
    return True


def _no_rows(width: int) -> IntArray:
    return np.zeros((0, width), dtype=np.int64)
