"""Section of a report with the uncertainty budget, scaled so that its sources sum to the answer's uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tanteo.render.html.charts import bar
from tanteo.render.html.contacts import Sensed
from tanteo.render.html.page import Html, Section, element, join, per_hypothesis, table
from tanteo.render.html.scene import Candidate
from tanteo.render.html.uncertainty import Budget, Source, make_budget
from tanteo.render.html.words import MM, uncertain

BEYOND = "beyond first order"
"""Name of the source for uncertainty that a linear budget does not contain: several modes, curved surfaces,
sampling."""

_EQUAL = 0.01
"""Relative difference below which two standard deviations count as equal."""


def combined(budget: Budget, corner_sd: float) -> Budget:
    """Return a budget whose variances sum to the variance of the answer.

    If the uncertainty of the answer is larger than that of the linear budget, a source is added. If it is smaller, all
    sources are scaled.

    Args:
        budget: linear budget.
        corner_sd: largest corner sd of the answer [m].
    """
    ratio = corner_sd / budget.total
    if ratio < 1 + _EQUAL:
        return Budget(tuple(replace(s, sd=ratio * s.sd, without=ratio * s.without) for s in budget.sources), corner_sd)
    more = float(np.sqrt(corner_sd**2 - budget.total**2))
    found = [replace(s, share=s.share / ratio**2, without=float(np.hypot(s.without, more))) for s in budget.sources]
    found.append(Source(BEYOND, "–", 1 - ratio**-2, more, budget.total))
    return Budget(tuple(sorted(found, key=lambda s: -s.share)), corner_sd)


_DIFFERS = 0.15
"""Relative excess of the linear budget over the answer above which the report has a note on it."""


def budget_section(candidates: Sequence[Candidate], sensed: Sensed) -> Section:
    """Return the section with the uncertainty budget of every hypothesis.

    Args:
        candidates: hypotheses of the answer, best first.
        sensed: readings of the answer.
    """
    lead = (
        "Sources of the variance at the most uncertain corner of the part's box. More readings reduce the noise, but "
        "not the errors that all readings share, which need a calibration. A shared error that the same readings "
        "estimate costs more than its own variance: see the column without it. Type as in the GUM: A from the scatter "
        "of these readings, B stated, calibrated or from the prior."
    )
    bodies = per_hypothesis(candidates, lambda c: _budget(c, sensed))
    return Section("budget", "Where the uncertainty comes from", lead, bodies)


def _budget(candidate: Candidate, sensed: Sensed) -> Html:
    best = candidate.hypothesis
    budget = make_budget(
        candidate.contacts, sensed, candidate.part, best.T_world_part, best.noise_scale[0], best.covariance
    )
    if budget is None:
        return element("p", "The readings determine no direction of the pose, so there is no budget.")
    linear, stated = budget.total, best.corner_sd
    if not best.unobserved:
        budget = combined(budget, stated)
    rows: list[Sequence[Html | str]] = [
        [s.name, s.kind, join([bar(s.share), f" {_share(s.share)}"]), _mm(s.sd), _mm(s.without)] for s in budget.sources
    ]
    rows.append(["together", "", "100 %", f"{MM * budget.total:.2g}", ""])
    headers = ["source", "type", "part of the variance", "alone, 1 sd [mm]", "without it [mm]"]
    note = element("p", _total(candidate, budget, linear), class_="note")
    return join([table(headers, rows, class_="shares"), note])


def _total(candidate: Candidate, budget: Budget, linear: float) -> str:
    stated, free = candidate.hypothesis.corner_sd, candidate.hypothesis.free_motions
    total = uncertain(budget.total)
    if free:
        return f"Together {total}, without the unobserved motions: {'; '.join(motion.brief for motion in free)}."
    words = f"Together {total}, the largest corner sd of the answer; expanded (k = 2) {uncertain(2 * stated)}."
    if linear > (1 + _DIFFERS) * stated:
        return f"{words} To first order it would be {uncertain(linear)}: the sources are scaled to the answer."
    return words


def _share(share: float) -> str:
    return "< 1 %" if share < 0.005 else f"{100 * share:.0f} %"


def _mm(metres: float) -> str:
    return f"{MM * metres:.3g}" if np.isfinite(metres) else "–"
