"""What ``--report`` does: check the name, write the file, say so."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tanteo.cli.options import TYPED, RunOptions
from tanteo.cli.printing import emit, printable
from tanteo.cli.targets import check_target, writing

if TYPE_CHECKING:
    from tanteo.answers import Answer, PosePrior
    from tanteo.parts import Part
    from tanteo.report import Run
    from tanteo.sensors import Readings, Rig
    from tanteo.session import Session


def check_report(path: str | None) -> None:
    """Is it a name that can be written; asked before the long work: :func:`check_target`. None is no report."""
    check_target("--report", path, (".html", ".htm"))


def report_answer(
    path: str,
    answer: Answer,
    readings: Readings,
    parts: Sequence[Part],
    rig: Rig | None,
    options: RunOptions,
    pose: PosePrior | None,
    *,
    as_json: bool,
) -> None:
    """Report an answer of ``identify`` or ``locate``."""
    from tanteo.report import gather, report_page
    from tanteo.session import Sensing

    sensing = Sensing(options.sensor, options.robot, options.sd, options.tip_sd, rig, options.tolerance)
    page = report_page(answer, gather(readings, sensing, pose), parts, this_run())
    write_page(path, page, as_json=as_json)


def report_session(path: str, session: Session, *facts: tuple[str, str], as_json: bool) -> None:
    """Report a session: its answer, and how it came to that."""
    from tanteo.report import session_page

    write_page(path, session_page(session, this_run(*facts)), as_json=as_json)


def this_run(*facts: tuple[str, str]) -> Run:
    """The command that runs now, as a report says it.

    Args:
        facts: What else is to stand beside the picture: name and value.
    """
    from tanteo import __version__
    from tanteo.report import Run

    return Run(shlex.join(TYPED.get()), f"tanteo {__version__}", facts)


def write_page(path: str, page: str, *, as_json: bool) -> None:
    """Write a report and say where it is; beside JSON on standard error.

    Raises:
        InputError: The file cannot be written.
    """
    from tanteo.report import write_report

    with writing("--report", path):
        write_report(path, page)
    emit([f"report written: {printable(path)}"], sys.stderr if as_json else sys.stdout)
