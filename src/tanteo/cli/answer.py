"""Implement ``tanteo identify`` and ``tanteo locate``: from a file of readings to the part and its pose."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli import controller, files, typed
from tanteo.cli.answer_options import Evidence, Options
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, emit, layout, leave, print_text, put, warned
from tanteo.cli.readings import FileOptions, read_file, units_of_parts
from tanteo.errors import ReadingsError
from tanteo.words.findings import AccuracyNeeded, AssumedTip

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.recognition import Query
    from tanteo.sensors import PointMeasurements, Readings, Rig

HYPOTHESES = 100
"""Largest number of hypotheses among which the next reading discriminates: more than a search returns."""

_HEADER = re.compile(r"(?:^|,)\s*(?:x|range)_(mm|m|um|in)\s*(?:,|$)", re.MULTILINE)


def identify(readings: args.ReadingsPath, parts: args.PartPaths, options: Options, file: FileOptions) -> None:
    """Identify the sensed part and its pose, with probabilities and a covariance."""
    known = typed.read_known(options.table, options.box, options.pose_prior, options.prior, options.rests)
    start = time.perf_counter()
    if options.as_published:
        _check_published(known, options)
    words = controller.Words(
        options.pose_as, options.wcs, options.best_guess, options.accept_turn_lost, which=options.which
    )
    files.check_report(options.report)
    sources = [("the readings", readings), ("--rig", options.rig)]
    sources += [("--image", image) for image in options.image or ()]
    sources += options.cameras.files
    sources += [("--factor", text.partition("=")[2]) for text in options.factor or ()]
    files.check_different(("--report", options.report), inputs=sources, parts=parts)
    reply = ask(
        readings, parts, options, file, known, top=max(options.top, HYPOTHESES), count=options.count,
        as_published=options.as_published,
    )  # fmt: skip
    given, result, loaded = reply.given, reply.answer, reply.loaded - start
    words = replace(words, doubt=given.doubt)
    if not options.as_published:
        result = _with_next(result, given, options, known)
    result = replace(result, hypotheses=result.hypotheses[: options.top])
    if options.need is not None:
        from tanteo.planning.following import accuracy_needed

        needed = accuracy_needed(result, given.parts, options.need)
        result = result if needed is None else result.adding(needed)
    elapsed = {"load": loaded, **result.elapsed, "total": time.perf_counter() - start}
    result = replace(result, elapsed=elapsed)
    _print_latency(readings, result, given, options, file)
    if not options.json:  # print before the checks of conventions, which take time; a JSON document contains both
        print_answer(result, known, verbose=options.verbose, to_stderr=bool(words))
    if not options.as_published:
        from tanteo.recognition import Query

        before = time.perf_counter()
        result = _questioned(result, given, Query(**reply.chosen), placed=known is not None)
        result = posterior.answers.with_elapsed(result, conventions=time.perf_counter() - before)
    if options.json:
        print_answer(result, as_json=True, more=words.document(result, given.parts) if words else {})
    elif words:
        put(words.text(result, given.parts))
    if options.report is not None:
        _report(options.report, result, given, options, known)
    failed = any(isinstance(one, AccuracyNeeded) and not one.reached for one in result.findings)
    refused = bool(words) and words.refused(result) is not None
    leave(decided=result.status == "recognized" and not failed and not refused)


class Reply(NamedTuple):
    """Answer of a command, with its inputs.

    Attributes:
        given: readings, parts and rig.
        chosen: keyword arguments of :func:`tanteo.identify`.
        answer: the answer, without questions about conventions.
        loaded: time at which all files had been read [s].
    """

    given: Given
    chosen: dict[str, Any]
    answer: posterior.Answer
    loaded: float


def ask(
    readings: str,
    parts: Sequence[str],
    options: Evidence,
    file: FileOptions,
    known: posterior.PosePrior | None,
    *,
    top: int,
    count: int | None = None,
    as_published: bool = False,
) -> Reply:
    """Read all files of a question, and answer it.

    Args:
        readings: file of the readings.
        parts: files, folders or catalogue of the parts.
        options: other evidence: images, priors and the options of the factors.
        file: options for the file of readings.
        known: prior knowledge of the pose; None for none.
        top: largest number of hypotheses.
        count: number of equal parts; None if not known.
        as_published: whether to use the equations of the paper.
    """
    factors = options.factors()
    from tanteo.cli.image import outline_of, read_views, require_poses

    views = read_views(options.image, options.cameras)
    require_poses(views, options.cameras)
    given = read_given(readings, parts, options, file)
    from tanteo.cli.second_opinion import factor_of, judged
    from tanteo.recognition import MOST_VIEWED, identify

    table = known.table if known is not None else None
    on_table = [view for view in views if view.on_table]
    outlines = [outline_of(view, given.measured.points, given.parts, table) for view in on_table]
    many = len(given.parts) > MOST_VIEWED  # the outline then prunes the parts, and replaces the edges in the posterior
    outline = outlines[0] if outlines and many else None
    loaded = time.perf_counter()
    opinion = factor_of(options.detections, given)
    factors = factors if opinion is None else (*factors, opinion)
    with misuse():
        priors = options.priors(known, outline)
    chosen: dict[str, Any] = {
        "sensor": options.sensor, "sd": options.sd, "tolerance": options.form_sd, "robot": options.robot,
        "tip_sd": options.tip_sd, "shared_errors": options.shared_errors, "rig": given.rig,
        "significance": options.significance,
        "priors": priors, "factors": factors, "views": () if outline is not None else views, "seed": options.seed,
    }  # fmt: skip
    with misuse(always=False):
        answer = identify(
            given.readings, given.parts, **chosen, top=top, count=count, as_published=as_published, conventions=False
        )
    answer = judged(answer, opinion, given)
    return Reply(given, chosen, answer, loaded)


def _with_next(
    answer: posterior.Answer, given: Given, options: Evidence, known: posterior.PosePrior | None
) -> posterior.Answer:
    """Return an undecided answer with the reading that it lacks as a finding."""
    if answer.status not in ("ambiguous", "insufficient"):
        return answer
    from tanteo.cli.reach_options import ReachOptions, probe_for
    from tanteo.planning.following import NextReading, next_reading

    probe = probe_for(given, options, ReachOptions(), known)
    found = next_reading(answer, given.parts, probe, seed=options.seed)
    return answer.adding(found.finding) if isinstance(found, NextReading) else answer


def _check_published(known: posterior.PosePrior | None, options: Options) -> None:
    """Refuse options that the method of the paper does not support."""
    if known is not None:
        raise MisuseError(
            "--as-published: expected no prior knowledge of the pose, which the paper does not use. Drop one option."
        )
    for name in ("image", "factor"):
        if getattr(options, name):
            raise MisuseError(
                f"--as-published: expected only readings, because the paper uses nothing else. Drop --{name}."
            )


def _print_latency(path: str, answer: posterior.Answer, given: Given, options: Options, file: FileOptions) -> None:
    """Print how much older the readings of a recording are than their stamps, estimated from the sensor's motion."""
    if answer.best is None:
        return
    from tanteo.parts import part_named
    from tanteo.ros.latency import STEP, estimate_latency
    from tanteo.sensors import measure

    shifted: tuple[Readings, ...] = ()
    with suppress(ReadingsError):  # single poses do not contain the motion of the sensor
        shifted = io.readings.read_shifted(
            path, (0.0, -STEP, STEP), latency=file.latency, topics=file.topics, world=file.world, radius=file.radius,
            direction=file.direction, max_points=file.max_points,
        )  # fmt: skip
    if not shifted:
        return
    measured = partial(
        measure, sensor=options.sensor, robot=options.robot, sd=options.sd, tip_sd=options.tip_sd,
        shared_errors=options.shared_errors, rig=given.rig,
    )  # fmt: skip
    found = estimate_latency(shifted, STEP, measured, answer.best, part_named(given.parts, answer.best.part))
    if found is not None and found.contradicts:
        complain("warning", found.words(file.latency or 0.0))
    elif found is not None and options.verbose:
        print_text(found.words(file.latency or 0.0), sys.stderr)


