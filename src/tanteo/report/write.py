"""From an answer to the file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tanteo.errors import InputError
from tanteo.matching import Recognition
from tanteo.parts import Part
from tanteo.report.contacts import find_contacts
from tanteo.report.ghosts import find_ways
from tanteo.report.page import make_page
from tanteo.report.scene import Candidate, scene_document
from tanteo.report.section import Section
from tanteo.report.sections import budget_section, figure_section, rerun_section, residual_section
from tanteo.report.sensed import Sensed


def report_page(
    answer: Recognition,
    sensed: Sensed,
    parts: Sequence[Part],
    *,
    command: str,
    made_by: str = "tanteo",
    more: Sequence[Section] = (),
) -> str:
    """The report as the text of one HTML file.

    Args:
        answer: What was found.
        sensed: The readings it was found from; see :func:`tanteo.report.gather`.
        parts: The parts that were tried; those of the hypotheses are needed.
        command: What to type to get the answer again.
        made_by: Program and version.
        more: Further sections; they stand before the figures.

    Raises:
        InputError: A hypothesis is of a part that is not among ``parts``.
    """
    candidates = [_candidate(answer, k, sensed, parts) for k in range(len(answer.hypotheses))]
    sections = [residual_section(candidates, sensed), budget_section(candidates, sensed), *more]
    made = f"{made_by}, seed {answer.seed}; readings: {sensed.source}."
    sections += [figure_section(candidates), rerun_section(command, made)]
    return make_page(answer, candidates, sensed, scene_document(candidates, sensed), sections)


def write_report(
    path: str | Path,
    answer: Recognition,
    sensed: Sensed,
    parts: Sequence[Part],
    *,
    command: str,
    made_by: str = "tanteo",
    more: Sequence[Section] = (),
) -> None:
    """Write the report; a file of that name is replaced.

    Args:
        path: The HTML file.
        answer: What was found.
        sensed: The readings it was found from.
        parts: The parts that were tried.
        command: What to type to get the answer again.
        made_by: Program and version.
        more: Further sections.

    Raises:
        InputError: A hypothesis is of a part that is not among ``parts``.
        OSError: The file cannot be written.
    """
    text = report_page(answer, sensed, parts, command=command, made_by=made_by, more=more)
    Path(path).write_text(text, encoding="utf-8", newline="\n")


def _candidate(answer: Recognition, k: int, sensed: Sensed, parts: Sequence[Part]) -> Candidate:
    hypothesis = answer.hypotheses[k]
    part = next((p for p in parts if p.name == hypothesis.part), None)
    if part is None:
        raise InputError(f"parts: expected '{hypothesis.part}' among them, got {len(parts)} others. Pass all of them.")
    ways, enlarged = find_ways(hypothesis, part)
    return Candidate(hypothesis, part, find_contacts(sensed, part, hypothesis), ways, enlarged)
