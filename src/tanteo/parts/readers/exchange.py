"""Read STEP and IGES files as a shape of the CAD kernel (OpenCASCADE) [mm], with unit and notes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from OCP.collections import Sequence_TCollection_AsciiString as Names
from OCP.IFSelect import IFSelect_RetDone
from OCP.Message import Message, Message_Gravity
from OCP.STEPConstruct import STEPConstruct_ExternRefs
from OCP.STEPControl import STEPControl_Reader

from tanteo.errors import PartError, UnitError
from tanteo.parts.readers.files import unit_name

STEP_SUFFIXES = (".step", ".stp")

_IGES_UNITS = {"IN": "in", "INCH": "in", "MM": "mm", "FT": "ft", "M": "m", "CM": "cm", "UM": "um"}


def read_shape(path: Path, label: str) -> tuple[Any, str, list[str]]:
    """Read a STEP or IGES file; the kernel converts all units to millimetres.

    Args:
        path: path of the file.
        label: name of the file for messages.

    Returns:
        Shape, short name of the file's unit, and sentences about what is missing in the shape.

    Raises:
        PartError: the file cannot be parsed, contains no shape, or refers to a missing file.
    """
    for printer in Message.DefaultMessenger_s().Printers():
        printer.SetTraceLevel(Message_Gravity.Message_Fail)
    return _read_step(path, label) if path.suffix.lower() in STEP_SUFFIXES else _read_iges(path, label)


def _read_step(path: Path, label: str) -> tuple[Any, str, list[str]]:
    with path.open("rb") as stream:
        head = stream.read(4096)
    if b"ISO-10303-21" not in head:
        raise PartError(f"{label}: expected a STEP file, got one without ISO-10303-21 at its start. Check it.")
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise PartError(f"{label}: expected a STEP file, got one that the CAD kernel cannot parse. Export it again.")
    lengths = Names()
    angles = Names()
    solid_angles = Names()
    reader.FileUnits(lengths, angles, solid_angles)
    units = {_unit(lengths.Value(k).ToCString()) for k in range(1, lengths.Length() + 1)} or {"mm"}
    notes = _transferred(reader)
    pieces, others = _references(reader)
    if others:
        notes.append(f"The file refers to {', '.join(others[:3])}, which is not read.")
    shape = _assembled(path, pieces, label) if pieces else reader.OneShape() if reader.NbShapes() else None
    if shape is None or shape.IsNull():
        raise PartError(f"{label}: expected a solid, got a STEP file without shapes. Export the part as a solid.")
    if pieces:
        notes.append(f"Read {len(pieces)} files that it refers to: {', '.join(pieces[:5])}.")
    if len(units) > 1:
        notes.append(f"Its shapes are in different units: {', '.join(sorted(units))}.")
    return shape, _unit(lengths.Value(1).ToCString()) if lengths.Length() else "mm", notes


def chosen_body(path: Path, body: str, label: str) -> Any:
    """Return one solid of a STEP file, where the assembly puts it.

    Args:
        path: path of the file.
        body: number of the solid in the order of the file, from 1, or name of its product or its own.
        label: name of the file for messages.

    Raises:
        PartError: the file has no such body, or several; the message lists the bodies.
    """
    found = _named_solids(path, label)
    numbers = {str(k): [solid] for k, (_, solid) in enumerate(found, 1)}
    named: dict[str, list[Any]] = {}
    for name, solid in found:
        named.setdefault(name.casefold(), []).append(solid)
    chosen = named.get(body.casefold()) or numbers.get(body) or []
    if len(chosen) == 1:
        return chosen[0]
    listed = ", ".join(f"#{k} {name}".rstrip() for k, (name, _) in enumerate(found[:_LISTED], 1))
    more = f" and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
    got = f"{len(chosen)} of that name. Use a number" if chosen else "none of that name or number"
    raise PartError(f"{label}: expected one of its {len(found)} bodies ({listed}{more}), got {got}.")


_LISTED = 12
"""Number of bodies that a message lists."""


def _named_solids(path: Path, label: str) -> list[tuple[str, Any]]:
    """Return the solids of a STEP file with the names of their products, in the order of the file."""
    from OCP.collections import Sequence_TDF_Label as Labels
    from OCP.TDF import TDF_Label
    from OCP.TopAbs import TopAbs_SOLID
    from OCP.XCAFDoc import XCAFDoc_ShapeTool

    from tanteo.parts.readers.bodies import explore

    tool, document = _document(path, label)
    solids = list[tuple[str, Any]]()

    def visit(node: Any, place: Any, name: str) -> None:
        if XCAFDoc_ShapeTool.IsReference_s(node):
            referred = TDF_Label()
            XCAFDoc_ShapeTool.GetReferredShape_s(node, referred)
            own = place.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(node))
            return visit(referred, own, _label_name(referred) or _label_name(node) or name)
        if XCAFDoc_ShapeTool.IsAssembly_s(node):
            parts = Labels()
            XCAFDoc_ShapeTool.GetComponents_s(node, parts)
            for k in range(1, parts.Length() + 1):
                visit(parts.Value(k), place, name)
            return None
        shape = XCAFDoc_ShapeTool.GetShape_s(node)
        solids.extend((_label_name(node) or name, solid.Moved(place)) for solid in explore(shape, TopAbs_SOLID))
        return None

    from OCP.TopLoc import TopLoc_Location

    free = Labels()
    tool.GetFreeShapes(free)
    for k in range(1, free.Length() + 1):
        visit(free.Value(k), TopLoc_Location(), "")
    del document
    return solids


def _label_name(node: Any) -> str:
    """Return the name of a label of a document; empty if it has none."""
    from OCP.TDataStd import TDataStd_Name

    name = TDataStd_Name()
    return str(name.Get().ToExtString()) if node.FindAttribute(TDataStd_Name.GetID_s(), name) else ""


def _read_iges(path: Path, label: str) -> tuple[Any, str, list[str]]:
    from OCP.IGESControl import IGESControl_Reader

    reader = IGESControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        raise PartError(f"{label}: expected an IGES file, got one that the CAD kernel cannot parse. Export it as STEP.")
    name = reader.IGESModel().GlobalSection().UnitName()
    notes = _transferred(reader)
    if not reader.NbShapes():
        raise PartError(
            f"{label}: expected faces, got an IGES file without shapes. Export the part as a solid, in STEP."
        )
    return reader.OneShape(), _IGES_UNITS.get(name.ToCString().strip().upper() if name else "", "mm"), notes


def _transferred(reader: Any) -> list[str]:
    """Transfer all shapes of a file, and return a note on those that fail."""
    every = reader.NbRootsForTransfer()
    lost = every - reader.TransferRoots()
    return [f"{lost} of {every} shapes in the file could not be made by the CAD kernel."] if lost > 0 else []


def _unit(text: str) -> str:
    try:
        return unit_name(text)
    except UnitError:
        return "mm"


def _references(reader: Any) -> tuple[list[str], list[str]]:
    """Return the names of STEP files that a STEP file refers to for its shapes, and of other files."""
    found = STEPConstruct_ExternRefs(reader.WS())
    if not found.LoadExternRefs():
        return [], []
    names = dict.fromkeys(str(found.FileName(k) or "") for k in range(1, found.NbExternRefs() + 1))
    pieces = [name for name in names if name.lower().endswith(STEP_SUFFIXES)]
    return pieces, [name for name in names if name and name not in pieces]


def _assembled(path: Path, names: list[str], label: str) -> Any:
    """Return the shape of a STEP file with those that it refers to, which must lie beside it."""
    folder = path.resolve().parent
    for name in names:
        file = (folder / name).resolve()
        if not file.is_file() or not file.is_relative_to(folder) or file == path.resolve():
            raise PartError(
                f"{label}: expected the file {name[:80]!r} beside it, which it refers to, got none there. "
                "Put it there, or export the assembly as one file."
            )
    tool, _ = _document(path, label)
    return tool.GetOneShape()


def _document(path: Path, label: str) -> tuple[Any, Any]:
    """Return the tool for shapes of a STEP file with the structure of its products, and the document that it needs."""
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    reader = STEPCAFControl_Reader()
    reader.SetNameMode(True)
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
        raise PartError(
            f"{label}: expected an assembly, got one that the CAD kernel cannot put together. Export it again."
        )
    return XCAFDoc_DocumentTool.ShapeTool_s(document.Main()), document
