"""Extract bodies from a shape of the CAD kernel: solids, closed shells, and faces that can be sewn to closed shells."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
from OCP.BRepGProp import BRepGProp
from OCP.collections import List_TopoDS_Shape as Shapes
from OCP.GProp import GProp_GProps
from OCP.ShapeFix import ShapeFix_Shape, ShapeFix_Solid
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHAPE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound

from tanteo.errors import PartError


def explore(shape: Any, kind: Any, outside: Any = TopAbs_SHAPE) -> list[Any]:
    """Return the sub-shapes of one kind in a shape.

    Args:
        shape: shape of the CAD kernel.
        kind: kind of the sub-shapes.
        outside: kind of shapes whose contents are excluded.
    """
    found = []
    explorer = TopExp_Explorer(shape, kind, outside)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def bodies_of(shape: Any, label: str) -> tuple[list[Any], list[Any], list[str]]:
    """Return everything in a shape that has a surface, with a note on each change.

    Args:
        shape: shape as read.
        label: name of the file.

    Returns:
        Bodies; the faces that enclose nothing, if there is no body; and sentences about what was sewn or excluded.

    Raises:
        PartError: the shape has no face.
    """
    shells = [TopoDS.Shell(shell) for shell in explore(shape, TopAbs_SHELL, TopAbs_SOLID)]
    closed = [ShapeFix_Solid().SolidFromShell(shell) for shell in shells if BRep_Tool.IsClosed_s(shell)]
    loose = [face for shell in shells if not BRep_Tool.IsClosed_s(shell) for face in explore(shell, TopAbs_FACE)]
    loose += explore(shape, TopAbs_FACE, TopAbs_SHELL)
    sewn, rest = _sewn(loose, diagonal_of([shape])) if len(loose) > 1 else ([], loose)
    bodies = [*explore(shape, TopAbs_SOLID), *closed, *sewn]
    steps = []
    if closed:
        steps.append("Made a solid of a closed shell." if len(closed) == 1 else f"Made solids of {len(closed)} shells.")
    if sewn:
        into = "a closed body" if len(sewn) == 1 else f"{len(sewn)} closed bodies"
        steps.append(f"Sewed {len(loose) - len(rest)} faces to {into}.")
    if bodies and rest:
        steps.append(f"Excluded {_counted(rest)}, which enclose nothing beside the solids.")
    if not bodies and not rest:
        raise PartError(f"{label}: expected a solid, got curves or points only. Export the part as a solid.")
    return bodies, [] if bodies else rest, steps


def _sewn(faces: list[Any], diagonal: float) -> tuple[list[Any], list[Any]]:
    """Return the closed bodies that faces form when sewn, and the remaining faces."""
    whole = _sewing(faces, 1e-5 * diagonal)
    shells = [TopoDS.Shell(shell) for shell in explore(whole, TopAbs_SHELL)]
    closed = [ShapeFix_Solid().SolidFromShell(shell) for shell in shells if BRep_Tool.IsClosed_s(shell)]
    rest = [face for shell in shells if not BRep_Tool.IsClosed_s(shell) for face in explore(shell, TopAbs_FACE)]
    return closed, rest + explore(whole, TopAbs_FACE, TopAbs_SHELL)


def _sewing(faces: Iterable[Any], tolerance: float) -> Any:
    sewing = BRepBuilderAPI_Sewing(tolerance)
    for face in faces:
        sewing.Add(face)
    sewing.Perform()
    return sewing.SewedShape()


def _counted(faces: list[Any]) -> str:
    """Return number and area of faces as text."""
    area = 0.0
    for face in faces:
        measured = GProp_GProps()
        BRepGProp.SurfaceProperties_s(face, measured)
        area += abs(measured.Mass())
    return f"{len(faces)} loose {'face' if len(faces) == 1 else 'faces'} ({area:.3g} mm2)"


def diagonal_of(shapes: Iterable[Any]) -> float:
    """Return the diagonal of the bounding box of shapes [mm].

    Args:
        shapes: shapes of the CAD kernel.
    """
    box = Bnd_Box()
    for shape in shapes:
        BRepBndLib.Add_s(shape, box)
    return 0.0 if box.IsVoid() else float(np.sqrt(box.SquareExtent()))


def compound(shapes: Iterable[Any]) -> Any:
    """Return shapes as one compound.

    Args:
        shapes: shapes of the CAD kernel.
    """
    whole = TopoDS_Compound()
    builder = BRep_Builder()
    builder.MakeCompound(whole)
    for shape in shapes:
        builder.Add(whole, shape)
    return whole


def healed(solid: Any, diagonal: float) -> Any:
    """Return a solid with its faces sewn and repaired by ShapeFix.

    Args:
        solid: solid of the CAD kernel.
        diagonal: diagonal of the part [mm].
    """
    fix = ShapeFix_Shape(_sewing(explore(solid, TopAbs_FACE), 1e-5 * diagonal))
    fix.Perform()
    shells = explore(fix.Shape(), TopAbs_SHELL)
    return ShapeFix_Solid().SolidFromShell(TopoDS.Shell(shells[0])) if len(shells) == 1 else fix.Shape()


def fused(solids: list[Any], diagonal: float) -> list[Any]:
    """Return solids that touch or overlap as one body each, by the kernel's exact union; as given if it fails.

    Args:
        solids: solids of the CAD kernel.
        diagonal: diagonal of the part [mm].
    """
    union = BRepAlgoAPI_Fuse()
    arguments, tools = Shapes(), Shapes()
    arguments.Append(solids[0])
    for one in solids[1:]:
        tools.Append(one)
    union.SetArguments(arguments)
    union.SetTools(tools)
    union.SetFuzzyValue(1e-6 * diagonal)
    union.Build()
    if not union.IsDone() or union.Shape().IsNull():
        return solids
    merged = ShapeUpgrade_UnifySameDomain(union.Shape())
    merged.Build()
    return explore(merged.Shape(), TopAbs_SOLID) or solids


def tessellated(shape: Any) -> list[Any]:
    """Return the faces that have only triangles and no surface, as AP242 allows.

    Args:
        shape: shape of the CAD kernel.
    """
    return [face for face in map(TopoDS.Face, explore(shape, TopAbs_FACE)) if _surfaceless(face)]


def _surfaceless(face: Any) -> bool:
    return BRep_Tool.Surface_s(face) is None and BRep_Tool.Triangulation_s(face, TopLoc_Location()) is not None
