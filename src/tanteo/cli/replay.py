"""Implement ``tanteo replay``: repeat a recorded session, compare its answer with the recorded one, and print it."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.answer import print_answer, print_status
from tanteo.cli.printing import emit, layout, leave, progress, put, warned
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.planning import Session

_SHOWN = 5
"""Largest number of differences that are listed."""


def replay(
    record: Annotated[str, typer.Argument(metavar="RECORD", help="Record of a session (JSON, or .mcap).")],
    parts: Annotated[
        list[str] | None,
        args.option("--parts", "FILE_OR_FOLDER...", "Current folders of the CAD files, if they were moved."),
    ] = None,
    explain: Annotated[
        bool,
        args.option(
            "--explain", None, "Show the information of each reading, and which readings determine the answer."
        ),
    ] = False,
    report: args.Report = None,
    json: args.Json = False,
    verbose: args.Verbose = False,
) -> None:
    """Repeat a recorded session, and compare the answer.

    Fails if the answer differs from the recorded one.
    """
    files.check_report(report)
    files.check_different(("--report", report), inputs=[("the record", record)])
    begun = time.perf_counter()
    kept, session, loaded = resume(record, parts or [], quiet=json)
    answer, now = session.answer(), time.perf_counter()
    answer = replace(answer, elapsed={"load": loaded - begun, "replay": now - loaded, "total": now - begun})
    how = _compared(kept, answer)
    if explain:
        _print_explained(session, answer, as_json=json, verbose=verbose)
    else:
        print_answer(answer, as_json=json, verbose=verbose)
    if verbose:
        emit([f"The recorded answer was given again {how}."], sys.stderr)
    if report is not None:
        files.report_session(report, session, as_json=json)
    leave(decided=answer.status == "recognized")


def resume(path: str, folders: Sequence[str], *, quiet: bool) -> tuple[io.documents.SessionRecord, Session, float]:
    """Return a record, its session, and the time at which both had been read.

    Args:
        path: file of the record.
        folders: current folders of the CAD files; empty for those in the record.
        quiet: whether to show no progress.
    """
    record = io.load_record(path)
    parts = io.documents.parts_of(record.parts, record.source, folders=folders)
    loaded = time.perf_counter()
    with progress("repeating the session", quiet=quiet) as tick:
        return record, io.documents.resumed(record, parts, tick), loaded


def _print_explained(session: Session, answer: posterior.Answer, *, as_json: bool, verbose: bool) -> None:
    """Print the answer, the information of each reading, and the readings that determine the pose."""
    from tanteo.planning.explanation import explain

    explanation = explain(session.state, session.steps)
    if as_json:
        document = {**io.recognition_document(answer), "explanation": io.documents.explanation_document(explanation)}
        put(io.documents.document_json(document, warned()))
        print_status(answer)
    else:
        print_answer(answer, verbose=verbose)
        emit(["", *render.text.explanation_lines(explanation, layout=layout())])


def _compared(record: io.documents.SessionRecord, answer: posterior.Answer) -> str:
    """Return how exactly an answer equals the recorded one, as text; raise InputError if it differs."""
    from tanteo import __version__

    differ, exact = io.documents.differences(record.answer, io.recognition_document(answer))
    if differ:
        rest = f"; and {len(differ) - _SHOWN} more" if len(differ) > _SHOWN else ""
        raise InputError(
            f"{record.source}: expected the recorded answer again, got another: {'; '.join(differ[:_SHOWN])}{rest}. It "
            f"was written by tanteo {record.version}, this is {__version__}: use that one, or report this."
        )
    return "to the last bit" if exact else "up to rounding"
