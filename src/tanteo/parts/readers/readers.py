"""Register readers of CAD files by suffix: the built-in ones, and those of plug-ins."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy.typing as npt

from tanteo.errors import MissingExtraError, PluginError, install_command
from tanteo.plugins import Registry, guarded

if TYPE_CHECKING:
    from tanteo.parts.readers.topology import Draft


@dataclass(frozen=True, slots=True, eq=False)
class CadMesh:
    """Triangle mesh as listed in a file or by the caller.

    Attributes:
        vertices: vertices ``(V, 3)`` in ``unit``.
        triangles: vertex indices ``(T, 3)``, counter-clockwise seen from outside.
        unit: length unit: ``mm``, ``m``, ``in``, ``um``, ``cm`` or ``ft``; None if the file states none.
        faces: face number of each triangle ``(T,)``; None to find the faces.
        notes: sentences about what the reader excluded.
    """

    vertices: npt.ArrayLike
    triangles: npt.ArrayLike
    unit: str | None = None
    faces: npt.ArrayLike | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class CadFaces:
    """Mesh whose triangles are assigned to faces with exact surfaces, as in STEP files.

    Attributes:
        draft: mesh with its faces in metres.
        unit: short name of the file's length unit.
        notes: sentences about what the reader repaired or excluded.
    """

    draft: Draft
    unit: str
    notes: tuple[str, ...] = ()


CadRead: TypeAlias = Callable[[Path], "CadMesh | CadFaces"]
"""Function that reads a file. It raises :class:`tanteo.errors.PartError` where the file is damaged."""


@dataclass(frozen=True, slots=True)
class CadReader:
    """A reader of CAD files of one suffix.

    Attributes:
        words: description of the format with an article, as ``an STL mesh``.
        read: function that reads a file.
        unitless: whether files of the format state no length unit, so that the user has to.
    """

    words: str
    read: CadRead
    unitless: bool = False


def _mesh(path: Path) -> CadMesh:
    from tanteo.parts.readers.files import read_mesh_file

    return read_mesh_file(path)


def _kernel(path: Path) -> CadFaces:
    """Read STEP or IGES; the faces are those of the file, with their exact surfaces."""
    from tanteo.parts.readers.files import split_body

    try:
        from tanteo.parts.readers.step import load_step
    except ImportError as error:
        raise MissingExtraError(
            f"{path.name}: expected the CAD kernel to read STEP and IGES, got {error}. Run {install_command('step')}."
        ) from error
    whole, body = split_body(path)
    draft, unit, notes = load_step(whole, path.name, body)
    return CadFaces(draft, unit, tuple(notes))


_STEP, _IGES = CadReader("a STEP file", _kernel), CadReader("an IGES file", _kernel)

CAD_READERS: Registry[CadReader] = Registry(
    "tanteo.cad_readers",
    CadReader,
    {
        "step": _STEP,
        "stp": _STEP,
        "igs": _IGES,
        "iges": _IGES,
        "stl": CadReader("an STL mesh", _mesh, unitless=True),
        "obj": CadReader("an OBJ mesh", _mesh, unitless=True),
        "ply": CadReader("a PLY mesh", _mesh, unitless=True),
        "off": CadReader("an OFF mesh", _mesh, unitless=True),
        "glb": CadReader("a GLB scene", _mesh),
        "3mf": CadReader("a 3MF package", _mesh),
    },
)
"""Readers by suffix without dot, in lower case."""


def readable_suffixes() -> tuple[str, ...]:
    """Return the suffixes of all readable CAD files, with dot, in lower case."""
    return tuple(f".{name}" for name in CAD_READERS.names())


def is_unitless(suffix: str) -> bool:
    """Return whether files of a suffix state no length unit; False without a working reader.

    Args:
        suffix: suffix with or without dot.
    """
    try:
        reader = CAD_READERS.find(suffix.lower().removeprefix("."))
    except PluginError:
        return False
    return reader is not None and reader.unitless


def read_cad(suffix: str, reader: CadReader, file: Path) -> CadMesh | CadFaces:
    """Read a file with the reader of its suffix.

    Args:
        suffix: suffix of the file with dot, in lower case.
        reader: reader of the suffix.
        file: path of the file.

    Raises:
        PluginError: a plug-in fails, or returns another type.
    """
    origin = CAD_READERS.origin(suffix.removeprefix("."))
    with guarded(origin, f"{file.name} to be read"):
        found = reader.read(file)
    if origin and not isinstance(found, CadMesh | CadFaces):
        raise PluginError(f"{origin}: expected a CadMesh of {file.name}, got {type(found).__name__}. Repair it.")
    return found
