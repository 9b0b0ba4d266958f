"""``tanteo replay``. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer

from tanteo.cli.arguments import (
    Report,
)


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
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Say more.")] = False,
) -> None:
    """Give the answer of a recorded session again, and check that it is the same."""
    from tanteo.cli.replaying import run_replay
    from tanteo.cli.running import guarded

    with guarded():
        run_replay(record, parts or [], goodness_of_fit=explain, report=report, as_json=json, verbose=verbose)
