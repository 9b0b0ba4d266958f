"""Run the command line: parse arguments, call the public functions, print. ``tanteo.cli:main`` is the entry point."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from lazy_loader import attach  # type: ignore[import-untyped]

if TYPE_CHECKING:
    from tanteo.cli import app, demo, installation, printing, session_record

__getattr__, __dir__, _ = attach(__name__, ["app", "demo", "installation", "printing", "session_record"])


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line and exit with 0 answered, 1 failed, 2 misused, 3 ambiguous, unknown or insufficient.

    Args:
        argv: arguments without the program's name; None for those of the process.

    Raises:
        SystemExit: always; with 130 after an interruption.
    """
    try:
        from tanteo.cli.app import app, spread_values  # inside, so that Ctrl-C while modules load is handled
        from tanteo.cli.files import TYPED
        from tanteo.cli.misuse import MisuseError
        from tanteo.cli.ros_arguments import without_ros_args

        _open_streams()
        try:
            typed = without_ros_args(sys.argv[1:] if argv is None else argv)
        except MisuseError as error:
            print(f"error: {error}", file=sys.stderr)
            sys.exit(2)
        TYPED.set(("tanteo", *typed))
        app(args=spread_values(typed), prog_name="tanteo")
    except KeyboardInterrupt:
        sys.exit(130)


def _open_streams() -> None:
    """Replace streams that the caller has closed (``>&-``) by ones that discard all output."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))


__all__ = ["app", "demo", "installation", "main", "printing", "session_record"]
