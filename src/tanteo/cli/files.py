"""The files of a command: what it reads, with what a person may not expect of it, and what it writes."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING

from tanteo import io
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import complain, progress, say
from tanteo.errors import InputError, PartError, UnitError

if TYPE_CHECKING:
    from tanteo.geometry.typing import Vectors
    from tanteo.parts import Part
    from tanteo.planning import Session
    from tanteo.render import Run, Section
    from tanteo.sensors import Rig

TYPED: ContextVar[tuple[str, ...]] = ContextVar("TYPED", default=("tanteo",))
"""The words of the command that runs, as they were typed: a report says how to run it again."""

_ELSEWHERE = "Choose another folder"


def check_target(name: str, path: str | None, suffixes: Sequence[str] = ()) -> None:
    """Can the file of an option be written? Asked before the long work, whose result would be lost. None is no file.

    Raises:
        MisuseError: It has another suffix than one of these, if there are any.
        InputError: A folder that is not there or in which nothing may be written, or no name at all.
    """
    if path is None:
        return
    file = Path(path)
    if suffixes and file.suffix.lower() not in suffixes:
        raise MisuseError(
            f"{name}: expected a file name that ends in {' or '.join(suffixes)}, got '{path}'. Add the suffix."
        )
    with writing(name, path):
        if file.is_dir():
            raise _refused(name, path, "it is a folder. Name a file in it")
        if not file.parent.is_dir():
            raise _refused(name, path, f"there is no folder '{file.parent}'. Make it first")
        if not os.access(file if file.exists() else file.parent, os.W_OK):
            raise _refused(name, path, f"permission denied. {_ELSEWHERE}")


def check_different(
    *targets: tuple[str, str | None], inputs: Sequence[tuple[str, str | None]] = (), parts: Sequence[str] = ()
) -> None:
    """Are the files of these options different ones, and is each other than what is read, parts too? None is no file.

    Raises:
        MisuseError: Two of them are one, or one would be written over what is read.
    """
    from tanteo.catalogue import cad_files

    seen = {os.path.realpath(path): name for name, path in inputs if path is not None}
    seen |= {os.path.realpath(path): "a part" for path in (*parts, *map(str, cad_files(parts)))}
    for name, path in targets:
        if path is None:
            continue
        file = os.path.realpath(path)
        if other := seen.get(file):
            raise MisuseError(f"{name}: expected another file than that of {other}, got '{path}' for both. Name two.")
        seen[file] = name


@contextmanager
def writing(name: str, path: str) -> Iterator[None]:
    """Write this file inside; what the system refuses becomes advice.

    Raises:
        InputError: It could not be written: the disk is full, or the folder went away.
    """
    try:
        yield
    except OSError as error:
        raise _refused(name, path, f"{error.strerror or error}. {_ELSEWHERE}") from None


def _refused(name: str, path: str, why: str) -> InputError:
    return InputError(f"{name}: expected a file that can be written, got '{path}': {why}.")


def require_file(name: str, path: str) -> None:
    """One part is one file: a folder raises PartError."""
    if Path(path).is_dir():
        raise PartError(f"{name}: expected one CAD file, got the folder '{path}'. Name a file in it.")


def read_all_parts(paths: Sequence[str], units: str | None, *, quiet: bool) -> Sequence[Part]:
    """The parts; files of a folder that cannot be read are warnings as long as one can."""
    from tanteo.catalogue import coarse_meshes, is_catalogue, read_parts, repaired, skipped_folders, unused_unit

    if any(map(is_catalogue, paths)):
        return _opened(paths)
    try:
        with progress("reading parts", quiet=quiet) as tick:
            parts = read_parts(paths, unit=units, progress=tick)
    except UnitError as error:
        raise MisuseError(f"{error} Here that is --units.") from None
    reasons = [f"{f.reason} Here that is --units." if "unit=" in f.reason else f.reason for f in parts.failures]
    skipped = skipped_folders(paths)
    if len(reasons) == 1 and not parts.parts and not skipped:
        raise PartError(reasons[0])
    named = {Path(path) for path in paths if not Path(path).is_dir()}
    lost = [r for r, failure in zip(reasons, parts.failures, strict=True) if Path(failure.path) in named]
    odd = [*skipped, *unused_unit(parts.parts, units), *coarse_meshes(parts.parts), *repaired(parts.parts)]
    for reason in [r for r in reasons if r not in lost[:1]] + odd:
        complain("warning", reason)
    if lost:  # an answer would say nothing of a part that was asked for by name
        raise PartError(lost[0])
    if not parts.parts:
        raise PartError("--parts: expected at least one part that can be read, got none. See the warnings.")
    return parts.parts


def _opened(paths: Sequence[str]) -> Sequence[Part]:
    """The parts of a catalogue, which none is read of here.

    Raises:
        MisuseError: Other parts are named, too.
    """
    from tanteo.catalogue import open_catalogue

    if len(paths) > 1:
        raise MisuseError(
            f"--parts: expected one catalogue or CAD files, got {len(paths)} of both. Name the catalogue alone; "
            "tanteo catalogue add puts more parts into it."
        )
    return open_catalogue(paths[0])


def read_asked_rig(path: str) -> Rig:
    """A rig from a file, with a question where its lengths may be in metres."""
    rig = io.read_rig(path)
    if question := io.suspect_metres(rig):
        complain("warning", question)
    return rig


def check_report(path: str | None) -> None:
    """:func:`check_target` for a report."""
    check_target("--report", path, (".html", ".htm"))


def this_run(*facts: tuple[str, str]) -> Run:
    """The command that runs now, as a report says it, with names and values that stand beside the picture."""
    from tanteo import __version__
    from tanteo.render import Run

    return Run(shlex.join(TYPED.get()), f"tanteo {__version__}", facts)


def write_page(path: str, page: str, *, as_json: bool) -> None:
    """Write a report and say where it is; beside JSON on standard error.

    Raises:
        InputError: The file cannot be written.
    """
    from tanteo.render import write_report

    with writing("--report", path):
        write_report(path, page)
    say(f"report written: {path}", sys.stderr if as_json else sys.stdout)


def report_session(
    path: str,
    session: Session,
    *facts: tuple[str, str],
    as_json: bool,
    more: Sequence[Section] = (),
    look: Vectors | None = None,
) -> None:
    """Report a session: its answer, and how it came to that; further sections stand first, seen from a direction."""
    from tanteo.render import session_page

    write_page(path, session_page(session, this_run(*facts), more, look), as_json=as_json)
