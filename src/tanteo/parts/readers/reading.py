"""Read one CAD file as a :class:`Part`, and check arguments that are parts."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tanteo.errors import InputError, PartError, UnitError
from tanteo.geometry.typing import FloatArray
from tanteo.parts.part import Part
from tanteo.parts.readers.files import LARGEST_FILE, METRES, check_file, check_size, split_body, unit_name
from tanteo.parts.readers.readers import CAD_READERS, CadFaces, CadReader, read_cad, readable_suffixes

if TYPE_CHECKING:
    from tanteo.parts.readers.topology import Draft


class StoredParts(Sequence[Part]):
    """Sequence of parts that are opened one by one when used, because they may be too many for the memory."""

    @property
    @abstractmethod
    def numbers(self) -> FloatArray:
        """Sizes of all parts without opening them ``(n, 17)``.

        Columns: area, volume, radius, diameter, mean width, centroid, lowest and highest corner of the box, order of
        symmetry, whether the symmetry is continuous, fraction of the surface outside the compared faces.
        """

    @abstractmethod
    def row_of(self, name: str) -> int | None:
        """Return the number of the part with a given name; None if there is none.

        Args:
            name: name of a part.
        """

    @property
    @abstractmethod
    def units(self) -> frozenset[str]:
        """Length units of the files from which the parts were read."""


def part_named(parts: Iterable[Any], name: str) -> Any:
    """Return the part with a given name, or the object prepared from it; None if there is none.

    Args:
        parts: parts, prepared parts, or stored parts.
        name: name of a part.
    """
    if isinstance(parts, StoredParts):
        return parts[row] if (row := parts.row_of(name)) is not None else None
    return next((one for one in parts if getattr(one, "part", one).name == name), None)


def as_parts(name: str, parts: Any) -> Sequence[Any]:
    """Return an argument that contains parts as a tuple of parts or of prepared parts (which have a ``part``).

    Stored parts are returned unopened.

    Args:
        name: name of the argument.
        parts: iterable of parts or prepared parts, ``Parts`` of a catalogue, or a single part.

    Raises:
        InputError: the argument is a path, which must be read first, or has another type.
    """
    if isinstance(parts, StoredParts):
        return parts
    several = parts if isinstance(parts, Iterable) and not isinstance(parts, (str, bytes, os.PathLike)) else (parts,)
    found = tuple(several)
    for one in found:
        if isinstance(one, Part) or hasattr(one, "part"):
            continue
        if isinstance(one, (str, os.PathLike)):
            how = f"got the path '{os.fspath(one)}'. Read it first: tanteo.read_parts('{os.fspath(one)}')."
        else:
            how = f"got one of type {type(one).__name__}. tanteo.read_parts(path) reads them."
        raise InputError(f"{name}: expected parts, {how}")
    return found


def as_part(name: str, part: Any) -> Any:
    """Return an argument that is one part or prepared part, or contains exactly one.

    Args:
        name: name of the argument.
        part: part, prepared part, or iterable with one of them.

    Raises:
        InputError: there are several parts, or none.
    """
    found = as_parts(name, part)
    if len(found) != 1:
        raise InputError(f"{name}: expected one part, got {len(found)}. Use tanteo.identify for several.")
    return found[0]


def read_part(path: str | os.PathLike[str], *, unit: str | None = None, name: str | None = None) -> Part:
    """Read a CAD file as a part: its mesh, faces, straight edges, corners and symmetry.

    Args:
        path: STEP (``.step``, ``.stp``), IGES (``.igs``, ``.iges``) or mesh file (``.stl``, ``.obj``, ``.ply``,
            ``.off``, ``.glb``, ``.3mf``), or a file with a suffix for which a reader is installed (group
            ``tanteo.cad_readers``). ``FILE.step#2`` and ``FILE.step#NAME`` select one body of a STEP file.
        unit: length unit of the coordinates: ``mm``, ``m``, ``in``, ``um``, ``cm`` or ``ft``. It is required for
            formats that carry no unit (STL, OBJ, PLY, OFF). It overrides the unit of other formats, and the part's
            repairs state that.
        name: name of the part; None for the file's stem.

    Returns:
        Part in metres, in the file's own frame. Several bodies in one file make one part with their outer surface. An
        open surface is accepted, and its repairs state that.

    Raises:
        PartError: the file does not contain a surface of plausible size; the message names the fault.
        UnitError: the format carries no unit and none is given, or the unit is unknown.
        MissingExtraError: the file is STEP or IGES, and the extra ``tanteo[step]`` is not installed.
        PluginError: the installed reader of the suffix fails.

    Example:
        >>> part = tanteo.read_part("parts/bracket_left.step")
        >>> part.name
        'bracket_left'
    """
    file = Path(path)
    label = file.name
    if unit is not None:
        unit_name(unit)
    check_file(file, label)
    whole, body = split_body(file)
    suffix = whole.suffix.lower()
    reader = CAD_READERS.find(suffix.removeprefix(".")) if suffix else None
    if reader is None:
        known = ", ".join(readable_suffixes())
        raise PartError(f"{label}: expected one of {known}, got {suffix!r}. Export it as STEP.")
    if body and suffix not in BODY_SUFFIXES:
        raise PartError(f"{label}: expected a STEP file before '#{body}', got {suffix!r}. Drop '#{body}'.")
    _check_content(whole, label)
    if reader.unitless and unit is None:
        raise UnitError(
            f"unit: expected the length unit of {label}, got none, and {suffix[1:].upper()} files carry none. "
            "Pass unit='mm' (or um, cm, m, in, ft)."
        )
    draft, own, repairs, stated = _draft(suffix, reader, file, None if unit is None else unit_name(unit))
    from tanteo.parts.readers.building import build_part  # not needed where a part is remembered
    from tanteo.parts.readers.from_mesh import diagonal_of_points

    check_size(diagonal_of_points(draft.vertices), own, label, stated=stated)
    return build_part(
        draft,
        name=name or (f"{whole.stem}#{body}" if body else whole.stem),
        source=os.fspath(path),
        unit=own,
        repairs=tuple(repairs),
    )


BODY_SUFFIXES = (".step", ".stp")
"""Suffixes of files of which one body may be selected."""


def _draft(suffix: str, reader: CadReader, file: Path, unit: str | None) -> tuple[Draft, str, list[str], bool]:
    """Read a file in its own unit, or in another stated one.

    Returns:
        The mesh in metres with its faces, the unit, sentences about repairs, and whether the file states the unit.

    Raises:
        UnitError: the file states no unit, and none is given.
    """
    from tanteo.parts.readers.from_mesh import checked_mesh, draft_of_mesh  # not needed where a part is remembered
    from tanteo.parts.readers.topology import scaled

    found = read_cad(suffix, reader, file)
    label = file.name
    if isinstance(found, CadFaces):
        used = unit or found.unit
        draft = found.draft if used == found.unit else scaled(found.draft, METRES[used] / METRES[found.unit])
        return draft, used, [*_unit_note(used, found.unit), *found.notes], unit is None
    mesh = checked_mesh(found, label)
    own = mesh.unit or unit
    if own is None:
        raise UnitError(f"unit: expected the length unit of {label}, got none. Pass unit='mm' (or um, cm, m, in, ft).")
    used = unit or own
    stated = unit is None
    notes = (*_unit_note(used, own), *mesh.notes)
    draft, repairs = draft_of_mesh(replace(mesh, unit=used, notes=notes), label, stated=stated)
    return draft, used, repairs, stated


def _unit_note(used: str, own: str) -> tuple[str, ...]:
    return () if used == own else (f"Read in {used} as requested: the file itself states {own}.",)


def _check_content(file: Path, label: str) -> None:
    """Refuse a file that is unreadable, empty or too large."""
    try:
        with file.open("rb") as stream:
            first = stream.read(1)
            size = os.fstat(stream.fileno()).st_size
    except OSError as error:
        why = error.strerror or error
        raise PartError(f"{label}: expected a file that may be read, got: {why}. Check its permissions.") from None
    if not first:
        raise PartError(f"{label}: expected a CAD file, got an empty one. Export the part again.")
    if size > LARGEST_FILE:
        raise PartError(
            f"{label}: expected a file of up to {LARGEST_FILE / 1e9:g} GB, got {size / 1e9:.3g} GB. Simplify the part."
        )
