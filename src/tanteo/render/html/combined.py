"""The linear budget beside the answer: its sources make up the figure that the answer tells."""

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
        return Budget(tuple(replace(s, sd=ratio * s.sd, without=ratio * s.without) for s in budget.sources), corner_sd)
    more = float(np.sqrt(corner_sd**2 - budget.total**2))
    found = [replace(s, share=s.share / ratio**2, without=float(np.hypot(s.without, more))) for s in budget.sources]
    found.append(Source(BEYOND, "–", 1 - ratio**-2, more, budget.total))
    return Budget(tuple(sorted(found, key=lambda s: -s.share)), corner_sd)


_DIFFERS = 0.15
"""A linear budget that is larger than the answer's figure by more says so."""


def budget_section(candidates: Sequence[Candidate], sensed: Sensed) -> Section:
    """Sensor, robot, shared errors, part."""
    lead = (
        "Shares of the variance at the corner of the part's box that is known worst. More readings shrink the noise; "
        "errors that all readings share stay, until they are calibrated. Where such an error has to be "
        "estimated from the same readings, it costs more than its share: see what is left without it. Type as in the "
        "GUM: A from the scatter of these readings, B stated, calibrated or known beforehand."
    )
    bodies = per_hypothesis(candidates, lambda c: _budget(c, sensed))
    return Section("budget", "Where the uncertainty comes from", lead, bodies)


def _budget(candidate: Candidate, sensed: Sensed) -> Html:
    best = candidate.hypothesis
    budget = make_budget(candidate.contacts, sensed, candidate.part, best.T_world_part, best.noise_scale[0])
    if budget is None:
        return element("p", "The readings fix no direction of the pose, so there is nothing to divide.")
    linear, told = budget.total, best.corner_sd
    if not best.unobserved:
        budget = combined(budget, told)
    rows: list[Sequence[Html | str]] = [
        [s.name, s.kind, join([bar(s.share), f" {_share(s.share)}"]), _mm(s.sd), _mm(s.without)] for s in budget.sources
    ]
    rows.append(["together", "", "100 %", f"{MM * budget.total:.2g}", ""])
    headers = ["source", "type", "share of the variance", "alone, 1 sd [mm]", "left without it [mm]"]
    note = element("p", _total(candidate, budget, linear), class_="note")
    return join([table(headers, rows, class_="shares"), note])


def _total(candidate: Candidate, budget: Budget, linear: float) -> str:
    told, free = candidate.hypothesis.corner_sd, candidate.hypothesis.free_motions
    total = uncertain(budget.total)
    if free:
        return f"Together {total}, without what nothing observes: {'; '.join(motion.brief for motion in free)}."
    words = f"Together {total}, the largest corner sd of the answer; expanded (k = 2) {uncertain(2 * told)}."
    if linear > (1 + _DIFFERS) * told:
        return f"{words} To first order it would be {uncertain(linear)}: the sources are scaled to the answer."
    return words


def _share(share: float) -> str:
    return "< 1 %" if share < 0.005 else f"{100 * share:.0f} %"


def _mm(metres: float) -> str:
    return f"{MM * metres:.3g}" if np.isfinite(metres) else "–"
