"""Distances of points from simple curved surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tanteo.parts.part import SurfaceKind
from tanteo.typing import FloatArray


def surface_offsets(kind: SurfaceKind, fields: Mapping[str, Any], points: FloatArray) -> FloatArray:
    """Return how far points lie off a curved surface, positive away from its axis or centre.

    Args:
        kind: ``cylinder``, ``cone``, ``sphere`` or ``torus``; points are on any other kind by definition.
        fields: of :class:`Face` that describe the surface.
        points: ``(N, 3)``, in the part frame [m].

    Returns:
        ``(N,)`` [m].
    """
    if kind in ("plane", "freeform"):
        return np.zeros(len(points))
    radial = points - fields["axis_point"]
    if kind == "sphere":
        return np.asarray(np.linalg.norm(radial, axis=1) - fields["radius"])
    along = radial @ fields["axis_direction"]
    across = np.linalg.norm(radial - along[:, None] * fields["axis_direction"], axis=1)
    if kind == "cylinder":
        return np.asarray(across - fields["radius"])
    if kind == "cone":
        return np.asarray(across * np.cos(fields["half_angle"]) - along * np.sin(fields["half_angle"]))
    return np.asarray(np.hypot(across - fields["radius"], along) - fields["minor_radius"])
