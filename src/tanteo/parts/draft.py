"""What readers of CAD files hand on: a closed mesh whose triangles are sorted into faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tanteo.parts.part import SurfaceKind
from tanteo.typing import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """A closed mesh whose triangles are sorted into faces, before features are taken from it.

    Attributes:
        vertices: ``(V, 3)`` [m].
        triangles: ``(T, 3)``, closed and outward.
        triangle_face: ``(T,)``, index into ``kinds``.
        kinds: kind of each face and the fields of :class:`Face` that describe it.
        round_edges: ``(R, 2)``, mesh edges (lower vertex first) known to be chords of a curved edge; None where a
            mesh file leaves that open.
    """

    vertices: FloatArray
    triangles: IntArray
    triangle_face: IntArray
    kinds: tuple[tuple[SurfaceKind, dict[str, Any]], ...]
    round_edges: IntArray | None
