"""The linear budget beside the answer: its sources make up the figure that the answer tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.report.uncertainty import Budget, Source

BEYOND = "beyond first order"
"""What the answer has and a linear budget does not see: modes, curved surfaces, samples."""

_EQUAL = 0.01
"""Sds that differ by a smaller share are the same."""


def combined(budget: Budget, corner_sd: float) -> Budget:
    """A budget whose variances add up to the answer's.

    What the answer has beyond the linear budget is a source of its own. Where it has less, all sources shrink alike.

    Args:
        budget: The linear one.
        corner_sd: Largest corner sd of the answer [m].
    """
    ratio = corner_sd / budget.total
    if ratio < 1 + _EQUAL:
        return Budget(
            tuple(replace(s, sd=ratio * s.sd, without=ratio * s.without) for s in budget.sources), corner_sd
        )
    more = float(np.sqrt(corner_sd**2 - budget.total**2))
    found = [
        replace(s, share=s.share / ratio**2, without=float(np.hypot(s.without, more))) for s in budget.sources
    ]
    found.append(Source(BEYOND, "–", 1 - ratio**-2, more, budget.total))
    return Budget(tuple(sorted(found, key=lambda s: -s.share)), corner_sd)
