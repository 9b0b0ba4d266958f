"""Make a part from vertices and triangles in memory, cached on disk by their content."""

from __future__ import annotations

import hashlib

import numpy as np
import numpy.typing as npt

from tanteo.catalogue import cache as remembered
from tanteo.catalogue.archive import FORMAT_VERSION
from tanteo.errors import UnitError
from tanteo.parts import Part
from tanteo.parts.readers import CadMesh, checked_mesh, part_of_mesh


def part_from_mesh(
    vertices: npt.ArrayLike,
    triangles: npt.ArrayLike,
    *,
    unit: str,
    name: str = "part",
    faces: npt.ArrayLike | None = None,
    cache: bool = True,
) -> Part:
    """Make a part from vertices and triangles in memory.

    The mesh is checked and repaired like one from a file, and the part can be used like one from a file. Its
    ``repairs`` list the changes. An open surface is accepted, too.

    Args:
        vertices: vertices ``(V, 3)`` in ``unit``.
        triangles: vertex indices ``(T, 3)``, counter-clockwise seen from outside.
        unit: length unit of the vertices: ``mm``, ``m``, ``in``, ``um``, ``cm`` or ``ft``.
        name: name of the part.
        faces: face number of each triangle ``(T,)``; touching triangles with one number form a face. None to find the
            faces from the angles between triangles.
        cache: whether to use the cache on disk.

    Returns:
        Part in metres, in the frame of the vertices; its ``source`` is empty.

    Raises:
        PartError: the arrays have another shape or type, an index is out of range, a coordinate is not finite, or the
            triangles do not form a surface of plausible size; the message names the fault.
        UnitError: the unit is unknown.

    Example:
        >>> corners = [[x, y, z] for x in (0, 60) for y in (0, 40) for z in (0, 20)]
        >>> sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        >>> triangles = [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]
        >>> block = tanteo.part_from_mesh(corners, triangles, unit="mm", name="block")
        >>> block
        Part('block', 60 x 40 x 20 mm, 6 planes, 12 edges, 8 corners, 0 curved faces)
    """
    mesh = checked_mesh(CadMesh(vertices, triangles, unit, faces), name)
    if mesh.unit is None:
        raise UnitError(f"{name}: expected the length unit of the vertices, got None. Use unit='mm'.")
    if not cache:
        return part_of_mesh(mesh, name)
    key = _key(mesh)
    found = remembered.load(key, name=name, source="")
    if found is None:
        found = part_of_mesh(mesh, name)
        remembered.store(key, found)
    return found


def _key(mesh: CadMesh) -> str:
    """Return the name of the entry of a mesh: the hash of its arrays, its unit and the version of the readers."""
    digest = hashlib.sha256(f"{FORMAT_VERSION}|arrays|{mesh.unit}|".encode())
    for array in (mesh.vertices, mesh.triangles, mesh.faces):
        if array is not None:
            digest.update(str(np.shape(array)).encode())
            digest.update(np.asarray(array).tobytes())
    return digest.hexdigest()
