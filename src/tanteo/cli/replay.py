"""``tanteo replay``: read a record and its parts, give everything to a session again, compare, print."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo.cli.arguments import Json, Report, Verbose
from tanteo.cli.printing import bold, emit, printable, progress, put, table, warned
from tanteo.cli.running import UNDECIDED
from tanteo.cli.targets import check_different
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.active import Added, Direction, Explanation
    from tanteo.answers import Answer
    from tanteo.io import SessionRecord

_NOTABLE = 0.05
"""Share of the information on a direction from which a reading is named."""

_SHOWN = 5
"""Differences that are listed."""


def replay(
    record: Annotated[str, typer.Argument(metavar="RECORD", help="Record of a session (JSON).")],
    parts: Annotated[
        list[str] | None,
        typer.Option(
            "--parts", metavar="FILE_OR_FOLDER...", help="Where the CAD files are now, if not where they were."
        ),
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Say what each reading told and what the answer rests on.")
    ] = False,
    report: Report = None,
    json: Json = False,
    verbose: Verbose = False,
) -> None:
    """Give the answer of a recorded session again, and check that it is the same."""
    from tanteo.cli.running import guarded

    with guarded():
        run_replay(record, parts or [], explained=explain, report=report, as_json=json, verbose=verbose)


def run_replay(
    path: str,
    folders: Sequence[str],
    *,
    explained: bool,
    report: str | None = None,
    as_json: bool,
    verbose: bool,
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
    told = explain(session.state, session.steps) if explained else None
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


def explain_lines(explanation: Explanation) -> list[str]:
    """The lines for a person."""
    if not explanation.added:
        return ["Nothing was told, so there is nothing to explain."]
    headers = ["reading", "met", "part nats", "pose nats", "corner mm", "likeliest", "P", "what it narrowed most", "to"]
    lines = [bold("What each reading told:")]
    lines += table(headers, [_step(a) for a in explanation.added], left=(0, 1, 5, 7), indent=2)
    if explanation.directions:
        lines += ["", bold(f"What the pose of {explanation.part} rests on, the worst known direction first:")]
        headers = ["direction", "corners mm", "readings", "prior pose"]
        lines += table(headers, [_direction(d) for d in explanation.directions], left=(0, 2), indent=2)
    return lines


def _step(a: Added) -> list[str]:
    met = ", ".join(dict.fromkeys(a.met)) or "told before"
    return [
        ", ".join(a.ids) or "-", met, _number(a.about_part, "{:.2f}"), _number(a.about_pose, "{:.2f}"),
        _number(1e3 * a.corner_sd, "{:.3g}"), a.part or "unknown object", _percent(a.probability),
        a.motion or "-", _percent(a.narrowed),
    ]  # fmt: skip


def _direction(d: Direction) -> list[str]:
    named = [f"{name} {_percent(share)}" for name, share in d.shares if share >= _NOTABLE]
    return [d.motion, f"{1e3 * d.moves:.3g}", ", ".join(named) or "-", _percent(d.prior)]


def _number(value: float, form: str) -> str:
    return form.format(value) if math.isfinite(value) else "-"


def _percent(share: float) -> str:
    if not math.isfinite(share):
        return "-"
    if share > 0.9995:
        return "> 99.9 %"
    return "< 0.1 %" if share < 0.0005 else f"{100 * share:.1f} %"
