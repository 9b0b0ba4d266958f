"""STEP files -> solids of the CAD kernel (OpenCASCADE), which it sews and heals where they do not join [mm]."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import MissingExtraError, PartError, UnitError
from tanteo.parts.units import unit_name


def read_shape(path: Path, label: str) -> tuple[Any, str]:
    """Read the file; OpenCASCADE turns every unit into millimetres."""
    try:
        from OCP.collections import Sequence_TCollection_AsciiString as Names
        from OCP.IFSelect import IFSelect_RetDone
        from OCP.Message import Message, Message_Gravity
        from OCP.STEPControl import STEPControl_Reader
    except ImportError as error:
        raise MissingExtraError(
            f"{label}: expected the CAD kernel to read STEP, got {error}. Run pip install 'tanteo[step]'."
        ) from error
    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)
    with path.open("rb") as stream:
        head = stream.read(4096)
    if b"ISO-10303-21" not in head:
        raise PartError(f"{label}: expected a STEP file, got one without ISO-10303-21 at its start. Check it.")
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise PartError(f"{label}: expected a STEP file, got one that the CAD kernel cannot parse. Export it again.")
    lengths, angles, solid_angles = Names(), Names(), Names()
    reader.FileUnits(lengths, angles, solid_angles)
    reader.TransferRoots()
    if not reader.NbShapes():
        raise PartError(f"{label}: expected a solid, got a STEP file without shapes. Export the part as a solid.")
    try:
        unit = unit_name(lengths.Value(1).ToCString()) if lengths.Length() else "mm"
    except UnitError:
        unit = "mm"
    return reader.OneShape(), unit


def solids_of(shape: Any, label: str) -> tuple[list[Any], list[str]]:
    """Return the solids of a shape; closed shells without a solid become one."""
    from OCP.ShapeFix import ShapeFix_Solid
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
    from OCP.TopoDS import TopoDS

    solids = _explore(shape, TopAbs_SOLID)
    if solids:
        return solids, []
    shells = [TopoDS.Shell(shell) for shell in _explore(shape, TopAbs_SHELL)]
    closed = [ShapeFix_Solid().SolidFromShell(shell) for shell in shells if shell.Closed()]
    if closed:
        return closed, [f"Made solids of {len(closed)} closed shells."]
    faces = len(_explore(shape, TopAbs_FACE))
    got = f"{faces} faces that enclose nothing" if faces else "curves or points only"
    raise PartError(f"{label}: expected a solid, got {got}. Export the part as a solid.")


def _explore(shape: Any, kind: Any) -> list[Any]:
    from OCP.TopExp import TopExp_Explorer

    found = []
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def diagonal_of(solids: list[Any]) -> float:
    """Of the box that holds them [mm]."""
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib

    box = Bnd_Box()
    for solid in solids:
        BRepBndLib.Add_s(solid, box)
    return float(np.sqrt(box.SquareExtent()))


def healed(solid: Any, diagonal: float) -> Any:
    """Sew the faces of a solid together and fix what ShapeFix knows to fix."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
    from OCP.ShapeFix import ShapeFix_Shape, ShapeFix_Solid
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    sewing = BRepBuilderAPI_Sewing(1e-5 * diagonal)
    for face in _explore(solid, TopAbs_FACE):
        sewing.Add(face)
    sewing.Perform()
    fix = ShapeFix_Shape(sewing.SewedShape())
    fix.Perform()
    shells = _explore(fix.Shape(), TopAbs_SHELL)
    return ShapeFix_Solid().SolidFromShell(TopoDS.Shell(shells[0])) if len(shells) == 1 else fix.Shape()
