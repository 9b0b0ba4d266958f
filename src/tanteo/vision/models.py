"""A part made ready to be looked for: its edges, and how it may lie."""

from __future__ import annotations

from dataclasses import dataclass

from tanteo.parts import Part
from tanteo.vision.descriptors import Descriptors
from tanteo.vision.outlines import outline_from_above
from tanteo.vision.resting import Rest, rests
from tanteo.vision.wireframe import Wireframe, wireframe

COARSE = 80
"""About how many samples of edges the first search uses."""


@dataclass(frozen=True, slots=True, eq=False)
class VisionModel:
    """Computed once from the CAD.

    Attributes:
        part: the part.
        frame: samples of its edges.
        coarse: fewer of them, for the first search.
        rests: its stable poses on a table.
        outlines: of each of them from straight above [m].
    """

    part: Part
    frame: Wireframe
    coarse: Wireframe
    rests: tuple[Rest, ...]
    outlines: tuple[Descriptors, ...]


def prepare_vision(part: Part) -> VisionModel:
    """Make a part ready; do it once for many images."""
    frame, ways = wireframe(part), rests(part)
    outlines = tuple(outline_from_above(frame.surface, rest) for rest in ways)
    return VisionModel(part, frame, wireframe(part, COARSE), ways, outlines)
