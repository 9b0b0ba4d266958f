"""Read OFF and OBJ files as vertices and triangles; polygons are triangulated."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tanteo.errors import PartError
from tanteo.geometry.typing import FloatArray, IntArray


def read_off(path: Path, label: str) -> tuple[FloatArray, IntArray]:
    """Read OFF, with comments, and with colours, normals or textures after the coordinates (COFF, NOFF, STOFF).

    Args:
        path: path of the file.
        label: name of the file for messages.

    Raises:
        PartError: the file is truncated, or has other content.
    """
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    lines = [words for line in text.splitlines() if (words := line.split("#", 1)[0].split())]
    if not lines or not re.fullmatch("(ST)?C?N?OFF", lines[0][0].upper()):
        got = lines[0][0][:20] if lines else "an empty file"
        raise PartError(f"{label}: expected the word OFF at the start, got {got!r}. Export it as plain OFF.")
    lines = ([lines[0][1:]] if len(lines[0]) > 1 else []) + lines[1:]
    try:
        count = int(lines[0][0])
        polygons = int(lines[0][1])
        if len(lines) < 1 + count + polygons or min(count, polygons) < 0:
            raise IndexError
        vertices = np.array([line[:3] for line in lines[1 : 1 + count]], dtype=np.float64).reshape(-1, 3)
        rows = lines[1 + count : 1 + count + polygons]
        rings = [np.array(row[1 : 1 + int(row[0])], dtype=np.int64) for row in rows]
        if any(len(ring) != int(row[0]) for ring, row in zip(rings, rows, strict=True)):
            raise IndexError
    except (ValueError, IndexError, OverflowError) as error:
        raise PartError(
            f"{label}: expected OFF counts, coordinates and faces, got a file that breaks off or holds other words. "
            "Export it again."
        ) from error
    return vertices, _triangles(vertices, rings, label)


def read_obj(path: Path, label: str) -> tuple[FloatArray, IntArray]:
    """Read the vertices and faces of an OBJ file.

    Line ends of all systems and continuation lines are accepted, and indices may count back from the last vertex.
    Colours after coordinates, normals, textures, materials, groups, lines and points are ignored
    (http://paulbourke.net/dataformats/obj).

    Args:
        path: path of the file.
        label: name of the file for messages.

    Raises:
        PartError: the file has no faces, invalid indices, or weights of rational surfaces.
    """
    text = path.read_bytes().decode("utf-8-sig", errors="replace").replace("\r\n", "\n").replace("\r", "\n")
    rows: list[list[str]] = []
    rings: list[IntArray] = []
    other: set[str] = set()
    for number, line in enumerate(text.replace("\\\n", " ").split("\n"), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            if words[0] == "v":
                rows.append(_coordinates(words[1:]))
            elif words[0] in ("f", "fo"):
                corners = np.array([word.split("/", 1)[0] for word in words[1:]], dtype=np.int64)
                rings.append(np.where(corners < 0, corners + len(rows), corners - 1))
            else:
                other.add(words[0])
        except (ValueError, OverflowError):
            raise PartError(
                f"{label}: expected an OBJ file, got '{line.strip()[:40]}' in line {number}. Export it again."
            ) from None
    if not rings:
        content = "surfaces or curves of splines" if other & {"curv", "surf", "curv2"} else "vertices alone"
        got = content if rows else "no vertices"
        raise PartError(f"{label}: expected faces (lines that begin with f), got {got}. Export it as a mesh.")
    try:
        vertices = np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        raise PartError(f"{label}: expected coordinates as numbers, got others. Export it again.") from None
    return vertices, _triangles(vertices, rings, label)


def _coordinates(words: list[str]) -> list[str]:
    """Return the first three coordinates of a vertex; a fourth alone must be 1, more than four include colours."""
    if len(words) < 3 or (len(words) == 4 and float(words[3]) != 1.0):
        raise ValueError
    return words[:3]


def _triangles(vertices: FloatArray, rings: list[IntArray], label: str) -> IntArray:
    """Return the triangles of polygons ``(T, 3)``."""
    if any(len(ring) and (ring.min() < 0 or ring.max() >= len(vertices)) for ring in rings):
        last = len(vertices) - 1
        raise PartError(f"{label}: expected corners among the vertices 0 to {last}, got others. Export it again.")
    if all(len(ring) == 3 for ring in rings):
        return np.array(rings, dtype=np.int64).reshape(-1, 3)
    sizes = np.array([len(ring) for ring in rings])
    found: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)] * len(rings)
    for size in np.unique(sizes[sizes > 2]):
        which = np.flatnonzero(sizes == size)
        for k, triangles in zip(which, _of_polygons(vertices, np.stack([rings[k] for k in which])), strict=True):
            found[k] = triangles
    return np.concatenate(found)


def _of_polygons(vertices: FloatArray, rings: IntArray) -> list[IntArray]:
    """Return the triangles of each of some polygons with the same number of corners ``(m, n)``.

    Each is a fan from one of its first two corners if it is star-shaped about it, otherwise a general triangulation.
    A convex polygon is star-shaped about every corner, a quadrangle about one of its first two.
    """
    points = vertices[rings]
    normals = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)
    triangles = np.zeros((len(rings), rings.shape[1] - 2, 3), dtype=np.int64)
    left = np.ones(len(rings), dtype=bool)
    for shift in range(2):
        turned = np.roll(rings, -shift, axis=1)
        at = np.roll(points, -shift, axis=1)
        crosses = np.cross(at[:, 1:-1] - at[:, :1], at[:, 2:] - at[:, :1])
        areas = np.einsum("mti,mi->mt", crosses, normals)
        fan = left & (areas >= -1e-9 * np.abs(areas).max(axis=1, keepdims=True)).all(axis=1)
        triangles[fan, :, 0] = turned[fan, :1]
        triangles[fan, :, 1] = turned[fan, 1:-1]
        triangles[fan, :, 2] = turned[fan, 2:]
        left &= ~fan
    return [_triangulated(points[k], rings[k], normals[k]) if left[k] else triangles[k] for k in range(len(rings))]


def _triangulated(points: FloatArray, ring: IntArray, normal: FloatArray) -> IntArray:
    """Return the triangles ``(t, 3)`` of any simple polygon in a plane; fewer than n - 2 if corners coincide."""
    import manifold3d  # slow to import, and seldom needed

    away = normal / np.linalg.norm(normal)
    x = np.cross(away, np.eye(3)[int(np.argmin(np.abs(away)))])
    x /= np.linalg.norm(x)
    flat = (points - points[0]) @ np.stack([x, np.cross(away, x)], axis=1)
    corners = np.asarray(manifold3d.triangulate([np.ascontiguousarray(flat)]), dtype=np.int64)
    return np.asarray(ring[corners])
