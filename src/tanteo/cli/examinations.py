"""Format the result of a check of the installation as text and tables."""

from __future__ import annotations

from tanteo.cli.installation import Examination
from tanteo.errors import install_command
from tanteo.render.text import PLAIN, Layout, printable


def examination_lines(found: Examination, version: str, *, layout: Layout = PLAIN) -> list[str]:
    """Return the lines of a check of the installation, the verdict first.

    Args:
        found: result of the check.
        version: version of tanteo.
        layout: width and style of the output.
    """
    missing = [name for name, number in found.versions.items() if not number]
    absent = [extra.name for extra in found.extras if not extra.installed]
    lines = [layout.bold(f"tanteo {version}: {_verdict(found, missing)}"), f"self-test: {printable(_test(found))}", ""]
    rows = [["Python", found.python], *([n, v or "MISSING"] for n, v in found.versions.items())]
    lines += [*layout.table(["needed", "version"], rows, left=(0, 1)), ""]
    rows = [[extra.name, "yes" if extra.installed else "no", extra.gives] for extra in found.extras]
    lines += [*layout.table(["extra", "here", "gives"], rows, left=(0, 1, 2)), ""]
    if found.plugins:
        rows = [
            [p.group, printable(p.name), printable(p.distribution), "no" if p.problem else "yes"] for p in found.plugins
        ]
        lines += [*layout.table(["plug-ins", "name", "distribution", "works"], rows, left=(0, 1, 2, 3)), ""]
        lines += [printable(p.problem) for p in found.plugins if p.problem]
    if absent:
        lines.append(f"To install the missing extras: {install_command(*absent)}")
    folder, writable = found.cache
    lines.append(f"Parts are cached in {printable(folder)}." if writable else _no_cache(folder))
    return lines


def _verdict(found: Examination, missing: list[str]) -> str:
    if missing:
        return f"{', '.join(missing)} not installed. Install tanteo again with pip"
    return "works" if found.ok else "does not work: the self-test failed"


def _test(found: Examination) -> str:
    return f"{'ok' if found.test.ok else 'FAILED'}, {found.test.words} ({found.test.seconds:.2f} s)"


def _no_cache(folder: str) -> str:
    return f"{printable(folder)} cannot be written: parts are read again each time. Set another folder in TANTEO_CACHE."
