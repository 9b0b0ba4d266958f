"""``tanteo demo``. Only the parser is imported here."""

from __future__ import annotations

from typing import Annotated

import typer


def demo(
    report: Annotated[
        str, typer.Option("--report", metavar="FILE.html", help="Where to write the report.")
    ] = "tanteo_demo.html",
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the report in a browser.")] = False,
    seed: Annotated[int, typer.Option("--seed", help="Of the noise of the readings.")] = 0,
) -> None:
    """Show what this is for: one part of twelve on a table, an image, a laser, and an answer with its spread."""
    from tanteo.cli.demonstrating import demonstrate
    from tanteo.cli.options import misuse
    from tanteo.cli.reporting import check_report
    from tanteo.cli.running import guarded
    from tanteo.errors import InputError

    with guarded():
        check_report(report)
        with misuse():
            if seed < 0:
                raise InputError(f"--seed: expected 0 or more, got {seed}. Use 0.")
        demonstrate(report, seed, show=not no_open)
