"""Implement ``tanteo demo``: run an example session, write its report and open it, or play it on a live page."""

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
from tanteo.cli.printing import print_text
from tanteo.errors import MissingExtraError

if TYPE_CHECKING:
    from tanteo.bench.demo import Seen
    from tanteo.render.html import Section
    from tanteo.render.live import Show

REPORT = "tanteo_demo.html"
NEXT = (
    "Watch it live, or play against the planner: {program} demo --live",
    "Plan for a part of your own: {program} plan --part YOURS.step --goal 0.5mm --sd 0.05mm "
    "--pose-prior '0,0,0mm 0,0,0deg +- 5mm 5deg'",
)
"""Suggestions after the demo; the last one is for a part of the user."""


def demo(
    report: Annotated[str, args.option("--report", "FILE.html", "File of the report.")] = REPORT,
    no_open: Annotated[bool, args.option("--no-open", None, "Do not open the report in a browser.")] = False,
    seed: Annotated[int, args.option("--seed", None, "Seed of the noise of the readings."), args.SEED] = 0,
    live: Annotated[
        bool, args.option("--live", None, "Play the session in a browser, step by step or against the planner.")
    ] = False,
) -> None:
    """Show a recognition from start to end with a simulated part.

    Recognizes one of twelve parts on a table from an image and a laser, with its uncertainty.
    """
    from tanteo.bench.demo import run_demo

    if live and report != REPORT:
        raise MisuseError("--report: expected without --live, which writes no report, got both. Drop one.")
    if live:
        _play(seed, show=not no_open)
        return
    files.check_report(report)
    story = run_demo(print_text, seed)
    facts = [("Corner farthest off the truth", f"{1e3 * story.off:.2f} mm")]
    if story.needed is not None:
        facts += zip(("Readings needed in many tries", "At random places"), story.needed, strict=True)
    more, view = ([], None) if story.seen is None else (_seen(story.seen), story.seen.toward)
    files.report_session(report, story.session, *facts, as_json=False, more=more, view=view)
    for line in NEXT:
        print_text(line.format(program=program_here()))
    if not no_open and sys.stdout.isatty():
        webbrowser.open(Path(report).resolve().as_uri())


def program_here() -> str:
    """Return how to call this program: by its name if the shell finds it, otherwise by the typed path."""
    typed = Path(sys.argv[0])
    known = shutil.which("tanteo") is not None or typed.stem != "tanteo" or not typed.is_file()
    return "tanteo" if known else str(typed)


def _seen(seen: Seen) -> list[Section]:
    """Return sections of the report with the camera's image, and its predictions for the two best parts."""
    from tanteo.render.html import photo_section

    names = [h.part for h in seen.likely[:2]]
    found = (
        "The image with the edges of the most probable part: blue dots where the image has them, orange crosses where "
        "it does not. Two parts remain possible."
    )
    out = [photo_section("seen", "What the camera saw", found, seen.found, "The part on the table, with its edges")]
    if len(names) > 1:
        explanation = (
            f"Left: the image. Middle: its prediction for {names[0]}. Right: for {names[1]}. Orange marks the pixels "
            "in which the two predictions differ, each at its most probable pose. They are too few for a decision."
        )
        caption = f"The image, {names[0]} and {names[1]} side by side, with the pixels in which the two differ"
        title = "Why the image does not decide"
        out.append(photo_section("similar", title, explanation, seen.likenesses, caption))
    return out


def _play(seed: int, *, show: bool) -> None:
    """Play the same scene on a live page until Ctrl-C."""
    from tanteo.bench.demo import set_stage
    from tanteo.cli.view import ready
    from tanteo.hand.simulator import box
    from tanteo.render.live import NEEDS_VISER, play, probe_show

    if find_spec("viser") is None:
        raise MissingExtraError(NEEDS_VISER)
    stage = set_stage()
    table = box("table", [-0.3, -0.3, -0.02], [0.3, 0.3, 0.0])

    def make(seed: int, policy: str) -> Show:
        return probe_show(stage.session(policy, seed), stage.reader(seed), (stage.solid,), (table,))

    with suppress(KeyboardInterrupt):
        play(make, seed, "information", ready=lambda url: ready(url, show=show))
