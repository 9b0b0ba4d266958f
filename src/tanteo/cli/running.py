"""What the commands do, and how they fail: one line on standard error and an exit code, never a traceback."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from tanteo.cli.options import MisuseError, RunOptions, misuse, misuse_of_options
from tanteo.cli.part_files import read_all_parts
from tanteo.cli.printing import complain, emit, listening, printable, put, warned
from tanteo.cli.prior_options import prior_words
from tanteo.cli.targets import check_different, parts_read
from tanteo.errors import PartError, ReadingsError, TanteoError

if TYPE_CHECKING:
    from tanteo.answers import Answer, Finding, PosePrior, Priors
    from tanteo.inference import Ask, Scale
    from tanteo.parts import Part
    from tanteo.sensors import PointMeasurements, Readings, Rig

_HEADER = re.compile(r"(?:^|,)\s*(?:x|range)_(mm|m|um|in)\s*(?:,|$)", re.MULTILINE)

_FAILED, _MISUSED, UNDECIDED, _INTERRUPTED = 1, 2, 3, 130


@contextmanager
def guarded() -> Iterator[None]:
    """Turn what tanteo raises on purpose into a message and an exit code."""
    try:
        with listening():
            yield
    except MisuseError as error:
        complain("error", str(error))
        raise typer.Exit(_MISUSED) from None
    except TanteoError as error:
        complain("error", str(error))
        raise typer.Exit(_FAILED) from None
    except KeyboardInterrupt:
        complain("error", "interrupted.")
        raise typer.Exit(_INTERRUPTED) from None


def recognize(
    readings_path: str,
    part_paths: Sequence[str],
    rig_path: str | None,
    options: RunOptions,
    pose: PosePrior | None,
    *,
    report: str | None = None,
    as_json: bool,
    verbose: bool,
) -> None:
    """Read everything, identify, print, write the report; exits with 3 when it is not decided."""
    start = time.perf_counter()
    if pose is not None and options.as_published:
        raise MisuseError(
            "--as-published: expected nothing known of the pose, which the paper has no place for. Drop one."
        )
    from tanteo.cli.reporting import check_report

    check_report(report)
    sources = [("the readings", readings_path), ("--rig", rig_path), *parts_read(part_paths)]
    check_different(("--report", report), inputs=sources)
    given = _read(readings_path, part_paths, rig_path, options, quiet=as_json)
    from tanteo.recognition import identify

    loaded = time.perf_counter() - start

    def ask(asked: Readings, among: Sequence[Part]) -> Answer:
        return identify(
            asked, among, sensor=options.sensor, sd=options.sd, tolerance=options.tolerance, robot=options.robot,
            tip_sd=options.tip_sd, rig=given.rig, significance=options.significance, top=options.top,
            as_published=options.as_published, priors=_priors(options, pose), seed=options.seed,
        )  # fmt: skip

    with misuse_of_options():
        result = ask(given.readings, given.parts)
    elapsed = {"load": loaded, **result.elapsed, "total": time.perf_counter() - start}
    result = replace(result, elapsed=elapsed)
    if not as_json:  # a person reads while it is thought about what may be wrong; a document has it all
        _print(result, pose, as_json=False, verbose=verbose)
    if not given.doubted and (question := _question(result, given, ask if pose is None else None)):
        complain("warning", question.message)
        known = tuple(one for one in result.findings if one.kind not in ("directions", "normals"))
        result = replace(result, findings=(*known, question))
    if as_json:
        _print(result, pose, as_json=True, verbose=verbose)
    if report is not None:
        from tanteo.cli.reporting import report_answer

        report_answer(report, result, given.readings, given.parts, given.rig, options, pose, as_json=as_json)
    if result.status != "recognized":
        raise typer.Exit(UNDECIDED)


def _question(answer: Answer, given: _Given, ask: Ask | None) -> Finding | None:
    """What may have been meant otherwise: a unit, a direction, or an axis."""
    from tanteo.inference import about_frames, about_mirror

    question = about_frames(answer, given.scale, given.measured)
    if question is not None or ask is None:
        return question
    return about_mirror(answer, given.readings, given.parts, ask)


class _Given(NamedTuple):
    """What was read; whether a person was warned already that it hardly goes together."""

    readings: Readings
    measured: PointMeasurements
    parts: Sequence[Part]
    rig: Rig | None
    scale: Scale
    doubted: bool


def _read(
    readings_path: str, part_paths: Sequence[str], rig_path: str | None, options: RunOptions, *, quiet: bool
) -> _Given:
    """Read everything, with a warning where it hardly goes together."""
    from tanteo.inference import about_size, about_spread, scale_of
    from tanteo.io import read_readings
    from tanteo.sensors import misspelt

    _check_readings_name(readings_path)
    rig = None if rig_path is None else asked_rig(rig_path)
    readings = read_readings(readings_path)
    measured = _check_fit(readings, options, rig)
    if rig is None and (question := misspelt(readings)):
        complain("warning", question)
    parts = read_all_parts(part_paths, options.units, quiet=quiet)
    column = _HEADER.search(_beginning(readings_path))
    scale = scale_of(measured.points, parts, column[1] if column else "", options.units or "")
    doubt = about_size(measured.points, scale) or about_spread(measured.covs, scale)
    if doubt is not None:
        complain("warning", doubt.message)
    return _Given(readings, measured, parts, rig, scale, doubt is not None)


def _print(result: Answer, pose: PosePrior | None, *, as_json: bool, verbose: bool) -> None:
    """The answer, for a program or for a person."""
    if as_json:
        from tanteo.io import recognition_json

        put(recognition_json(result, warned()))
        if result.status != "recognized":
            emit([f"{result.status}: {printable(result.message)}"], sys.stderr)
        return
    from tanteo.cli.answer import answer_lines

    emit(answer_lines(result, "" if pose is None else prior_words(pose), verbose=verbose))


def _priors(options: RunOptions, pose: PosePrior | None) -> Priors | None:
    """What is assumed beforehand; None for what always is."""
    from tanteo.answers import Priors

    said = {"outlier_rate": options.outlier_rate, "unknown": options.unknown_prior}
    given: dict[str, Any] = {name: value for name, value in said.items() if value is not None}
    return None if pose is None and not given else Priors(pose=pose, **given)


def asked_rig(path: str) -> Rig:
    """A rig from a file, with a question where its lengths may be in metres."""
    from tanteo.io import read_rig, suspect_metres

    rig = read_rig(path)
    if question := suspect_metres(rig):
        complain("warning", question)
    return rig


def _beginning(path: str) -> str:
    """The first lines of a file that could be read before."""
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.read(20_000)


def _check_readings_name(path: str) -> None:
    """Readings and parts are easily swapped."""
    from tanteo.parts import READABLE

    if Path(path).suffix.lower() in READABLE:
        raise ReadingsError(
            f"READINGS: expected a table of readings (CSV), got the CAD file '{path}'. Readings come first, CAD files "
            "behind --parts or --part."
        )


def _check_fit(readings: Readings, options: RunOptions, rig: Rig | None) -> PointMeasurements:
    """What is measured, if options and readings fit each other; asked before the parts, which may take long."""
    from tanteo.sensors import measure

    with misuse():
        return measure(
            readings, sensor=options.sensor, robot=options.robot, sd=options.sd, tip_sd=options.tip_sd, rig=rig
        )


def require_file(name: str, path: str) -> None:
    """One part is one file.

    Raises:
        PartError: It is a folder.
    """
    if Path(path).is_dir():
        raise PartError(f"{name}: expected one CAD file, got the folder '{path}'. Name a file in it.")


def show_part(file: str, unit: str | None, *, as_json: bool, verbose: bool) -> None:
    """Print what was read from one CAD file."""
    from tanteo.io import part_json

    require_file("FILE", file)
    (part,) = read_all_parts([file], unit, quiet=as_json)
    if as_json:
        put(part_json(part))
    else:
        from tanteo.cli.part_text import part_lines

        emit(part_lines(part, verbose=verbose))
