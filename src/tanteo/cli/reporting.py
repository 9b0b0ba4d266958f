"""What ``--report`` does: check the name, write the file, say so."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tanteo.cli.options import TYPED, MisuseError, RunOptions
from tanteo.cli.printing import emit, printable
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.matching import PosePrior, Recognition
    from tanteo.parts import Part
    from tanteo.sensors import Readings, Rig

_SUFFIXES = (".html", ".htm")


def check_report(path: str) -> None:
    """Is it a name that can be written; asked before the long work.

    Raises:
        MisuseError: Another suffix, or a folder that is not there.
    """
    file = Path(path)
    if file.suffix.lower() not in _SUFFIXES:
        raise MisuseError(f"--report: expected a file name that ends in .html, got '{path}'. Call it report.html.")
    if file.is_dir() or not file.parent.is_dir():
        raise MisuseError(f"--report: expected a file in a folder that exists, got '{path}'. Make the folder first.")


def report_answer(
    path: str,
    answer: Recognition,
    readings: Readings,
    parts: Sequence[Part],
    rig: Rig | None,
    options: RunOptions,
    pose: PosePrior | None,
    *,
    as_json: bool,
) -> None:
    """Write the report and say where it is; beside JSON on standard error.

    Raises:
        InputError: The file cannot be written.
    """
    from tanteo import __version__
    from tanteo.report import gather, write_report

    sensed = gather(
        readings, sensor=options.sensor, robot=options.robot, sd=options.sd, tip_sd=options.tip_sd, rig=rig,
        tolerance=options.tolerance, prior=pose,
    )  # fmt: skip
    try:
        write_report(path, answer, sensed, parts, command=shlex.join(TYPED.get()), made_by=f"tanteo {__version__}")
    except OSError as error:
        raise InputError(
            f"--report: expected a file that can be written, got '{path}': {error.strerror or error}."
        ) from None
    emit([f"report written: {printable(path)}"], sys.stderr if as_json else sys.stdout)
