"""Read mesh files as vertices and triangles, and convert length units of files."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

import numpy as np

from tanteo import _core
from tanteo.errors import PartError, TanteoError, UnitError
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.readers.polygons import read_obj, read_off
from tanteo.parts.readers.readers import CadMesh

METRES: dict[str, float] = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""Metres per length unit."""

_SPELLINGS: dict[str, str] = {
    "micron": "um",
    "micrometre": "um",
    "micrometer": "um",
    "millimetre": "mm",
    "millimeter": "mm",
    "centimetre": "cm",
    "centimeter": "cm",
    "metre": "m",
    "meter": "m",
    "inch": "in",
    "inche": "in",
    "foot": "ft",
    "feet": "ft",
}

SMALLEST_DIAGONAL = 5e-4
"""Bounding-box diagonal below which the unit of a part was probably too small [m]."""

LARGEST_FILE = 1_000_000_000
"""Largest file that is read [bytes]."""

LARGEST_DIAGONAL = 50.0
"""Bounding-box diagonal above which the unit of a part was probably too large [m]."""


def unit_name(text: str) -> str:
    """Return the short name of a length unit (``"Millimetres"`` gives ``"mm"``).

    Args:
        text: name of a length unit in any spelling.

    Raises:
        UnitError: the text names no known length unit.
    """
    plain = str(text).strip().lower()
    short = _SPELLINGS.get(plain, _SPELLINGS.get(plain.removesuffix("s"), plain))
    if short not in METRES:
        raise UnitError(f"unit: expected one of {', '.join(METRES)}, got {text!r}. Name the unit of the file.")
    return short


def check_size(diagonal: float, unit: str, label: str, *, stated: bool) -> None:
    """Refuse a part whose size indicates a wrong unit.

    Args:
        diagonal: diagonal of the part's box [m].
        unit: length unit in which it was read.
        label: name of the file for messages.
        stated: whether the file states the unit; otherwise the caller does.

    Raises:
        PartError: the diagonal is outside 0.5 mm to 50 m; the message names the units that would fit.
    """
    if SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
        return
    plausible = [name for name, metres in METRES.items() if 5e-3 <= diagonal / METRES[unit] * metres <= 5.0]
    size = "too large" if diagonal > LARGEST_DIAGONAL else "too small"
    advice = f"Did you mean {' or '.join(f'unit={name!r}' for name in plausible)}?" if plausible else "Check it."
    if stated and plausible:
        advice = f"The unit is the file's own. If it is wrong, pass {' or '.join(f'unit={n!r}' for n in plausible)}."
    raise PartError(
        f"{label}: expected a part of {SMALLEST_DIAGONAL * 1e3:g} mm to {LARGEST_DIAGONAL:g} m, got a diagonal of "
        f"{diagonal:.4g} m in unit {unit!r}, which is {size}. {advice}"
    )


def split_body(path: str | os.PathLike[str]) -> tuple[Path, str]:
    """Return the file of a path, and the body of it that the path selects: ``stack.step#2`` or ``stack.step#Upper``.

    Args:
        path: path of a file, with ``#`` and the number or name of a body where only one is meant.

    Returns:
        File, and number or name of the body; empty for the whole file, also if a file has ``#`` in its own name.
    """
    given = Path(path)
    name, mark, body = given.name.rpartition("#")
    if not mark or not name or not body or given.exists():
        return given, ""
    return given.with_name(name), body


def check_file(file: Path, label: str) -> None:
    """Refuse a path that is not a file: a broken or circular link, a folder, a device, a pipe, or nothing.

    Args:
        file: path to check.
        label: name for messages.

    Raises:
        PartError: the path is not a file.
    """
    file, _ = split_body(file)
    if file.is_file():
        return
    got = "nothing there"
    advice = "Check the path"
    if os.path.exists(file):
        got = "a folder" if file.is_dir() else "a device or a pipe"
        advice = "Name a file"
    elif os.path.islink(file):
        got = "a broken link"
        advice = "Repair it, or name another file"
    raise PartError(f"{label}: expected a file, got {got}. {advice}.")


