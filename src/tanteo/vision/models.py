"""A part made ready to be looked for: its edges, and how it may lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.parts import Part
from tanteo.typing import Vectors
from tanteo.vision.descriptors import Descriptors
from tanteo.vision.outlines import outline_from_above
from tanteo.vision.resting import Rest, known_rests
from tanteo.vision.wireframe import Wireframe, wireframe

COARSE = 80
"""About how many samples of edges the first search uses."""


INNER = 48
"""How many points of the surface are asked whether they lie on bare table."""


@dataclass(frozen=True, slots=True, eq=False)
class VisionModel:
    """Computed once from the CAD.

    Attributes:
        part: the part.
        frame: samples of its edges.
        coarse: fewer of them, for the first search.
        inner: points all over its surface ``(INNER, 3)``, which are within its silhouette, part frame [m].
        rests: its stable poses on a table.
        outlines: of each of them from straight above [m].
    """

    part: Part
    frame: Wireframe
    coarse: Wireframe
    inner: Vectors
    rests: tuple[Rest, ...]
    outlines: tuple[Descriptors, ...]


def prepare_vision(part: Part) -> VisionModel:
    """Make a part ready; what was made is kept with the part, for further images."""
    if "vision" not in part.derived:
        frame, ways = wireframe(part), known_rests(part)
        outlines = tuple(outline_from_above(frame.surface, rest) for rest in ways)
        part.derived["vision"] = VisionModel(part, frame, wireframe(part, COARSE), spread(part), ways, outlines)
    model: VisionModel = part.derived["vision"]
    return model


def spread(part: Part, count: int = INNER) -> Vectors:
    """Points of a part's surface that are about as dense everywhere (Kronecker's sequence; Roberts 2018)."""
    a, b, c = np.moveaxis(part.vertices[part.triangles], 1, 0)
    upto = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    k = np.searchsorted(upto, (np.arange(count) + 0.5) / count * upto[-1])
    u, v = ((0.5 + share * np.arange(count)) % 1.0 for share in (0.7548776662, 0.5698402910))
    folded = np.where(u + v > 1, [1 - u, 1 - v], [u, v])[..., None]
    return np.asarray(a[k] + folded[0] * (b[k] - a[k]) + folded[1] * (c[k] - a[k]))