def locate(readings: args.ReadingsPath, part: args.PartPath, options: Options, file: FileOptions) -> None:
    """Estimate the pose of a known part, with its covariance."""
    files.require_file("--part", part)
    identify(readings, [part], options, file)


def print_answer(
    answer: posterior.Answer,
    known: posterior.PosePrior | None = None,
    *,
    as_json: bool = False,
    verbose: bool = False,
    to_stderr: bool = False,
    more: Mapping[str, Any] | None = None,
) -> None:
    """Print an answer as text, or as a JSON document with its status on standard error.

    Args:
        answer: answer to print.
        known: prior knowledge of the pose; None for none.
        as_json: whether to print a JSON document.
        verbose: whether to print more details.
        to_stderr: whether to print to standard error, because standard output carries lines for a controller.
        more: further keys of the document.
    """
    if as_json:
        put(io.documents.document_json({**io.recognition_document(answer), **(more or {})}, warned()))
        print_status(answer)
    else:
        emit(
            render.text.answer_lines(answer, known, verbose=verbose, layout=layout()), sys.stderr if to_stderr else None
        )


def print_status(answer: posterior.Answer) -> None:
    """Print the status and message of an undecided answer to standard error, beside a JSON document.

    Args:
        answer: answer to report.
    """
    if answer.status != "recognized":
        print_text(f"{answer.status}: {answer.message}", sys.stderr)


