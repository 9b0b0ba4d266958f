"""Read and write the files of a command, with warnings about unexpected content."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from datetime import UTC, datetime
from hashlib import file_digest
from pathlib import Path
from typing import TYPE_CHECKING

from tanteo import io
from tanteo.cli.misuse import MisuseError, with_units_option
from tanteo.cli.printing import complain, print_text, progress
from tanteo.errors import InputError, PartError, UnitError

if TYPE_CHECKING:
    from tanteo.geometry.typing import Vectors
    from tanteo.parts import Part
    from tanteo.planning import Session
    from tanteo.posterior import Answer
    from tanteo.render.html import Run, Section
    from tanteo.sensors import Rig

TYPED: ContextVar[tuple[str, ...]] = ContextVar("TYPED", default=("tanteo",))
"""Words of the running command as typed; a report shows them."""

_ELSEWHERE = "Choose another folder"


def check_target(name: str, path: str | None, suffixes: Sequence[str] = ()) -> None:
    """Check before a long computation that the file of an option can be written.

    Args:
        name: name of the option.
        path: file to write; None for none.
        suffixes: accepted suffixes; empty for any.

    Raises:
        MisuseError: the file has another suffix.
        InputError: the folder does not exist or is not writable, or the path is a folder.
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
    """Check that the files to write differ from each other and from all files to read.

    Args:
        targets: options and files to write; None for none.
        inputs: options and files to read; None for none.
        parts: files and folders of parts to read.

    Raises:
        MisuseError: two files are the same.
    """
    from tanteo.catalogue.file_warnings import cad_files

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
    """Turn system errors of writing a file inside the context into an error with advice.

    Args:
        name: name of the option.
        path: file to write.

    Raises:
        InputError: the file could not be written.
    """
    try:
        yield
    except OSError as error:
        raise _refused(name, path, f"{error.strerror or error}. {_ELSEWHERE}") from None


def _refused(name: str, path: str, why: str) -> InputError:
    return InputError(f"{name}: expected a file that can be written, got '{path}': {why}.")


def require_file(name: str, path: str) -> None:
    """Check that an option names a file and not a folder.

    Args:
        name: name of the option.
        path: path that the option names.

    Raises:
        PartError: the path is a folder.
    """
    if Path(path).is_dir():
        raise PartError(f"{name}: expected one CAD file, got the folder '{path}'. Name a file in it.")


def read_all_parts(paths: Sequence[str], units: str | None, *, quiet: bool) -> Sequence[Part]:
    """Read parts; a file of a folder that cannot be read is a warning as long as another one can.

    Args:
        paths: files, folders, or one catalogue.
        units: unit of files that state none; None if not given.
        quiet: whether to show no progress.

    Raises:
        MisuseError: a file states no unit and ``units`` is None.
        PartError: no part can be read, or a named file cannot.
    """
    from tanteo.catalogue import is_catalogue, read_parts
    from tanteo.catalogue.file_warnings import coarse_meshes, repaired, skipped_folders, unused_unit

    if any(map(is_catalogue, paths)):
        return _opened(paths)
    try:
        with progress("reading parts", quiet=quiet) as tick:
            parts = read_parts(paths, unit=units, progress=tick)
    except UnitError as error:
        raise MisuseError(with_units_option(str(error))) from None
    reasons = [with_units_option(failure.reason) for failure in parts.failures]
    skipped = skipped_folders(paths)
    if len(reasons) == 1 and not parts.parts and not skipped:
        raise PartError(reasons[0])
    named = {Path(path) for path in paths if not Path(path).is_dir()}
    lost = [r for r, failure in zip(reasons, parts.failures, strict=True) if Path(failure.path) in named]
    odd = [*skipped, *unused_unit(parts.parts, units), *coarse_meshes(parts.parts), *repaired(parts.parts)]
    for reason in [r for r in reasons if r not in lost[:1]] + odd:
        complain("warning", reason)
    if lost:  # an answer without a part that the user named would be misleading
        raise PartError(lost[0])
    if not parts.parts:
        raise PartError("--parts: expected at least one part that can be read, got none. See the warnings.")
    return parts.parts


def _opened(paths: Sequence[str]) -> Sequence[Part]:
    """Open a catalogue without reading its parts.

    Raises:
        MisuseError: other parts are named as well.
    """
    from tanteo.catalogue import open_catalogue

    if len(paths) > 1:
        raise MisuseError(
            f"--parts: expected one catalogue or CAD files, got {len(paths)} of both. Name the catalogue alone; "
            "tanteo catalogue add puts more parts into it."
        )
    return open_catalogue(paths[0])


def read_rig(path: str, sensor: str | None = None, sd: float | None = None) -> Rig:
    """Read a rig, and print warnings on assumptions, and if its lengths are probably in metres.

    Args:
        path: file of the rig, or name of a shipped rig.
        sensor: preset of sensors whose file states a pose only.
        sd: standard deviation along the beam of sensors whose file states a pose only [m].
    """
    rig = io.read_rig(path, sensor=sensor, sd=sd)
    for note in rig.notes:
        complain("warning", note)
    if question := io.documents.suspect_metres(rig):
        complain("warning", question)
    return rig


def check_report(path: str | None) -> None:
    """Check that the file of a report can be written; see :func:`check_target`.

    Args:
        path: file of the report; None for none.
    """
    check_target("--report", path, (".html", ".htm"))


def this_run(*facts: tuple[str, str]) -> Run:
    """Return the running command for a report.

    Args:
        facts: names and values to show beside the picture.
    """
    from tanteo import __version__
    from tanteo.render.html import Run

    made_by = f"tanteo {__version__}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    return Run(shlex.join(TYPED.get()), made_by, facts, _checksums(TYPED.get()))


def _checksums(words: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return the files among the words of a command with the beginning of their SHA-256, without reports."""
    given = [part for word in words[1:] for part in (word, word.partition("=")[2]) if part]
    out = []
    for name in dict.fromkeys(name for name in given if Path(name).is_file() and not name.endswith((".html", ".htm"))):
        with Path(name).open("rb") as file, suppress(OSError):
            out.append((name, file_digest(file, "sha256").hexdigest()[:16]))
    return tuple(out)


def write_page(path: str, page: str, *, as_json: bool) -> None:
    """Write a report, and print its path; to standard error beside a JSON document.

    Args:
        path: file of the report.
        page: HTML text.
        as_json: whether standard output carries a JSON document.

    Raises:
        InputError: the file cannot be written.
    """
    from tanteo.render.html import write_report

    with writing("--report", path):
        write_report(path, page)
    print_text(f"report written: {path}", sys.stderr if as_json else sys.stdout)


def write_detections(path: str, answers: Sequence[Answer], frame: str) -> None:
    """Write the answers of objects as detections.

    Args:
        path: file of the detections.
        answers: one answer for each object.
        frame: name of the frame of the poses.

    Raises:
        InputError: the file cannot be written.
    """
    from tanteo.io.poses import detections_file

    with writing("--write-detections", path):
        detections_file.write_detections(path, answers, frame)


def report_session(
    path: str,
    session: Session,
    *facts: tuple[str, str],
    as_json: bool,
    more: Sequence[Section] = (),
    view: Vectors | None = None,
) -> None:
    """Write the report of a session: its answer and its steps.

    Args:
        path: file of the report.
        session: session to report.
        facts: names and values to show beside the picture.
        as_json: whether standard output carries a JSON document.
        more: further sections, which come first.
        view: initial viewing direction of the picture ``(3,)``; None for the default.
    """
    from tanteo.render.html import session_page

    write_page(path, session_page(session, this_run(*facts), more, view), as_json=as_json)
