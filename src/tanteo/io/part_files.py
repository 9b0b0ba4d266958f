"""The parts of a record: by file, with the hash of its content, so that a changed part is not taken for the same."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tanteo.catalogue import read_parts
from tanteo.errors import InputError, PartError
from tanteo.inference import PreparedPart
from tanteo.parts import Part


@dataclass(frozen=True, slots=True)
class PartFile:
    """Where a part came from.

    Attributes:
        name: of the part.
        file: it was read from; None for a part that was made otherwise.
        unit: of the file.
        sha256: of the file's bytes, or of the mesh of a part without a file.
    """

    name: str
    file: str | None
    unit: str
    sha256: str


def part_file(part: Part) -> PartFile:
    """Where a part came from, and the hash of what is there now."""
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
    """The parts of a record, in its order.

    Args:
        files: where they came from.
        source: the record's file.
        parts: loaded again, in any order; read from their files if not given.
        folders: files and folders in which the parts are looked for first, whatever their files are called now.

    Raises:
        PartError: one is missing or changed; the message says which.
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
        alike = [place for place, _ in there if place.name == Path(file.file).name]
        if alike:
            raise _changed(file, source, str(alike[0]))
        raise PartError(
            f"{source}: expected the part '{file.name}' in {file.file}, got nothing there. Say where it is now "
            "(--parts)."
        )
    return replace(read_one(same[0], file.unit), name=file.name)


def read_one(path: str | Path, unit: str | None) -> Part:
    """The part of one file, read as many are: what a CAD kernel does to its process is not done to this one.

    Raises:
        PartError: The file cannot be read.
        UnitError: No unit where one is needed.
    """
    read = read_parts([path], unit=unit)
    if not read.parts:
        raise PartError(read.failures[0].reason)
    return read.parts[0]


def _changed(file: PartFile, source: str, now: str) -> InputError:
    return PartError(
        f"{source}: expected the part '{file.name}' as it was (sha256 {file.sha256[:12]}...), got another content in "
        f"{now}. Take the file that the session was made with."
    )


def _inside(folders: Sequence[str | Path]) -> list[Path]:
    """The files that are meant, those in folders in alphabetical order."""
    given = [Path(folder) for folder in folders]
    return [file for one in given for file in (sorted(one.iterdir()) if one.is_dir() else [one])]


def _bytes(path: Path) -> bytes | None:
    try:
        return path.read_bytes() if path.is_file() else None
    except (OSError, ValueError):
        return None
