"""What a plan brings, or why there is none, in one sentence."""

from __future__ import annotations

import numpy as np

from tanteo.active.design import Design
from tanteo.typing import FloatArray

_DOUBTFUL = 0.5
"""A plan with a reading that meets its face at a smaller share of the poses keeps nothing."""


def aim(design: Design, tolerance: float) -> str:
    """What is to be within which tolerance."""
    return f"{design.places.name} within {1e3 * tolerance:.{3 if tolerance < 1 else 15}g} mm"


def in_doubt(meets: FloatArray) -> str:
    """Why a plan keeps nothing, where a reading may well miss its face; empty where none does.

    Args:
        meets: share of the poses at which each reading meets its face ``(n,)``.
    """
    k = int(np.argmin(meets))
    if meets[k] >= _DOUBTFUL:
        return ""
    return (
        f"The part may be anywhere: reading {k + 1} would meet its face in {meets[k]:.0%} of the cases. Find out "
        "better where it is before you plan."
    )


def from_too_rough(design: Design, tolerance: float) -> str:
    """That no readings that are chosen beforehand do, as the start is too rough."""
    before = design.places.sd(design.pose(design.prior))
    return (
        f"No readings that are chosen beforehand bring {aim(design, tolerance)}: with a start so rough "
        f"({design.places.worst} {1e3 * before:.2g} mm, 1 sd) those that would help may miss their faces. Find out "
        "better where it is, or sense in a session, which chooses each reading by those before."
    )


def what_it_brings(design: Design, n: int, sd: float, within: float, tolerance: float, confidence: float) -> str:
    """What the readings of a plan bring, or what they leave.

    Args:
        design: the problem.
        n: number of readings.
        sd: of the worst corner, or of the feature, after them [m].
        within: chance that the tolerance is kept then.
        tolerance: that is asked for [m].
        confidence: with which it is.
    """
    what, where = aim(design, tolerance), design.places.worst
    left = f"{where} {1e3 * sd:.2g} mm, 1 sd"
    if within >= confidence:
        count = "1 reading brings" if n == 1 else f"{n} readings bring"
        return f"{count} {what} (P = {within:.3f}); {left}."
    if design.chance(design.limit, tolerance) < confidence:
        moved = where if design.places.feature else f"the {where}"
        return (
            f"No number of readings brings {what}: the robot's own error moves {moved} by "
            f"{1e3 * design.places.sd(design.limit):.2g} mm (1 sd). Calibrate the robot, or sense relative to "
            "something that it must meet."
        )
    count = "1 reading does" if n == 1 else f"{n} readings do"
    least = np.floor(1e3 * within) / 1e3  # what is not reached is not rounded up to it
    more = "Allow more readings, a better sensor, or another approach."
    return f"{count} not bring {what} (P = {least:.3f}); {left}. {more}"
