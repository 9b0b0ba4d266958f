"""Colours of the live page: those of the report by day, and more for what may be there besides."""

from __future__ import annotations

from tanteo.render.live.primitives import Colour

PART, EDGE, INK, SOFT = (159, 171, 184), (61, 74, 87), (27, 36, 45), (85, 97, 109)
"""The likeliest part and its edges; the next reading and the truth; the hand."""

GOOD, BAD, BEAM, FREE, OVERLAY = (0, 114, 178), (184, 72, 0), (125, 137, 148), (45, 174, 91), (125, 18, 217)
"""Readings that fit and those that do not, beams that met something and those that did not, how the pose may be off."""

FEATURE: Colour = (72, 0, 108)
"""Features that labelled readings make."""

PLANNER: Colour = (255, 75, 150)
"""What the planner sensed in a contest."""

TABLE, FURNITURE = (238, 240, 243), (206, 196, 178)
"""What is known to stand there."""

RIVALS: tuple[Colour, ...] = ((230, 159, 0), (110, 195, 255), (96, 36, 4))
"""What else it may be, the likeliest first."""


def css(colour: Colour) -> str:
    """As style sheets write it."""
    return "#" + "".join(f"{c:02x}" for c in colour)
