"""The sections that every answer has: fit of the readings, uncertainty budget, all figures, how to run it again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.lie import SO3
from tanteo.report.budget import Budget, make_budget
from tanteo.report.charts import bar, residual_chart
from tanteo.report.html import Html, element, join, table
from tanteo.report.scene import Candidate
from tanteo.report.section import Section, per_hypothesis
from tanteo.report.sensed import Sensed
from tanteo.report.words import MM, fixed, length
from tanteo.typing import FloatArray, IntArray

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
            sensed.measured.features[i] or "–",
            contacts.met[i],
            f"{MM * contacts.distances[i]:+.3g}",
            f"{MM * contacts.sds[i]:.3g}",
            f"{sds[i]:+.1f}",
            "fits" if contacts.used[i] else element("strong", "✕ does not fit", class_="wrong"),
        ]
        for i in rows
    ]
    headers = ["reading", "label", "met", "distance [mm]", "1 sd [mm]", "in sds", ""]
    details = element("details", element("summary", "All readings as a table"), table(headers, cells))
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
        "Shares of the variance of the worst corner of the part's box. More readings shrink the noise; errors that all "
        "readings share stay, until they are calibrated. Where such an error has to be estimated from the same "
        "readings, it costs more than its share: see what is left without it."
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
    told, free = candidate.hypothesis.worst_corner_sd, candidate.hypothesis.unobserved
    words = f"Together {length(budget.total)} at the worst corner, one standard deviation"
    if free:
        return f"{words}; without what nothing observes: {'; '.join(free)}."
    if abs(budget.total - told) > _DIFFERS * told:
        return f"{words}; the answer says {length(told)}, which also has what a linear budget cannot see."
    return f"{words}."


def _share(share: float) -> str:
    return "< 1 %" if share < 0.005 else f"{100 * share:.0f} %"


def figure_section(candidates: Sequence[Candidate]) -> Section:
    """Pose and covariance with frames and units."""
    lead = "The pose maps points of the part to the world. Every figure names its frame and its unit."
    return Section("figures", "All figures", lead, per_hypothesis(candidates, _figures))


def _figures(candidate: Candidate) -> Html:
    h = candidate.hypothesis
    T, C = h.T_world_part, h.covariance
    R = T[:3, :3]
    in_world = np.sqrt(np.diag(R @ C[:3, :3] @ R.T))
    sds, q = np.sqrt(np.diag(C)), SO3.as_quaternion(R)
    rows: list[Sequence[Html | str]] = [
        [f"{axis} of the part's origin", f"{fixed(MM * p, 3)} ± {MM * s:.3g}", "mm", "world"]
        for axis, p, s in zip("xyz", T[:3, 3], in_world, strict=True)
    ]
    rows += [["quaternion w, x, y, z", ", ".join(fixed(v, 6) for v in q), "–", "part to world"]]
    rows += [
        [f"turn about {axis}, 1 sd", f"{np.degrees(s):.3g}", "deg", "part"]
        for axis, s in zip("xyz", sds[3:], strict=True)
    ]
    rows += [
        ["worst corner of the box, 1 sd", f"{MM * h.worst_corner_sd:.3g}", "mm", "any direction"],
        ["rms distance of readings", f"{MM * h.rms:.3g}", "mm", "–"],
        ["chi-square", f"{h.chi2:.3g} with {h.dof} degrees of freedom", "–", "–"],
        ["p-value", f"{h.p_value:.3g}", "–", "–"],
    ]
    pose = table(["", "x", "y", "z", "position"], _matrix(["row x", "row y", "row z", "row 4"], T, "{:.9g}"))
    names = ["x", "y", "z", "rx", "ry", "rz"]
    covariance = table(["", *names], _matrix(names, C, "{:.3e}"))
    return join(
        [
            table(["figure", "value", "unit", "frame"], rows),
            element("details", element("summary", "Pose as a matrix [m]"), pose),
            element("details", element("summary", "Covariance [m, rad], part frame, right perturbation"), covariance),
            element("p", f"CAD file: {h.file}", class_="note"),
        ]
    )


def _matrix(names: Sequence[str], M: FloatArray, form: str) -> list[list[str]]:
    return [[name, *(form.format(v) for v in row)] for name, row in zip(names, M, strict=True)]


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