class Given(NamedTuple):
    """Inputs of a recognition.

    Attributes:
        readings: readings of the devices.
        measured: measurements from the readings.
        parts: candidate parts.
        rig: range sensors on the hand; None if not given.
        scale: sizes of readings and parts.
        doubt: printed warning about implausible sizes; empty for none.
    """

    readings: Readings
    measured: PointMeasurements
    parts: Sequence[Part]
    rig: Rig | None
    scale: posterior.findings.Scale
    doubt: str


def _own_unit(parts: Sequence[Part]) -> str:
    """Return the unit that the files of all parts state; empty if they state none or several."""
    from tanteo.parts import StoredParts

    units = set(parts.units) if isinstance(parts, StoredParts) else {part.unit for part in parts}
    return units.pop() if len(units) == 1 else ""


def read_given(path: str, part_paths: Sequence[str], options: Evidence, file: FileOptions) -> Given:
    """Read readings, rig and parts, and print a warning if their sizes are implausible.

    Args:
        path: file of the readings.
        part_paths: files, folders or catalogue of the parts.
        options: options of the command.
        file: options for the file of readings.
    """
    from tanteo.sensors import measure, misspelt, unstated_sd
    from tanteo.sensors.error_states import MOUNTED

    rig = None if options.rig is None else files.read_rig(options.rig, options.sensor, options.sd)
    readings, used = read_file(path, file, options.units, rig, options.sensor)
    sd = unstated_sd(readings, sensor=options.sensor, sd=options.sd, rig=rig) or options.sd
    with misuse():
        measured = measure(
            readings, sensor=options.sensor, robot=options.robot, sd=sd, tip_sd=options.tip_sd,
            shared_errors=options.shared_errors, rig=rig, angle_sd=MOUNTED,
        )  # fmt: skip
    if rig is None and (question := misspelt(readings)):
        complain("warning", question)
    units = units_of_parts(list(part_paths), options.units, used)
    if used and units is not None:
        complain("warning", f"--units {units} applies to the readings and to the parts: neither state a unit.")
    parts = files.read_all_parts(part_paths, units, quiet=options.json)
    column = _HEADER.search(_beginning(path))
    scale = posterior.findings.scale_of(
        measured.points, parts, column[1] if column else "", options.units or _own_unit(parts)
    )
    doubt = posterior.findings.about_size(measured.points, scale) or posterior.findings.about_spread(
        measured.covs, scale
    )
    if doubt is not None:
        complain("warning", doubt.message)
    return Given(readings, measured, parts, rig, scale, "" if doubt is None else doubt.message)


def _beginning(path: str) -> str:
    """Return the beginning of a file; empty for a folder, such as a ROS recording."""
    if os.path.isdir(path):
        return ""
    with open(path, encoding="utf-8", errors="replace") as text_file:
        return text_file.read(20_000)


def _questioned(answer: posterior.Answer, given: Given, query: Query, *, placed: bool) -> posterior.Answer:
    """Return the answer with a probable convention error (units, frames, directions) as last finding, and print it."""
    if given.doubt:
        return answer
    frames = posterior.findings.about_frames(answer, given.readings, given.scale, given.measured)
    found = posterior.convention_checks.about_conventions(answer, given.readings, given.parts, query, placed=placed)
    if found is None or (frames is not None and frames.kind == found.kind == "units"):
        found = frames  # this finding names the stated units and their column
    if found is None:
        return answer
    others = tuple(one for one in answer.findings if one.role != "question")
    complain("warning", found.message)
    return replace(answer, findings=(*others, found))


def _report(
    path: str, answer: posterior.Answer, given: Given, options: Options, known: posterior.PosePrior | None
) -> None:
    from tanteo.planning import Sensing
    from tanteo.render.html import gather, report_page

    assumed = [(one.sd,) * 3 for one in answer.findings if isinstance(one, AssumedTip)]
    sensing = Sensing(
        options.sensor, options.robot, options.sd, assumed[0] if assumed else options.tip_sd, given.rig,
        options.form_sd, shared_errors=options.shared_errors,
    )  # fmt: skip
    before = [] if known is None else [("Known before", render.text.prior_words(known))]
    page = report_page(answer, gather(given.readings, sensing, known), given.parts, files.this_run(*before))
    files.write_page(path, page, as_json=options.json)
