"""What ``tanteo demo`` does: tell the story, write its report, open it on a desktop."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path

from tanteo.cli.printing import emit, printable


def demonstrate(report: str, seed: int, *, show: bool) -> None:
    """Run the demo.

    Args:
        report: the file to write.
        seed: of the noise.
        show: open the report, if this is a terminal and there is a browser.
    """
    from tanteo.cli.reporting import report_session
    from tanteo.demo import tell

    told = tell(lambda line: emit([printable(line)]), seed)
    facts = (
        ("Truly off by, largest corner sd", f"{1e3 * told.off:.2f} mm"),
        ("Readings at random for the same", told.random),
    )
    report_session(report, told.session, *facts, as_json=False)
    if show and sys.stdout.isatty():
        webbrowser.open(Path(report).resolve().as_uri())
