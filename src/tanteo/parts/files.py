"""Mesh files -> vertices and triangles as the file lists them, and the length units of files."""

from __future__ import annotations

import struct
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np

from tanteo.errors import PartError, UnitError
from tanteo.typing import FloatArray, IntArray

METRES: dict[str, float] = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
"""Metres in one unit."""

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
"""Bounding-box diagonal below which a part was probably read in too small a unit [m]."""

LARGEST_DIAGONAL = 50.0
"""Bounding-box diagonal above which a part was probably read in too large a unit [m]."""


def unit_name(text: str) -> str:
    """Return the short name of a length unit (``"Millimetres"`` gives ``"mm"``).

    Raises:
        UnitError: the text names no known length unit.
    """
    plain = str(text).strip().lower()
    short = _SPELLINGS.get(plain, _SPELLINGS.get(plain.removesuffix("s"), plain))
    if short not in METRES:
        raise UnitError(f"unit: expected one of {', '.join(METRES)}, got {text!r}. Name the unit of the file.")
    return short


def check_size(diagonal: float, unit: str, label: str, *, stated: bool) -> None:
    """Refuse a part whose size says that it was read in the wrong unit.

    Raises:
        PartError: the diagonal is outside 0.5 mm to 50 m; the message names the units that would fit.
    """
    if SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
        return
    plausible = [name for name, metres in METRES.items() if 5e-3 <= diagonal / METRES[unit] * metres <= 5.0]
    size = "too large" if diagonal > LARGEST_DIAGONAL else "too small"
    hint = f"Did you mean {' or '.join(f'unit={name!r}' for name in plausible)}?" if plausible else "Check it."
    if stated and plausible:
        hint = f"The unit is the file's own: export the part again, in {' or '.join(plausible)}."
    raise PartError(
        f"{label}: expected a part of {SMALLEST_DIAGONAL * 1e3:g} mm to {LARGEST_DIAGONAL:g} m, got a diagonal of "
        f"{diagonal:.4g} m in unit {unit!r}, which is {size}. {hint}"
    )


UNITLESS = (".stl", ".obj", ".ply", ".off")
"""Mesh formats that carry no unit."""

MESH_SUFFIXES = (*UNITLESS, ".glb", ".3mf")


def load_mesh(path: Path, unit: str | None, label: str) -> tuple[FloatArray, IntArray, str]:
    """Read a mesh file.

    Returns:
        Vertices ``(V, 3)`` in the returned unit, triangles ``(T, 3)``, and the short name of the unit.

    Raises:
        UnitError: no unit where the format has none, or one that is not known.
        PartError: the file is not what its suffix says, or holds no triangles.
    """
    suffix = path.suffix.lower()
    if suffix in UNITLESS:
        if unit is None:
            raise UnitError(
                f"unit: expected the length unit of {label}, got none, and {suffix[1:].upper()} files carry none. "
                "Pass unit='mm' (or um, cm, m, in, ft)."
            )
        read = {".off": _read_off, ".stl": _read_stl}.get(suffix, _read_with_trimesh)
        vertices, triangles, _ = read(path, label)
        return vertices, triangles, unit_name(unit)
    vertices, triangles, stated = _read_with_trimesh(path, label)
    own = "m" if suffix == ".glb" else unit_name(stated or "mm")
    return vertices, triangles, own


def _read_stl(path: Path, label: str) -> tuple[FloatArray, IntArray, str | None]:
    """Read STL, text or binary; bytes behind the last triangle of a binary one are left unread."""
    found = _read_with_trimesh(path, label)
    data = path.read_bytes()
    if len(found[1]):
        return found
    if b"\0" not in data:
        if b"facet" in data.lower() and b"endsolid" not in data.lower():
            raise PartError(
                f"{label}: expected the word endsolid, got a text that breaks off. Copy or export it again."
            )
        return found
    count = int.from_bytes(data[80:84], "little")
    promised = 84 + 50 * count
    if promised > len(data):
        raise PartError(
            f"{label}: expected a binary STL of {count:,} triangles ({promised:,} bytes), got {len(data):,} bytes: "
            "it is cut off, or no STL. Copy or export it again."
        )
    return _read_with_trimesh(path, label, data[:promised])


