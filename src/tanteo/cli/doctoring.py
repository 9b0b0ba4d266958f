"""``tanteo doctor`` in words and as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from tanteo.cli.printing import bold, emit, printable, put, table

if TYPE_CHECKING:
    from tanteo.doctor import Examination


def run_doctor(*, as_json: bool) -> None:
    """Examine, print; exits with 1 if something that is needed is missing or fails."""
    from tanteo import __version__
    from tanteo.doctor import examine

    found = examine()
    if as_json:
        document = {"schema": "tanteo.doctor/1", "version": __version__, "ok": found.ok, **asdict(found)}
        put(json.dumps(document, indent=2) + "\n")
    else:
        emit(doctor_lines(found, __version__))
    if not found.ok:
        raise typer.Exit(1)


def doctor_lines(found: Examination, version: str) -> list[str]:
    """The verdict first, then what is there and what is not."""
    from tanteo.doctor import install_command

    missing = [name for name, number in found.versions.items() if not number]
    absent = [extra.name for extra in found.extras if not extra.installed]
    lines = [bold(f"tanteo {version}: {_verdict(found, missing)}"), f"self-test: {printable(_test(found))}", ""]
    rows = [["Python", found.python], *([n, v or "MISSING"] for n, v in found.versions.items())]
    lines += [*table(["needed", "version"], rows, left=(0, 1)), ""]
    rows = [[extra.name, "yes" if extra.installed else "no", extra.gives] for extra in found.extras]
    lines += [*table(["extra", "here", "gives"], rows, left=(0, 1, 2)), ""]
    if absent:
        lines.append(f"To have the rest: {install_command(absent)}")
    folder, writable = found.cache
    lines.append(f"Parts are remembered in {printable(folder)}." if writable else _no_cache(folder))
    return lines


def _verdict(found: Examination, missing: list[str]) -> str:
    if missing:
        return f"{', '.join(missing)} not installed. Install tanteo again with pip"
    return "works" if found.ok else "does not work: the self-test failed"


def _test(found: Examination) -> str:
    return f"{'ok' if found.test.ok else 'FAILED'}, {found.test.words} ({found.test.seconds:.2f} s)"


def _no_cache(folder: str) -> str:
    return f"{printable(folder)} cannot be written: parts are read anew each time. Name another in TANTEO_CACHE."
