"""The sections that every answer has: fit of the readings, uncertainty budget, how to run it again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.report.budget import Budget, make_budget
from tanteo.report.charts import bar, residual_chart
from tanteo.report.html import Html, element, join, table
from tanteo.report.scene import Candidate
from tanteo.report.section import Section, per_hypothesis
from tanteo.report.sensed import Sensed
from tanteo.report.words import MM, length
from tanteo.typing import IntArray

_MOST_ROWS = 300
"""Of a table or chart of readings."""

_DIFFERS = 0.15
"""A budget that is off the answer's figure by more says so."""


def residual_section(candidates: Sequence[Candidate], sensed: Sensed) -> Section:
    """Every reading's distance to the surface."""
    lead = (
        "Each dot is a reading: its distance to the surface of the part, in standard deviations of its noise. Inside "
        "the band they are as good as stated; a cross is a reading that the answer leaves out because it does not fit."
    )
    return Section("fit", "How the readings fit", lead, per_hypothesis(candidates, lambda c: _residuals(c, sensed)))


def _residuals(candidate: Candidate, sensed: Sensed) -> Html:
    contacts, ids = candidate.contacts, sensed.measured.ids
    rows = _rows(candidate)
    sds = contacts.distances / contacts.sds
    words = [_reading_words(candidate, sensed, i) for i in rows]
    chart = residual_chart([ids[i] for i in rows], sds[rows], ~contacts.used[rows], words)
    cells = [
        [
            ids[i],
            "fits" if contacts.used[i] else element("strong", "✕ does not fit", class_="wrong"),
            f"{MM * contacts.distances[i]:+.3g}",
            f"{MM * contacts.sds[i]:.3g}",
            f"{round(sds[i], 1) + 0.0:+.1f}",
            sensed.measured.features[i] or "–",
            contacts.met[i],
        ]
        for i in rows
    ]
    headers = ["reading", "", "distance [mm]", "1 sd [mm]", "in sds", "label", "met"]
    details = element("details", element("summary", "All readings as a table"), table(headers, cells, class_="plain"))
    if len(rows) == len(ids):
        return join([chart, details])
    note = f"{len(rows)} of {len(ids)} readings are shown, among them those that do not fit."
    return join([chart, element("p", note, class_="note"), details])


def _reading_words(candidate: Candidate, sensed: Sensed, i: int) -> str:
    contacts = candidate.contacts
    verdict = "fits" if contacts.used[i] else "does not fit"
    return f"reading {sensed.measured.ids[i]}, {contacts.met[i]}: {MM * contacts.distances[i]:+.3g} mm, {verdict}"


def _rows(candidate: Candidate) -> IntArray:
    n = len(candidate.contacts.used)
    if n <= _MOST_ROWS:
        return np.arange(n)
    wrong = np.flatnonzero(~candidate.contacts.used)[: _MOST_ROWS // 2]
    return np.unique(np.concatenate([np.linspace(0, n - 1, _MOST_ROWS // 2).astype(np.int64), wrong]))


def budget_section(candidates: Sequence[Candidate], sensed: Sensed) -> Section:
    """Sensor, robot, shared errors, part."""
    lead = (
        "Shares of the variance at the corner of the part's box that is known worst. More readings shrink the noise; "
        "errors that all readings share stay, until they are calibrated. Where such an error has to be "
        "estimated from the same readings, it costs more than its share: see what is left without it."
    )
    bodies = per_hypothesis(candidates, lambda c: _budget(c, sensed))
    return Section("budget", "Where the uncertainty comes from", lead, bodies)


def _budget(candidate: Candidate, sensed: Sensed) -> Html:
    budget = make_budget(candidate.contacts, sensed, candidate.part, candidate.hypothesis.T_world_part)
    if budget is None:
        return element("p", "The readings fix no direction of the pose, so there is nothing to divide.")
    rows: list[Sequence[Html | str]] = [
        [s.name, join([bar(s.share), f" {_share(s.share)}"]), _mm(s.sd), _mm(s.without)] for s in budget.sources
    ]
    headers = ["source", "share of the variance", "alone, 1 sd [mm]", "left without it [mm]"]
    return join([table(headers, rows, class_="shares"), element("p", _total(candidate, budget), class_="note")])


def _total(candidate: Candidate, budget: Budget) -> str:
    told, free = candidate.hypothesis.corner_sd, candidate.hypothesis.unobserved
    words = f"Together {length(budget.total)} at the largest corner sd, one standard deviation"
    if free:
        return f"{words}; without what nothing observes: {'; '.join(free)}."
    if abs(budget.total - told) > _DIFFERS * told:
        return f"{words}; the answer says {length(told)}, which also has what a linear budget cannot see."
    return f"{words}."


def _share(share: float) -> str:
    return "< 1 %" if share < 0.005 else f"{100 * share:.0f} %"


def _mm(metres: float) -> str:
    return f"{MM * metres:.3g}" if np.isfinite(metres) else "–"


def rerun_section(command: str, made: str) -> Section:
    """How to get the same again."""
    body = join(
        [
            element("pre", element("code", command, id="command"), tabindex="0"),
            element("button", "Copy", type="button", id="copy", aria_label="Copy the command"),
            element("p", made, class_="note"),
        ]
    )
    return Section("rerun", "Run it again", "The same files and options give the same answer.", (body,))
