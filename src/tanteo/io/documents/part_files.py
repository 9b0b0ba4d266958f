"""Identify the parts of a session record by file and content hash, so that a changed part is detected."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tanteo.catalogue import read_parts
from tanteo.errors import InputError, PartError
from tanteo.parts import Part
from tanteo.parts.readers import split_body
from tanteo.posterior import PreparedPart


@dataclass(frozen=True, slots=True)
class PartFile:
    """Origin of a part.

    Attributes:
        name: name of the part.
        file: path of the file; None for a part that was not read from a file.
        unit: length unit of the file.
        sha256: SHA-256 hash of the file's bytes, or of the mesh of a part without a file.
    """

    name: str
    file: str | None
    unit: str
    sha256: str


def part_file(part: Part) -> PartFile:
    """Return the origin of a part, with the hash of the file's present content.

    Args:
        part: the part.
    """
    content = _bytes(Path(part.source))
    if content is not None:
        return PartFile(part.name, part.source, part.unit, hashlib.sha256(content).hexdigest())
    mesh = hashlib.sha256()
    for array in (part.vertices, part.triangles, part.triangle_face):
        mesh.update(array.tobytes())
    return PartFile(part.name, None, part.unit, mesh.hexdigest())


def parts_of(
    files: Sequence[PartFile],
    source: str,
    parts: Sequence[Part | PreparedPart] | None = None,
    folders: Sequence[str | Path] = (),
) -> tuple[Part | PreparedPart, ...]:
    """Return the parts of a record, in the record's order.

    Args:
        files: origins stored in the record.
        source: path of the record's file.
        parts: parts that are already loaded, in any order; None to read them from their files.
        folders: files and folders that are searched first, by content, so that renamed files are found.

    Raises:
        PartError: a part is missing or has changed; the message names it.
    """
    if parts is None:
        return tuple(_read(file, source, folders) for file in files)
    given = {(part.part if isinstance(part, PreparedPart) else part).name: part for part in parts}
    missing = [file.name for file in files if file.name not in given]
    if missing:
        raise PartError(f"{source}: expected a part '{missing[0]}', got {', '.join(given) or 'none'}. Load it too.")
    for file in files:
        part = given[file.name]
        now = part_file(part.part if isinstance(part, PreparedPart) else part)
        if now.sha256 != file.sha256:
            raise _changed(file, source, now.file or "the part that was given")
    return tuple(given[file.name] for file in files)


def _read(file: PartFile, source: str, folders: Sequence[str | Path]) -> Part:
    if file.file is None:
        raise PartError(f"{source}: expected the part '{file.name}' from the caller, as it has no file. Pass it.")
    beside = Path(source).parent / Path(file.file).name
    places = [*_inside(folders), Path(file.file), beside]
    there = [(place, content) for place in places if (content := _bytes(place)) is not None]
    same = [place for place, content in there if hashlib.sha256(content).hexdigest() == file.sha256]
    if not same:
        same_name = [place for place, _ in there if place.name == Path(file.file).name]
        if same_name:
            raise _changed(file, source, str(same_name[0]))
        raise PartError(
            f"{source}: expected the part '{file.name}' in {file.file}, got nothing there. State its new location "
            "(--parts)."
        )
    return replace(read_one(same[0], file.unit), name=file.name)


def read_one(path: str | Path, unit: str | None) -> Part:
    """Return the part in one file, read in a separate process so that a crash of the CAD kernel cannot end this one.

    Args:
        path: CAD or mesh file.
        unit: length unit; None if the file states it.

    Raises:
        PartError: the file cannot be read.
        UnitError: the format needs a unit and none is given.
    """
    read = read_parts([path], unit=unit)
    if not read.parts:
        raise PartError(read.failures[0].reason)
    return read.parts[0]


def _changed(file: PartFile, source: str, now: str) -> InputError:
    return PartError(
        f"{source}: expected the part '{file.name}' unchanged (sha256 {file.sha256[:12]}...), got another content in "
        f"{now}. Take the file that the session was made with."
    )


def _inside(folders: Sequence[str | Path]) -> list[Path]:
    """Return files, with folders replaced by their files in alphabetical order."""
    given = [Path(folder) for folder in folders]
    return [file for one in given for file in (sorted(one.iterdir()) if one.is_dir() else [one])]


def _bytes(path: Path) -> bytes | None:
    try:
        whole, _ = split_body(path)
        return whole.read_bytes() if whole.is_file() else None
    except (OSError, ValueError):
        return None
