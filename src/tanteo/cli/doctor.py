"""Implement ``tanteo doctor``: check the installation."""

from __future__ import annotations

from dataclasses import asdict

import typer

from tanteo.cli import arguments as args
from tanteo.cli.printing import emit, layout, put_json


def doctor(json: args.Json = False) -> None:
    """Check the installation.

    Lists versions, extras and plug-ins, and runs a self-test.
    """
    from tanteo import __version__
    from tanteo.cli.examinations import examination_lines
    from tanteo.cli.installation import examine

    found = examine()
    if json:
        put_json({"schema": "tanteo.doctor/1", "version": __version__, "ok": found.ok, **asdict(found)})
    else:
        emit(examination_lines(found, __version__, layout=layout()))
    if not found.ok:
        raise typer.Exit(1)
