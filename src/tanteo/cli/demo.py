"""``tanteo demo``: tell the story, write its report, open it on a desktop."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from tanteo.cli.printing import emit, printable


def demo(
    report: Annotated[
        str, typer.Option("--report", metavar="FILE.html", help="Where to write the report.")
    ] = "tanteo_demo.html",
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the report in a browser.")] = False,
    seed: Annotated[int, typer.Option("--seed", help="Of the noise of the readings.")] = 0,
) -> None:
    """Show what this is for: one part of twelve on a table, an image, a laser, and an answer with its spread."""
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


def demonstrate(report: str, seed: int, *, show: bool) -> None:
    """Run the demo.

    Args:
        report: the file to write.
        seed: of the noise.
        show: open the report, if this is a terminal and there is a browser.
    """
    from tanteo.cli.reporting import report_session
    from tanteo.demo import tell

    story = tell(lambda line: emit([printable(line)]), seed)
    facts = (
        ("Corner farthest off the truth", f"{1e3 * story.off:.2f} mm"),
        ("Readings at random for the same", story.random),
    )
    report_session(report, story.session, *facts, as_json=False)
    if show and sys.stdout.isatty():
        webbrowser.open(Path(report).resolve().as_uri())