def read_mesh_file(path: Path) -> CadMesh:
    """Read a mesh file of a built-in format, selected by its suffix.

    Args:
        path: path of the file.

    Raises:
        PartError: the content does not match the suffix, or a vertex index is out of range.
    """
    suffix = path.suffix.lower()
    label = path.name
    if suffix == ".3mf":
        from tanteo.parts.readers.threemf import read_3mf

        vertices, triangles, unit, notes = read_3mf(path, label)
        return CadMesh(vertices, triangles, unit, notes=tuple(notes))
    read = {".off": read_off, ".obj": read_obj, ".stl": _read_stl}.get(suffix, _read_with_trimesh)
    return CadMesh(*read(path, label), unit="m" if suffix == ".glb" else None)


def _read_stl(path: Path, label: str) -> tuple[FloatArray, IntArray]:
    """Read STL, text or binary; bytes after the last triangle of a binary file are ignored."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(84)
    if head[80:] == b"\0\0\0\0":
        raise PartError(f"{label}: expected triangles, got an STL file with a count of zero. Export it again.")
    count = int.from_bytes(head[80:84], "little")
    promised = 84 + 50 * count
    if count and promised <= size:  # the bytes of a text are a count beyond any file
        return _read_binary_stl(path, count)
    found = _read_with_trimesh(path, label)
    if len(found[1]):
        return found
    data = path.read_bytes()
    if b"\0" not in data:
        if b"facet" in data.lower() and b"endsolid" not in data.lower():
            raise PartError(
                f"{label}: expected the word endsolid, got a text that breaks off. Copy or export it again."
            )
        return found
    if promised > size:
        raise PartError(
            f"{label}: expected a binary STL of {count:,} triangles ({promised:,} bytes), got {size:,} bytes: "
            "it is cut off, or no STL. Copy or export it again."
        )
    return found


_STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("unused", "<u2")])
"""Definition: a triangle of a binary STL file."""


def _read_binary_stl(path: Path, count: int) -> tuple[FloatArray, IntArray]:
    """Read the triangles of a binary STL file, and join their equal corners."""
    rows = np.fromfile(path, dtype=_STL_TRIANGLE, count=count, offset=84)
    vertices, corners = _core.weld(np.ascontiguousarray(rows["corners"], dtype=np.float32))
    return vertices, corners.reshape(-1, 3)


def _read_with_trimesh(path: Path, label: str) -> tuple[FloatArray, IntArray]:
    """Read a file with trimesh."""
    data = _old_text(path)
    source = str(path) if data is None else BytesIO(data)
    with third_party_reader(path, label):
        import trimesh  # slow to import

        logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it logs what it raises, with tracebacks
        scene = trimesh.load_scene(source, file_type=path.suffix[1:].lower(), process=False)
        mesh = scene.to_mesh()
        vertices = np.asarray(getattr(mesh, "vertices", np.zeros((0, 3))), dtype=np.float64).reshape(-1, 3)
        triangles = np.asarray(getattr(mesh, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        raise PartError(f"{label}: expected corner indices below {len(vertices)}, got others. Export it again.")
    return vertices, triangles


def _old_text(path: Path) -> bytes | None:
    """Return a text with line ends of old Macs, converted to newlines; None for any other file."""
    with path.open("rb") as stream:
        head = stream.read(4096)
    if b"\r" not in head or b"\n" in head or b"\0" in head:
        return None
    return path.read_bytes().replace(b"\r", b"\n")


@contextmanager
def third_party_reader(path: Path, label: str) -> Iterator[None]:
    """Convert every exception of a library that reads a file to an error message about the file.

    The exceptions that trimesh or a CAD kernel can raise are not documented, so this context catches all of them
    (decision 67).

    Args:
        path: path of the file.
        label: name of the file for messages.

    Raises:
        PartError: the library raised an exception.
    """
    try:
        yield
    except (TanteoError, MemoryError):
        raise
    except Exception as error:
        detail = next(iter(str(error).strip().splitlines()), "") or type(error).__name__
        kind = path.suffix[1:].upper()
        raise PartError(
            f"{label}: expected {kind}, got a file that cannot be read as {kind} ({detail[:200]}). Export it again."
        ) from error
