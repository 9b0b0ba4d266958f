"""What ``tanteo replay`` does: read the record and its parts, tell everything again, compare, print."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from tanteo.cli.printing import emit, printable, progress, put, warned
from tanteo.cli.running import UNDECIDED
from tanteo.cli.targets import check_different
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.active import Explanation
    from tanteo.answers import Answer
    from tanteo.io import SessionRecord

_SHOWN = 5
"""Differences that are listed."""


def run_replay(
    path: str, folders: Sequence[str], *, goodness_of_fit: bool, report: str | None = None, as_json: bool, verbose: bool
) -> None:
    """Print the answer of a record, write its report; exits with 3 when it is not decided.

    Raises:
        InputError: the record or a part of it is not what it was, or the answer is not the recorded one.
    """
    from tanteo.active import explain
    from tanteo.cli.reporting import check_report, report_session
    from tanteo.io import load_record, parts_of, resumed

    check_report(report)
    check_different(("--report", report), inputs=[("the record", path)])
    begun = time.perf_counter()
    record = load_record(path)
    parts = parts_of(record.parts, record.source, folders=folders)
    loaded = time.perf_counter()
    with progress("telling again", quiet=as_json) as tick:
        session = resumed(record, parts, tick)
    answer, now = session.answer(), time.perf_counter()
    answer = replace(answer, elapsed={"load": loaded - begun, "replay": now - loaded, "total": now - begun})
    told = explain(session.state, session.steps) if goodness_of_fit else None
    how = _compared(record, answer)
    _print(answer, told, as_json=as_json, verbose=verbose)
    if verbose:
        emit([f"The recorded answer was given again {how}."], sys.stderr)
    if report is not None:
        report_session(report, session, as_json=as_json)
    if answer.status != "recognized":
        raise typer.Exit(UNDECIDED)


def _print(answer: Answer, told: Explanation | None, *, as_json: bool, verbose: bool) -> None:
    if as_json:
        from tanteo.io import document_json, explanation_document, recognition_document

        document = recognition_document(answer)
        if told is not None:
            document["explanation"] = explanation_document(told)
        put(document_json(document, warned()))
        if answer.status != "recognized":
            emit([f"{answer.status}: {printable(answer.message)}"], sys.stderr)
        return
    from tanteo.cli.answer import answer_lines
    from tanteo.cli.explain_text import explain_lines

    emit(answer_lines(answer, verbose=verbose))
    if told is not None:
        emit(["", *explain_lines(told)])


def _compared(record: SessionRecord, answer: Answer) -> str:
    """How exactly this is the recorded answer, in words.

    Raises:
        InputError: it is another.
    """
    from tanteo import __version__
    from tanteo.io import differences, recognition_document

    differ, exact = differences(record.answer, recognition_document(answer))
    if differ:
        rest = f"; and {len(differ) - _SHOWN} more" if len(differ) > _SHOWN else ""
        raise InputError(
            f"{record.source}: expected the recorded answer again, got another: {'; '.join(differ[:_SHOWN])}{rest}. It "
            f"was written by tanteo {record.version}, this is {__version__}: use that one, or report this."
        )
    return "to the last bit" if exact else "up to rounding"
