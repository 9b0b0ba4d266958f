"""``tanteo catalogue``: many parts on disk, prepared for recognition."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import render
from tanteo.cli import arguments as args
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, emit, layout, progress, put_json, say
from tanteo.errors import PartError, UnitError

if TYPE_CHECKING:
    from tanteo.catalogue import Built

_Paths = Annotated[list[str], typer.Argument(metavar="FILE_OR_FOLDER...", help="CAD files or folders of them.")]
_Folder = Annotated[str, typer.Argument(metavar="CATALOGUE", help="Folder of the catalogue.")]
_Out = Annotated[str, args.option("--out", "CATALOGUE", "Folder of the catalogue; it is made, or brought up to date.")]
_To = Annotated[str, args.option("--to", "CATALOGUE", "Folder of the catalogue that the parts are added to.")]
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
    """Make a catalogue of CAD files, or bring it up to date.

    What has not changed is not read again.
    """
    from tanteo.catalogue import build_catalogue

    built, seconds = _write(build_catalogue, paths, out, units, scheduler, quiet=json)
    _say(built, out, seconds, as_json=json)


def add(
    paths: _Paths, to: _To, units: args.Units = None, scheduler: _Scheduler = None, json: args.Json = False
) -> None:
    """Add the parts of CAD files to a catalogue.

    A file that has changed takes its old part's place.
    """
    from tanteo.catalogue import add_to_catalogue

    built, seconds = _write(add_to_catalogue, paths, to, units, scheduler, quiet=json)
    if built.failures and not built.read:  # nothing was added
        raise PartError(built.failures[0].reason)
    _say(built, to, seconds, as_json=json)


def _write(
    write: Callable[..., Built], paths: list[str], folder: str, units: str | None, scheduler: str | None, *, quiet: bool
) -> tuple[Built, float]:
    """What came of writing, and how long it took."""
    start = time.perf_counter()
    try:
        with misuse(always=False), progress("reading parts", quiet=quiet) as tick:
            built = write(paths, folder, unit=units, scheduler=scheduler, progress=tick)
    except UnitError as error:
        raise MisuseError(f"{error} Here that is --units.") from None
    return built, time.perf_counter() - start


def show(catalogue: _Folder, names: _Names = False, json: args.Json = False) -> None:
    """Say how many parts a catalogue has.

    Says of which files, and how large it is.
    """
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
        emit(render.catalogue_lines(found, names=names, layout=layout()))


def check(catalogue: _Folder) -> None:
    """Check every byte of a catalogue by its checksum."""
    from tanteo.catalogue import open_catalogue

    found = open_catalogue(catalogue)
    found.check()
    say(f"{catalogue}: {len(found)} parts, {found.size / 1e6:.3g} MB, all as they were written.")


def _say(built: Built, out: str, seconds: float, *, as_json: bool) -> None:
    """What was done, and a warning for each file that was not read."""
    for failure in built.failures:
        complain("warning", f"{failure.reason} Here that is --units." if "unit=" in failure.reason else failure.reason)
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
    say(f"{out}: {built.parts} part{'s' * (built.parts != 1)} ({', '.join(did)}) in {seconds:.3g} s.")
