"""Convert vertices and triangles to a mesh in metres whose triangles are assigned to faces."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from tanteo.errors import PartError, UnitError
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.facets import rounding_of
from tanteo.parts.faces.mesh_faces import label_faces, sort_faces
from tanteo.parts.part import Part
from tanteo.parts.readers.building import build_part
from tanteo.parts.readers.files import METRES, check_size, unit_name
from tanteo.parts.readers.readers import CadMesh
from tanteo.parts.readers.repair import MERGE_STEPS, sound_mesh
from tanteo.parts.readers.topology import Draft, compacted

_ON = 2.0 * MERGE_STEPS[-1]
"""Distance, relative to the diagonal, within which the centre of a repaired triangle lies on an original one; repairs
move vertices at most by the merge distance."""


def checked_mesh(mesh: CadMesh, label: str) -> CadMesh:
    """Check shapes, types and indices of a mesh, and return it with arrays of 64 bits.

    Args:
        mesh: arrays or nested sequences.
        label: name of the mesh for messages.

    Raises:
        PartError: an array has another shape or type, or an index is out of range.
        UnitError: the unit is not known.
    """
    vertices = _array(mesh.vertices, np.float64, "vertices", label)
    triangles = _array(mesh.triangles, np.int64, "triangles", label)
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        got = int(triangles.min()) if triangles.min() < 0 else int(triangles.max())
        raise PartError(f"{label}: expected corner indices from 0 to {len(vertices) - 1}, got {got}. Correct it.")
    faces = None
    if mesh.faces is not None:
        faces = _array(mesh.faces, np.int64, "faces", label)
        if len(faces) != len(triangles):
            raise PartError(
                f"{label}: expected one face number for each of {len(triangles)} triangles, got {len(faces)}. "
                "Correct it."
            )
    if not isinstance(mesh.unit, str | None):
        raise UnitError(f"{label}: expected the unit as a word, got {mesh.unit!r}. Use unit='mm'.")
    return CadMesh(vertices, triangles, None if mesh.unit is None else unit_name(mesh.unit), faces, tuple(mesh.notes))


def draft_of_mesh(mesh: CadMesh, label: str, *, stated: bool) -> tuple[Draft, list[str]]:
    """Repair a checked mesh, and assign its triangles to faces.

    Args:
        mesh: mesh from :func:`checked_mesh`, with a unit.
        label: name of the mesh for messages.
        stated: whether the file states the unit; otherwise the caller does.

    Returns:
        Mesh in metres, and one sentence for each repair.

    Raises:
        PartError: the mesh is not a surface of plausible size.
    """
    vertices = np.asarray(mesh.vertices)
    triangles = np.asarray(mesh.triangles)
    unit = str(mesh.unit)
    if len(triangles):
        check_size(diagonal_of_points(vertices[compacted(triangles)[0]]) * METRES[unit], unit, label, stated=stated)
    points, corners, repairs = sound_mesh(vertices, triangles, label)
    rounding = rounding_of(vertices) * METRES[unit]
    if mesh.faces is None:
        return sort_faces(points * METRES[unit], corners, rounding), [*mesh.notes, *repairs]
    numbers = _carried(np.asarray(mesh.faces), vertices, triangles, points, corners)
    return label_faces(points * METRES[unit], corners, numbers, rounding), [*mesh.notes, *repairs]


def part_of_mesh(mesh: CadMesh, name: str) -> Part:
    """Return the part of a checked mesh with a unit that does not come from a file.

    Args:
        mesh: mesh from :func:`checked_mesh`, with a unit.
        name: name of the part.

    Raises:
        PartError: the mesh is not a surface of plausible size.
    """
    unit = str(mesh.unit)
    draft, repairs = draft_of_mesh(mesh, name, stated=False)
    check_size(diagonal_of_points(draft.vertices), unit, name, stated=False)
    return build_part(draft, name=name, source="", unit=unit, repairs=tuple(repairs))


def diagonal_of_points(points: FloatArray) -> float:
    """Return the diagonal of the box of finite points ``(n, 3)``; 1 if there are none.

    Args:
        points: points ``(n, 3)``; points that are not finite are ignored.
    """
    finite = points[np.isfinite(points).all(axis=1)]
    with np.errstate(over="ignore"):  # infinite is too large, too
        return float(np.linalg.norm(np.ptp(finite, axis=0))) if len(finite) else 1.0


def _array(given: npt.ArrayLike, dtype: type, name: str, label: str) -> Any:
    """Return an argument as an array; ``faces`` has one axis, the others have rows of three."""
    wanted = "(T,)" if name == "faces" else f"({name[0].upper()}, 3)"
    kind = "numbers" if dtype is np.float64 else "whole numbers"
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise PartError(f"{label}: expected {name} {wanted}, got rows of unequal length. Correct it.") from error
    if array.size == 0 and array.ndim <= 2:
        array = array.reshape((0,) if name == "faces" else (0, 3)).astype(dtype)
    if array.dtype.kind not in ("iu" if dtype is np.int64 else "iuf"):
        raise PartError(f"{label}: expected {name} as {kind}, got {array.dtype}. Correct it.")
    if array.shape[1:] != (() if name == "faces" else (3,)) or array.ndim == 0:
        raise PartError(f"{label}: expected {name} {wanted}, got shape {array.shape}. Correct it.")
    return np.ascontiguousarray(array, dtype=dtype)


def _carried(
    numbers: IntArray, vertices: FloatArray, triangles: IntArray, points: FloatArray, corners: IntArray
) -> IntArray:
    """Return the face number of each repaired triangle: that of the original triangle on which its centre lies.

    A triangle that fills a hole lies on none and gets a new number.
    """
    if np.array_equal(triangles, corners) and np.array_equal(vertices, points):
        return numbers
    import igl  # slow to import, and seldom needed

    rows = np.flatnonzero(np.linalg.norm(_doubled(vertices, triangles), axis=1) > 0.0)
    squared, nearest, _ = igl.point_mesh_squared_distance(points[corners].mean(axis=1), vertices, triangles[rows])
    off = np.sqrt(np.asarray(squared).reshape(-1)) > _ON * diagonal_of_points(points)
    return np.where(off, int(numbers.max()) + 1, numbers[rows[np.asarray(nearest).reshape(-1)]])


def _doubled(vertices: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the normal of each triangle with twice its area as length ``(T, 3)``."""
    corners = vertices[triangles]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
