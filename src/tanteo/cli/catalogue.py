"""Implement ``tanteo catalogue``: many parts on disk, prepared for recognition."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import render
from tanteo.cli import arguments as args
from tanteo.cli.misuse import MisuseError, misuse, with_units_option
from tanteo.cli.printing import complain, emit, layout, print_text, progress, put_json
from tanteo.errors import PartError, UnitError

if TYPE_CHECKING:
    from tanteo.catalogue import Built

_Paths = Annotated[list[str], typer.Argument(metavar="FILE_OR_FOLDER...", help="CAD files or folders of them.")]
_Folder = Annotated[str, typer.Argument(metavar="CATALOGUE", help="Folder of the catalogue.")]
_Out = Annotated[str, args.option("--out", "CATALOGUE", "Folder of the catalogue, which is created or updated.")]
_To = Annotated[str, args.option("--to", "CATALOGUE", "Folder of the catalogue that receives the parts.")]
_Scheduler = Annotated[
    str | None,
    args.option(
        "--scheduler",
        "ADDRESS",
        "Read on the workers of a Dask scheduler, tcp://HOST:PORT, or on N processes of this computer, local:N.",
    ),
]
_Names = Annotated[bool, args.option("--names", None, "List the names of all parts.")]


def build(
    paths: _Paths, out: _Out, units: args.Units = None, scheduler: _Scheduler = None, json: args.Json = False
) -> None:
    """Create a catalogue from CAD files, or update it.

    Unchanged files are not read again.
    """
    from tanteo.catalogue import build_catalogue

    built, seconds = _write(build_catalogue, paths, out, units, scheduler, quiet=json)
    _print_result(built, out, seconds, as_json=json)


def add(
    paths: _Paths, to: _To, units: args.Units = None, scheduler: _Scheduler = None, json: args.Json = False
) -> None:
    """Add the parts of CAD files to a catalogue.

    A part of a changed file replaces the old one.
    """
    from tanteo.catalogue import add_to_catalogue

    built, seconds = _write(add_to_catalogue, paths, to, units, scheduler, quiet=json)
    if built.failures and not built.read:  # nothing was added
        raise PartError(built.failures[0].reason)
    _print_result(built, to, seconds, as_json=json)


def _write(
    write: Callable[..., Built], paths: list[str], folder: str, units: str | None, scheduler: str | None, *, quiet: bool
) -> tuple[Built, float]:
    """Write a catalogue; return the result and the time [s]."""
    start = time.perf_counter()
    try:
        with misuse(always=False), progress("reading parts", quiet=quiet) as tick:
            built = write(paths, folder, unit=units, scheduler=scheduler, progress=tick)
    except UnitError as error:
        raise MisuseError(with_units_option(str(error))) from None
    return built, time.perf_counter() - start


def show(catalogue: _Folder, names: _Names = False, json: args.Json = False) -> None:
    """Show the number of parts in a catalogue, their files and the size on disk."""
    from tanteo.catalogue import open_catalogue

    found = open_catalogue(catalogue)
    if json:
        put_json(
            {
                "schema": "tanteo.catalogue_summary/1", "folder": catalogue, "parts": len(found), "bytes": found.size,
                "segments": len(found.segments), "paths": list(found.paths), "names": list(found.names),
            }
        )  # fmt: skip
    else:
        emit(render.text.catalogue_lines(found, names=names, layout=layout()))


def check(catalogue: _Folder) -> None:
    """Check every byte of a catalogue by its checksum."""
    from tanteo.catalogue import open_catalogue

    found = open_catalogue(catalogue)
    found.check()
    print_text(f"{catalogue}: {len(found)} parts, {found.size / 1e6:.3g} MB, all checksums are correct.")


def _print_result(built: Built, out: str, seconds: float, *, as_json: bool) -> None:
    """Print the result of writing, and a warning for each file that could not be read."""
    for failure in built.failures:
        complain("warning", with_units_option(failure.reason))
    if as_json:
        failures = [{"path": one.path, "reason": one.reason} for one in built.failures]
        put_json(
            {
                "schema": "tanteo.catalogue_built/1", "folder": out, "parts": built.parts, "read": built.read,
                "kept": built.kept, "dropped": built.dropped, "failures": failures, "seconds": seconds,
            }
        )  # fmt: skip
        return
    did = [f"{built.read} read", f"{built.kept} unchanged", *([f"{built.dropped} dropped"] if built.dropped else [])]
    print_text(f"{out}: {built.parts} part{'s' * (built.parts != 1)} ({', '.join(did)}) in {seconds:.3g} s.")
