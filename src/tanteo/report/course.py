"""How the belief went: one row a reading, with the probabilities and the worst corner after it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.report.charts import bar
from tanteo.report.html import Html, element, join, table
from tanteo.report.section import Section
from tanteo.report.words import percent
from tanteo.session import Step

_LEADING = 2
"""Parts shown in each row: those that ever led come first."""


def course_section(steps: Sequence[Step], names: Sequence[str]) -> Section:
    """What every reading told.

    Args:
        steps: of the session, in order.
        names: of the parts, in the order of the session's start.
    """
    shown = _leading(steps)
    headers = ("reading", "asked at", *(names[k] for k in shown), "none of these", "worst corner, 1 sd")
    rows: list[tuple[Html | str, ...]] = [
        (
            ", ".join(step.ids) or "told before",
            "not asked for" if step.action is None else f"{step.action.face} of {step.action.part}",
            *(_share(step.probabilities[k]) for k in shown),
            _share(step.unknown),
            "" if np.isnan(step.worst_corner_sd) else f"{1e3 * step.worst_corner_sd:.3g} mm",
        )
        for step in steps
    ]
    lead = "Each row is after its reading: how probable each part is, and how well its worst corner is known."
    return Section("course", "How it went", lead, (table(headers, rows, class_="shares"),) if rows else ())


def _leading(steps: Sequence[Step]) -> list[int]:
    """Parts that led after some reading, the last first; and the strongest others."""
    if not steps:
        return []
    led = [int(np.argmax(step.probabilities)) for step in reversed(steps)]
    strongest = np.argsort(-np.max([step.probabilities for step in steps], axis=0), kind="stable").tolist()
    return list(dict.fromkeys([*led, *strongest]))[: max(_LEADING, 1)]


def _share(p: float) -> Html:
    return join([bar(float(p)), element("span", f" {percent(float(p))}")])