def _read_with_trimesh(path: Path, label: str, data: bytes | None = None) -> tuple[FloatArray, IntArray, str | None]:
    """Read what trimesh reads; ``data`` instead of the file's own bytes."""
    import trimesh  # slow to import

    source = str(path) if data is None else BytesIO(data)
    try:
        scene = trimesh.load_scene(source, file_type=path.suffix[1:].lower(), process=False)
        mesh = scene.to_mesh()
    except (ValueError, TypeError, KeyError, IndexError, AttributeError, EOFError, UnicodeError) as error:
        raise _unreadable(path, label, error) from error
    except (struct.error, zipfile.BadZipFile, RuntimeError, OSError, ImportError) as error:
        raise _unreadable(path, label, error) from error
    vertices = np.asarray(getattr(mesh, "vertices", np.zeros((0, 3))), dtype=np.float64).reshape(-1, 3)
    triangles = np.asarray(getattr(mesh, "faces", np.zeros((0, 3))), dtype=np.int64).reshape(-1, 3)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(vertices)):
        raise PartError(f"{label}: expected corner indices below {len(vertices)}, got others. Export it again.")
    return vertices, triangles, scene.units


def _unreadable(path: Path, label: str, error: BaseException) -> PartError:
    detail = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
    kind = path.suffix[1:].upper()
    return PartError(f"{label}: expected a {kind} mesh, got a file that cannot be read as one ({detail}).")


def _read_off(path: Path, label: str) -> tuple[FloatArray, IntArray, None]:
    """Read OFF with comments and polygons of any number of corners, cut into fans."""
    text = path.read_text(encoding="utf-8", errors="replace")
    lines = [words for line in text.splitlines() if (words := line.split("#", 1)[0].split())]
    if not lines or lines[0][0].upper() != "OFF":
        got = lines[0][0] if lines else "an empty file"
        raise PartError(f"{label}: expected the word OFF at the start, got {got!r}. Export it as plain OFF.")
    lines = ([lines[0][1:]] if len(lines[0]) > 1 else []) + lines[1:]
    try:
        count, polygons = int(lines[0][0]), int(lines[0][1])
        if len(lines) < 1 + count + polygons:
            raise IndexError
        vertices = np.array([line[:3] for line in lines[1 : 1 + count]], dtype=np.float64).reshape(-1, 3)
        rows = lines[1 + count : 1 + count + polygons]
        corners = [np.array(row[1 : 1 + int(row[0])], dtype=np.int64) for row in rows]
        if any(len(ring) != int(row[0]) for ring, row in zip(corners, rows, strict=True)):
            raise IndexError
    except (ValueError, IndexError) as error:
        raise PartError(
            f"{label}: expected OFF counts, coordinates and faces, got a file that breaks off or holds other words. "
            "Export it again."
        ) from error
    if any(len(ring) and (ring.min() < 0 or ring.max() >= count) for ring in corners):
        raise PartError(f"{label}: expected corner indices from 0 to {count - 1}, got others. Export it again.")
    triangles = [triangle for ring in corners for triangle in _fan(vertices, ring, label)]
    return vertices, np.array(triangles, dtype=np.int64).reshape(-1, 3), None


def _fan(vertices: FloatArray, ring: IntArray, label: str) -> list[tuple[int, int, int]]:
    """Cut a polygon into a fan from the first corner that sees all others."""
    if len(ring) <= 3:
        return [(int(ring[0]), int(ring[1]), int(ring[2]))] if len(ring) == 3 else []
    points = vertices[ring]
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    for shift in range(len(ring)):
        turned, at = np.roll(ring, -shift), np.roll(points, -shift, axis=0)
        areas = np.cross(at[1:-1] - at[0], at[2:] - at[0]) @ normal
        if (areas >= -1e-9 * np.abs(areas).max()).all():
            return [(int(turned[0]), int(turned[i]), int(turned[i + 1])) for i in range(1, len(ring) - 1)]
    raise PartError(
        f"{label}: expected polygons that a fan of triangles can fill, got one that no corner sees whole. "
        "Export it as triangles."
    )
