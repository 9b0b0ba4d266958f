"""What a plan brings, or why there is none, in one sentence."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import FloatArray
from tanteo.planning.design import Design
from tanteo.planning.placements import Promise
from tanteo.planning.probe import Probe

_DOUBTFUL = 0.5
"""A plan that keeps less, with a reading that meets its face at a smaller share of the placements, is none."""

_ROOMY = 0.99
"""Share of the placements with room from which nothing is said of it."""

_SESSION = (
    "sense in a session, which looks at each answer before it chooses the next reading (tanteo sense part, "
    "tanteo.planning)"
)


def aim(design: Design, tolerance: float) -> str:
    """What is to be within which tolerance."""
    return f"{design.places.name} within {1e3 * tolerance:.{3 if tolerance < 1 else 15}g} mm"


def in_doubt(meets: FloatArray, within: float) -> str:
    """Why a plan keeps nothing, where a reading may well miss its face; empty where none does.

    Args:
        meets: share of the placements at which each reading meets its face ``(n,)``.
        within: chance that the tolerance is kept over all of them.
    """
    k = int(np.argmin(meets))
    if max(meets[k], within) >= _DOUBTFUL:
        return ""
    return (
        f"The part may be anywhere: reading {k + 1} would meet its face in {meets[k]:.0%} of the cases "
        f"(P = {_least(within)}). Find out better where it is before you plan."
    )


def from_wide_prior(design: Design, tolerance: float, within: float) -> str:
    """That no readings that are chosen beforehand do, as the start is too rough."""
    before = design.places.sd(design.pose(design.prior))
    return (
        f"No readings that are chosen beforehand bring {aim(design, tolerance)}: with a start so rough "
        f"({design.places.worst} {1e3 * before:.2g} mm, 1 sd) those that would help may miss their faces "
        f"(P = {_least(within)}). Find out better where it is, or {_SESSION}."
    )


def reaches_nothing(name: str, probe: Probe, clearance: float | None = None) -> str:
    """That the probe reaches no place of a part, and with which clearance it does [m], if with any."""
    if clearance is None:
        return f"The probe reaches no place of {name}: give it more room, or another approach."
    return (
        f"The probe reaches no place of {name}: it starts {1e3 * probe.standoff:.3g} mm before the surface and needs "
        f"{1e3 * probe.clearance:.3g} mm of room there. It does if it needs {1e3 * clearance:g} mm "
        f"(--clearance {1e3 * clearance:g}mm)."
    )


def too_close(design: Design, room: float) -> str:
    """That a start or the way there may be too close to the part, or in it; empty where that is improbable."""
    if room > _ROOMY:
        return ""
    return (
        f"Careful: in {1 - room:.0%} of the placements a start, or the way to it, is within "
        f"{1e3 * design.probe.clearance:.3g} mm of the part, or in it, and the reading is not counted. Start farther "
        "off (--standoff), with less room (--clearance), or find out better where the part is."
    )


def what_it_brings(design: Design, n: int, sd: float, brings: Promise, tolerance: float, confidence: float) -> str:
    """What the readings of a plan bring, or what they leave.

    Args:
        design: the problem.
        n: number of readings.
        sd: of the largest corner sd, or of the feature, after them [m].
        brings: with which chance.
        tolerance: that is asked for [m].
        confidence: with which it is.
    """
    what, where = aim(design, tolerance), design.places.worst
    left = f"{where} {1e3 * sd:.2g} mm, 1 sd"
    met = f"{brings.if_met:.3f} if every reading meets its face, as in {brings.all_meet:.0%} of them"
    if brings.within >= confidence:
        count = "1 reading brings" if n == 1 else f"{n} readings bring"
        return f"{count} {what} (P = {brings.within:.3f} over all placements; {met}); {left}."
    if design.chance(design.limit, tolerance) < confidence:
        moved = where if design.places.feature else f"the {where}"
        return (
            f"No number of readings brings {what}: the robot's own error moves {moved} by "
            f"{1e3 * design.places.sd(design.limit):.2g} mm (1 sd). Calibrate the robot, or sense relative to "
            "something that it must meet."
        )
    count = "1 reading does" if n == 1 else f"{n} readings do"
    chances = f"P = {_least(brings.within)} over all placements; {met}"
    if brings.if_met >= confidence:
        more = f"Allow more readings, find out better where the part is, or {_SESSION}."
    else:
        more = "Allow more readings, a better sensor, or another approach."
    return f"{count} not bring {what} ({chances}); {left}. {more}"


def _least(p: float) -> str:
    """A chance that does not reach what is asked for is not rounded up to it."""
    return f"{np.floor(1e3 * p) / 1e3:.3f}"
