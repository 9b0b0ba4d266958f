"""Laws of meshes and of faces, stated without the package."""

from __future__ import annotations

from collections import Counter

import numpy as np


def is_closed(triangles) -> bool:
    """Return whether each directed edge occurs once and its reverse once: a closed, consistently wound manifold."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    counts = Counter(map(tuple, edges.tolist()))
    return all(count == 1 and counts[second, first] == 1 for (first, second), count in counts.items())


def distances_from(face, points):
    """Return signed distances of points from the curved surface of a face [m], positive away from axis or centre."""
    arms = points - face.axis_point
    if face.surface == "sphere":
        return np.linalg.norm(arms, axis=1) - face.radius
    along = arms @ face.axis_direction
    across = np.linalg.norm(arms - np.outer(along, face.axis_direction), axis=1)
    if face.surface == "cylinder":
        return across - face.radius
    if face.surface == "cone":
        return across * np.cos(face.half_angle) - along * np.sin(face.half_angle)
    assert face.surface == "torus"
    return np.hypot(across - face.radius, along) - face.minor_radius
