"""Whether the readings that do not fit are those before or after one point of time: then something may have moved."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np

from tanteo.typing import BoolArray

_FEW, _BY_CHANCE = 2, 0.05
"""So many readings aside, or more, and at least as improbably together by chance, are worth a sentence."""


def moved(ids: Sequence[str], aside: BoolArray) -> str:
    """That something may have moved, in words; empty if the readings that do not fit came at any time.

    If they are outliers by chance, all of them are among the first, or among the last, so many with the share of the
    ways to choose them there.

    Args:
        ids: names of the readings in the order in which they were told.
        aside: which of them do not fit ``(n,)``.
    """
    rows, n = np.flatnonzero(aside), len(aside)
    if len(rows) < _FEW:
        return ""
    first, last = int(rows[0]), int(rows[-1])
    span = min(last + 1, n - first)
    if 2 * comb(span, len(rows)) >= _BY_CHANCE * comb(n, len(rows)):
        return ""
    early = last + 1 <= n - first
    others = f"all after {ids[last]}" if early else f"all before {ids[first]}"
    some = len(rows) < last - first + 1
    which = (
        f"{len(rows)} of the readings {ids[first]} to {ids[last]}" if some else f"Readings {ids[first]} to {ids[last]}"
    )
    return f"{which} do not fit, {others} do: did the part or the sensor move?"
