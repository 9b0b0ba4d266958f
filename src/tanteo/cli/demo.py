"""``tanteo demo``: tell the story, write its report, open it on a desktop."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.printing import say

if TYPE_CHECKING:
    from tanteo.report import Section


def demo(
    report: Annotated[str, args.option("--report", "FILE.html", "Where to write the report.")] = "tanteo_demo.html",
    no_open: Annotated[bool, args.option("--no-open", None, "Do not open the report in a browser.")] = False,
    seed: Annotated[int, args.option("--seed", None, "Of the noise of the readings."), args.SEED] = 0,
) -> None:
    """Show what this is for: one part of twelve on a table, an image, a laser, and an answer with its spread."""
    from tanteo.demo import tell

    files.check_report(report)
    story = tell(say, seed)
    facts = [("Corner farthest off the truth", f"{1e3 * story.off:.2f} mm")]
    if story.needed is not None:
        facts += zip(("Readings needed in many tries", "At random places"), story.needed, strict=True)
    more = [] if story.picture is None else [_seen(story.picture)]
    files.report_session(report, story.session, *facts, as_json=False, more=more)
    if not no_open and sys.stdout.isatty():
        webbrowser.open(Path(report).resolve().as_uri())


def _seen(png: bytes) -> Section:
    """The camera's image, as a section of the report."""
    from tanteo.report import photo_section

    lead = (
        "The image with what was found in it: blue dots where it has the edges of the likeliest part, orange crosses "
        "where it has not. It leaves open which of two parts lies there: they differ in their step alone."
    )
    return photo_section("seen", "What the camera saw", lead, png, "The part on the table, with the edges that fit")
