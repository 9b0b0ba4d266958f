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
    from OCP.STEPCAFControl import STEPCAFControl_Reader
    from OCP.TCollection import TCollection_ExtendedString
    from OCP.TDocStd import TDocStd_Document
    from OCP.XCAFDoc import XCAFDoc_DocumentTool

    folder = path.resolve().parent
    for name in names:
        file = (folder / name).resolve()
        if not file.is_file() or not file.is_relative_to(folder) or file == path.resolve():
            raise PartError(
                f"{label}: expected the file {name[:80]!r} beside it, which it refers to, got none there. "
                "Put it there, or export the assembly as one file."
            )
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    reader = STEPCAFControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
        raise PartError(
            f"{label}: expected an assembly, got one that the CAD kernel cannot put together. Export it again."
        )
    return XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetOneShape()
