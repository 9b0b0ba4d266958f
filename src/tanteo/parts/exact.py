"""The exact surfaces behind the curved faces of a part's mesh."""

from __future__ import annotations

import numpy as np

from tanteo.parts.part import Face, Part
from tanteo.shapes import Profiles, Revolved, revolved
from tanteo.typing import FloatArray, Vectors

_PRECISION = 0.1, 1e-6
"""How far corners of the mesh may be off: in sagittas of their face, and in diagonals of the part."""


def exact_faces(part: Part, normals: Vectors) -> Revolved | None:
    """Cylinders, cones, spheres and tori of a part, for distances that its mesh has only to within the sagitta.

    Args:
        part: as read. A face whose mesh does not lie on its surface (a wrong fit, a repaired mesh) is left out.
        normals: of its triangles ``(T, 3)``.

    Returns:
        The surfaces; None for a part that has none, of planes and free forms.
    """
    known = [(k, _profile(face)) for k, face in enumerate(part.faces)]
    rows, found = np.full(len(part.faces), -1), [(k, p) for k, p in known if p is not None]
    if not found:
        return None
    rows[[k for k, _ in found]] = np.arange(len(found))
    table = np.array([p for _, p in found])
    sagittas = np.array([part.faces[k].sagitta for k, _ in found])
    profiles = Profiles(table[:, :3], table[:, 3:6], table[:, 6], table[:, 7], table[:, 8], np.ones(len(found)))
    precision = _PRECISION[0] * sagittas + _PRECISION[1] * part.diagonal
    return revolved(profiles, rows[part.triangle_face], part.vertices[part.triangles], normals, precision)


def _profile(face: Face) -> FloatArray | None:
    """Point, axis, distance of the profile from it, slope and radius of the profile ``(9,)``; None if not known."""
    shape = {
        "cylinder": (face.radius, 0.0, 0.0),
        "cone": (0.0, face.half_angle, 0.0),
        "sphere": (0.0, 0.0, face.radius),
        "torus": (face.radius, 0.0, face.minor_radius),
    }.get(face.surface)
    axis = np.array([0.0, 0.0, 1.0]) if face.surface == "sphere" else face.axis_direction
    if shape is None or face.axis_point is None or axis is None or any(x is None for x in shape):
        return None
    return np.array([*face.axis_point, *axis, *shape], dtype=np.float64)
