"""Colours of the live page: the colours of reports with a light background, and further ones for alternative parts."""

from __future__ import annotations

from tanteo.render.live.primitives import Colour

PART, EDGE, INK, SOFT = (159, 171, 184), (61, 74, 87), (27, 36, 45), (85, 97, 109)
"""Colours of the most probable part and its edges, of the next reading and the real part, and of the hand."""

GOOD, BAD, BEAM, FREE, OVERLAY = (0, 114, 178), (184, 72, 0), (125, 137, 148), (45, 174, 91), (125, 18, 217)
"""Colours of readings that fit and do not fit, of beams with and without contact, and of possible poses."""

FEATURE: Colour = (72, 0, 108)
"""Colour of features of labelled readings."""

PLANNER: Colour = (255, 75, 150)
"""Colour of the planner's readings in a contest."""

TABLE, FURNITURE = (238, 240, 243), (206, 196, 178)
"""Colours of table and furniture."""

RIVALS: tuple[Colour, ...] = ((230, 159, 0), (110, 195, 255), (96, 36, 4))
"""Colours of alternative parts, the most probable first."""


def css(colour: Colour) -> str:
    """Return a colour in the notation of style sheets, such as ``#9fabb8``."""
    return "#" + "".join(f"{c:02x}" for c in colour)
