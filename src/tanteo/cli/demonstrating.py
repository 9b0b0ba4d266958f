"""What ``tanteo demo`` does: tell the story, write its report, open it on a desktop."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path

from tanteo.cli.printing import emit, printable
from tanteo.errors import InputError


def demonstrate(report: str, seed: int, *, show: bool) -> None:
    """Run the demo.

    Args:
        report: the file to write.
        seed: of the noise.
        show: open the report, if this is a terminal and there is a browser.
    """
    from tanteo import __version__
    from tanteo.demo import tell
    from tanteo.report import course_section, gather, write_report

    told = tell(lambda line: emit([printable(line)]), seed)
    sensed = gather(told.readings, sd=told.sensing.sd, prior=told.prior)
    more = [course_section(told.steps, told.names)]
    command = f"tanteo demo --seed {seed}"
    try:
        write_report(
            report, told.answer, sensed, told.parts, command=command, made_by=f"tanteo {__version__}", more=more
        )
    except OSError as error:
        raise InputError(
            f"--report: expected a file that can be written, got '{report}': {error.strerror or error}."
        ) from None
    emit([f"Report: {printable(report)}"])
    if show and sys.stdout.isatty():
        webbrowser.open(Path(report).resolve().as_uri())
