"""Reports of answers and sessions as text of HTML files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tanteo.errors import InputError
from tanteo.geometry.typing import Vectors
from tanteo.parts import Part, part_named
from tanteo.planning import Session
from tanteo.planning.explanation import explain
from tanteo.posterior import Answer
from tanteo.render.html.answered import answer_front
from tanteo.render.html.combined import budget_section
from tanteo.render.html.contacts import Sensed, find_contacts, gather
from tanteo.render.html.course import course_section, goal_words
from tanteo.render.html.distinctive import distinction_of, with_distinction
from tanteo.render.html.origin import Run
from tanteo.render.html.page import Section, make_page
from tanteo.render.html.scene import Candidate, scene_document, shapes_shown
from tanteo.render.html.sections import directions_of, figure_section, rerun_section, residual_section, rests_section
from tanteo.render.html.ways import find_ways
from tanteo.replaced import replaced
from tanteo.sensors import Readings


def report_page(answer: Answer, sensed: Sensed, parts: Sequence[Part], run: Run, more: Sequence[Section] = ()) -> str:
    """Return the report of an answer as the text of one HTML file.

    Args:
        answer: answer to report.
        sensed: readings of the answer, see :func:`tanteo.render.html.gather`.
        parts: candidate parts, at least those of the hypotheses.
        run: origin of the answer.
        more: further sections before the figures.

    Raises:
        InputError: the part of a hypothesis is not in ``parts``.
    """
    candidates = _candidates(answer, sensed, parts)
    rests = rests_section(candidates, [directions_of(c, sensed) for c in candidates])
    fit, budget = residual_section(candidates, sensed), budget_section(candidates, sensed)
    return _page(answer, candidates, sensed, run, [fit, rests, budget, *more])


def session_page(session: Session, run: Run, more: Sequence[Section] = (), eye_direction: Vectors | None = None) -> str:
    """Return the report of a session, with its current answer and its steps, as the text of one HTML file.

    Args:
        session: session, which may have no readings.
        run: origin of the session.
        more: further sections before all others.
        eye_direction: direction from the drawn part to the viewer, world frame ``(3,)``; None for the default.
    """
    answer, explanation = session.answer(), explain(session.state, session.steps)
    readings = Readings.from_columns(n=0) if session.readings is None else session.readings
    sensed = gather(readings, session.sensing, session.prior)
    candidates = _candidates(answer, sensed, [target.part for target in session.start.targets])
    directions = [explanation.directions, *(directions_of(c, sensed) for c in candidates[1:])]
    rests = rests_section(candidates, directions[: len(candidates)])
    fit, budget = residual_section(candidates, sensed), budget_section(candidates, sensed)
    sections = [*more, course_section(session, explanation.added), fit, rests, budget]
    return _page(answer, candidates, sensed, run, sections, goal_words(session.stop), eye_direction)


def write_report(path: str | Path, page: str) -> None:
    """Write a page to a file; an existing file is replaced.

    Args:
        path: HTML file.
        page: text of the page, see :func:`report_page`.

    Raises:
        OSError: the file cannot be written.
    """
    with replaced(path) as file:
        file.write_text(page, encoding="utf-8", newline="\n")


def _page(
    answer: Answer,
    candidates: Sequence[Candidate],
    sensed: Sensed,
    run: Run,
    sections: Sequence[Section],
    goal: str = "",
    eye_direction: Vectors | None = None,
) -> str:
    made = f"{run.made_by}, seed {answer.seed}; readings: {sensed.source}."
    last = [figure_section(candidates, answer), rerun_section(run, made)]
    shapes = shapes_shown(candidates, sensed)
    distinction = distinction_of(answer, candidates)
    front = answer_front(answer, candidates, sensed, run.facts, shapes, distinction)
    front = replace(front, message=f"{goal} {front.message}".strip())
    drawn = with_distinction(scene_document(candidates, sensed, shapes), candidates, distinction)
    return make_page(front, drawn | _eye(eye_direction), [*sections, *last])


def _eye(eye_direction: Vectors | None) -> dict[str, Any]:
    """Return azimuth and elevation of the initial view."""
    if eye_direction is None:
        return {}
    x, y, z = (float(v) for v in eye_direction)
    return {"look": [math.atan2(y, x), math.atan2(z, math.hypot(x, y))]}


def _candidates(answer: Answer, sensed: Sensed, parts: Sequence[Part]) -> list[Candidate]:
    out = []
    for h in answer.hypotheses:
        part = part_named(parts, h.part)
        if part is None:
            raise InputError(f"parts: expected '{h.part}' among them, got {len(parts)} others. Pass all of them.")
        ways, enlarged = find_ways(part, h.T_world_part, h.covariance)
        out.append(Candidate(h, part, find_contacts(sensed, part, h), ways, enlarged))
    return out
