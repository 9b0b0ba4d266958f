"""``tanteo demo``: tell the story, write its report, open it on a desktop; or play it on a live page."""

from __future__ import annotations

import shutil
import sys
import webbrowser
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import say
from tanteo.errors import MissingExtraError

if TYPE_CHECKING:
    from tanteo.bench import Seen
    from tanteo.render import Section, Show

REPORT = "tanteo_demo.html"
NEXT = (
    "Watch it live, or play against the planner: {program} demo --live",
    "Plan for a part of your own: {program} plan --part YOURS.step --tolerance 0.5mm --sd 0.05mm "
    "--pose-prior '0,0,0mm 0,0,0deg +- 5mm 5deg'",
)
"""What can be done after the story; the last line is about a part of one's own."""


def demo(
    report: Annotated[str, args.option("--report", "FILE.html", "Where to write the report.")] = REPORT,
    no_open: Annotated[bool, args.option("--no-open", None, "Do not open the report in a browser.")] = False,
    seed: Annotated[int, args.option("--seed", None, "Seed of the noise of the readings."), args.SEED] = 0,
    live: Annotated[
        bool, args.option("--live", None, "Play it in a browser instead, step by step, or against the planner.")
    ] = False,
) -> None:
    """Show what this is for, with a part of its own.

    One part of twelve on a table, an image, a laser, and an answer with its spread.
    """
    from tanteo.bench import run_demo

    if live and report != REPORT:
        raise MisuseError("--report: expected without --live, which writes none, got both. Leave one out.")
    if live:
        _play(seed, show=not no_open)
        return
    files.check_report(report)
    story = run_demo(say, seed)
    facts = [("Corner farthest off the truth", f"{1e3 * story.off:.2f} mm")]
    if story.needed is not None:
        facts += zip(("Readings needed in many tries", "At random places"), story.needed, strict=True)
    more, look = ([], None) if story.seen is None else (_seen(story.seen), story.seen.toward)
    files.report_session(report, story.session, *facts, as_json=False, more=more, look=look)
    for line in NEXT:
        say(line.format(program=program_here()))
    if not no_open and sys.stdout.isatty():
        webbrowser.open(Path(report).resolve().as_uri())


def program_here() -> str:
    """How this program is called here: by its name, or by the path that was typed where the name leads nowhere."""
    typed = Path(sys.argv[0])
    known = shutil.which("tanteo") is not None or typed.stem != "tanteo" or not typed.is_file()
    return "tanteo" if known else str(typed)


def _seen(seen: Seen) -> list[Section]:
    """The camera's image, and what it would be of either part, as sections of the report."""
    from tanteo.render import photo_section

    names = [h.part for h in seen.likely[:2]]
    found = (
        "The image with what was found in it: blue dots where it has the edges of the likeliest part, orange crosses "
        "where it has not. It leaves open which of two parts lies there."
    )
    out = [photo_section("seen", "What the camera saw", found, seen.found, "The part on the table, with its edges")]
    if len(names) > 1:
        alike = (
            f"On the left the image, in the middle what it would be of {names[0]}, on the right of {names[1]}. "
            "Orange is all in which the two differ, each at its likeliest pose: too little for the camera."
        )
        said = f"The image, {names[0]} and {names[1]} side by side, with the pixels in which the two differ"
        out.append(photo_section("alike", "Why the camera cannot tell", alike, seen.likenesses, said))
    return out


def _play(seed: int, *, show: bool) -> None:
    """The same scene on a live page, until it is interrupted."""
    from tanteo.bench import set_stage
    from tanteo.cli.view import ready
    from tanteo.hand import box
    from tanteo.render import NEEDS_VISER, play, probe_show

    if find_spec("viser") is None:
        raise MissingExtraError(NEEDS_VISER)
    stage = set_stage()
    table = box("table", [-0.3, -0.3, -0.02], [0.3, 0.3, 0.0])

    def make(seed: int, policy: str) -> Show:
        return probe_show(stage.session(policy, seed), stage.reader(seed), (stage.solid,), (table,))

    with suppress(KeyboardInterrupt):
        play(make, seed, "information", ready=lambda url: ready(url, show=show))
