"""From an answer or a session to the text of the file; plans have pages of their own."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tanteo.errors import InputError
from tanteo.geometry.typing import Vectors
from tanteo.parts import Part, part_named
from tanteo.planning import Session, explain
from tanteo.posterior import Answer
from tanteo.render.html.answered import answer_front
from tanteo.render.html.combined import budget_section
from tanteo.render.html.contacts import Sensed, find_contacts, gather
from tanteo.render.html.course import course_section, goal_words
from tanteo.render.html.page import Section, make_page
from tanteo.render.html.scene import Candidate, scene_document, shapes_shown
from tanteo.render.html.sections import directions_of, figure_section, rerun_section, residual_section, rests_section
from tanteo.render.html.ways import find_ways
from tanteo.replaced import replaced
from tanteo.sensors import Readings


@dataclass(frozen=True, slots=True)
class Run:
    """Where an answer comes from.

    Attributes:
        command: What to type to get it again.
        made_by: Program and version.
        facts: What else is to stand beside the picture: name and value.
    """

    command: str
    made_by: str = "tanteo"
    facts: tuple[tuple[str, str], ...] = ()


def report_page(answer: Answer, sensed: Sensed, parts: Sequence[Part], run: Run, more: Sequence[Section] = ()) -> str:
    """The report of an answer as the text of one HTML file.

    Args:
        answer: What was found.
        sensed: The readings it was found from; see :func:`tanteo.render.gather`.
        parts: The parts that were tried; those of the hypotheses are needed.
        run: Where it comes from.
        more: Further sections; they stand before the figures.

    Raises:
        InputError: A hypothesis is of a part that is not among ``parts``.
    """
    candidates = _candidates(answer, sensed, parts)
    rests = rests_section(candidates, [directions_of(c, sensed) for c in candidates])
    fit, budget = residual_section(candidates, sensed), budget_section(candidates, sensed)
    return _page(answer, candidates, sensed, run, [fit, rests, budget, *more])


def session_page(session: Session, run: Run, more: Sequence[Section] = (), look: Vectors | None = None) -> str:
    """The report of a session as the text of one HTML file: its answer as of now, and how it came to that.

    Args:
        session: That was told something, or nothing yet.
        run: Where it comes from.
        more: Further sections; they stand first.
        look: Direction from what is drawn to the eye, in the world; None for the usual one.
    """
    answer, told = session.answer(), explain(session.state, session.steps)
    readings = Readings.from_columns(n=0) if session.readings is None else session.readings
    sensed = gather(readings, session.sensing, session.prior)
    candidates = _candidates(answer, sensed, [target.part for target in session.start.targets])
    directions = [told.directions, *(directions_of(c, sensed) for c in candidates[1:])]
    rests = rests_section(candidates, directions[: len(candidates)])
    fit, budget = residual_section(candidates, sensed), budget_section(candidates, sensed)
    sections = [*more, course_section(session, told.added), fit, rests, budget]
    return _page(answer, candidates, sensed, run, sections, goal_words(session.stop), look)


def write_report(path: str | Path, page: str) -> None:
    """Write a page to a file; one of that name is replaced.

    Args:
        path: The HTML file.
        page: Its text, as :func:`report_page` gives it.

    Raises:
        OSError: The file cannot be written.
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
    look: Vectors | None = None,
) -> str:
    made = f"{run.made_by}, seed {answer.seed}; readings: {sensed.source}."
    last = [figure_section(candidates), rerun_section(run.command, made)]
    shapes = shapes_shown(candidates, sensed)
    front = answer_front(answer, candidates, sensed, run.facts, shapes)
    front = replace(front, message=f"{goal} {front.message}".strip())
    return make_page(front, scene_document(candidates, sensed, shapes) | _eye(look), [*sections, *last])


def _eye(look: Vectors | None) -> dict[str, Any]:
    """Turn and tilt of the eye at first."""
    if look is None:
        return {}
    x, y, z = (float(v) for v in look)
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
