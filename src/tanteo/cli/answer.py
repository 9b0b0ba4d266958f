"""``tanteo identify`` and ``tanteo locate``: from a table of readings to the part and its pose."""

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
from tanteo.cli.answer_options import Options
from tanteo.cli.misuse import MisuseError, misuse
from tanteo.cli.printing import complain, emit, layout, leave, put, say, warned
from tanteo.cli.readings import FileOptions, read_file, units_of_parts
from tanteo.errors import ReadingsError

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.sensors import PointMeasurements, Readings, Rig

_HEADER = re.compile(r"(?:^|,)\s*(?:x|range)_(mm|m|um|in)\s*(?:,|$)", re.MULTILINE)


def identify(readings: args.ReadingsPath, parts: args.PartPaths, options: Options, file: FileOptions) -> None:
    """Say which part was sensed, where it is and how sure that is."""
    known = typed.read_known(options.table, options.box, options.pose_prior, options.prior)
    start = time.perf_counter()
    if options.as_published:
        _check_published(known, options)
    words = controller.Words(options.pose_as, options.wcs, options.best_guess)
    files.check_report(options.report)
    factors = options.factors()
    from tanteo.cli.image import outline_of, read_views

    views = read_views(options.image, options.camera, options.marks)
    sources = [("the readings", readings), ("--rig", options.rig)]
    sources += [("--image", image) for image in options.image or ()]
    sources += [("--camera", camera) for camera in options.camera or ()]
    sources += [("--factor", text.partition("=")[2]) for text in options.factor or ()]
    files.check_different(("--report", options.report), inputs=sources, parts=parts)
    given = read_given(readings, parts, options, file)
    from tanteo.recognition import MOST_VIEWED, identify

    table = known.table if known is not None else None
    outlines = [outline_of(view, given.measured.points, given.parts, table) for view in views]
    many = len(given.parts) > MOST_VIEWED  # of so many parts the outline narrows, and counts instead of the edges
    outline = outlines[0] if outlines and many else None
    loaded = time.perf_counter() - start
    with misuse():
        priors = options.priors(known, outline)
    ask = partial(
        identify, sensor=options.sensor, sd=options.sd, tolerance=options.tolerance, robot=options.robot,
        tip_sd=options.tip_sd, bias_sd=options.bias_sd, rig=given.rig, significance=options.significance,
        top=options.top, as_published=options.as_published, priors=priors, factors=factors,
        views=() if many else views, seed=options.seed, conventions=False,
    )  # fmt: skip
    with misuse(always=False):
        result = ask(given.readings, given.parts)
    elapsed = {"load": loaded, **result.elapsed, "total": time.perf_counter() - start}
    result = replace(result, elapsed=elapsed)
    _say_latency(readings, result, given, options, file)
    if not options.json:  # a person reads while it is thought about what may be wrong; a document has it all
        print_answer(result, known, verbose=options.verbose, aside=bool(words))
    if not options.as_published:
        result = _questioned(result, given, ask, placed=known is not None)
    if options.json:
        print_answer(result, as_json=True, more=words.document(result, given.parts) if words else {})
    elif words:
        put(words.text(result, given.parts))
    if options.report is not None:
        _report(options.report, result, given, options, known)
    leave(decided=result.status == "recognized")


def _check_published(known: posterior.PosePrior | None, options: Options) -> None:
    """Refuse what the paper has no place for."""
    if known is not None:
        raise MisuseError(
            "--as-published: expected nothing known of the pose, which the paper has no place for. Drop one."
        )
    for name in ("image", "factor"):
        if getattr(options, name):
            raise MisuseError(
                f"--as-published: expected readings alone, which is what the paper compares. Drop --{name}."
            )


def _say_latency(path: str, answer: posterior.Answer, given: Given, options: Options, file: FileOptions) -> None:
    """Of a recording: how much older the readings are than their stamps, by the motion of the sensor."""
    if answer.best is None:
        return
    from tanteo.parts import part_named
    from tanteo.ros import STEP, estimate_latency
    from tanteo.sensors import measure

    shifted: tuple[Readings, ...] = ()
    with suppress(ReadingsError):  # of single poses it is not known how the sensor moved
        shifted = io.read_shifted(
            path, (0.0, -STEP, STEP), latency=file.latency, topics=file.topics, world=file.world, radius=file.radius,
            direction=file.direction, max_points=file.max_points,
        )  # fmt: skip
    if not shifted:
        return
    measured = partial(
        measure, sensor=options.sensor, robot=options.robot, sd=options.sd, tip_sd=options.tip_sd,
        bias_sd=options.bias_sd, rig=given.rig,
    )  # fmt: skip
    found = estimate_latency(shifted, STEP, measured, answer.best, part_named(given.parts, answer.best.part))
    if found is not None and found.contradicts:
        complain("warning", found.words(file.latency or 0.0))
    elif found is not None and options.verbose:
        say(found.words(file.latency or 0.0), sys.stderr)


def locate(readings: args.ReadingsPath, part: args.PartPath, options: Options, file: FileOptions) -> None:
    """Say where a known part is and how sure that is."""
    files.require_file("--part", part)
    identify(readings, [part], options, file)


def print_answer(
    answer: posterior.Answer,
    known: posterior.PosePrior | None = None,
    *,
    as_json: bool = False,
    verbose: bool = False,
    aside: bool = False,
    more: Mapping[str, Any] | None = None,
) -> None:
    """An answer, for a person, or for a program with its status on standard error.

    Args:
        answer: what was found.
        known: what was taken as known of the pose.
        as_json: as one document.
        verbose: say more.
        aside: on standard error, as standard output is for the words of a controller.
        more: keys of the document beside the answer's.
    """
    if as_json:
        put(io.document_json({**io.recognition_document(answer), **(more or {})}, warned()))
        say_status(answer)
    else:
        emit(render.answer_lines(answer, known, verbose=verbose, layout=layout()), sys.stderr if aside else None)


def say_status(answer: posterior.Answer) -> None:
    """Beside a document: what a person should know of an answer that is not decided."""
    if answer.status != "recognized":
        say(f"{answer.status}: {answer.message}", sys.stderr)


class Given(NamedTuple):
    """What was read; whether a person was warned already that it hardly goes together."""

    readings: Readings
    measured: PointMeasurements
    parts: Sequence[Part]
    rig: Rig | None
    scale: posterior.Scale
    doubted: bool


def _own_unit(parts: Sequence[Part]) -> str:
    """The unit that the files of all parts say."""
    from tanteo.parts import StoredParts

    units = set(parts.units) if isinstance(parts, StoredParts) else {part.unit for part in parts}
    return units.pop() if len(units) == 1 else ""


def read_given(path: str, part_paths: Sequence[str], options: Options, file: FileOptions) -> Given:
    """Read everything, with a warning where it hardly goes together; what may take long comes last."""
    from tanteo.sensors import measure, misspelt, unstated_sd

    rig = None if options.rig is None else files.read_asked_rig(options.rig)
    readings, used = read_file(path, file, options.units, rig)
    sd = unstated_sd(readings, sensor=options.sensor, sd=options.sd, rig=rig) or options.sd
    with misuse():
        measured = measure(
            readings, sensor=options.sensor, robot=options.robot, sd=sd, tip_sd=options.tip_sd,
            bias_sd=options.bias_sd, rig=rig,
        )  # fmt: skip
    if rig is None and (question := misspelt(readings)):
        complain("warning", question)
    units = units_of_parts(list(part_paths), options.units, used)
    if used and units is not None:
        complain("warning", f"--units {units} holds for the readings and for the parts: neither have their own.")
    parts = files.read_all_parts(part_paths, units, quiet=options.json)
    column = _HEADER.search(_beginning(path))
    scale = posterior.scale_of(measured.points, parts, column[1] if column else "", options.units or _own_unit(parts))
    doubt = posterior.about_size(measured.points, scale) or posterior.about_spread(measured.covs, scale)
    if doubt is not None:
        complain("warning", doubt.message)
    return Given(readings, measured, parts, rig, scale, doubt is not None)


def _beginning(path: str) -> str:
    """Of a file; a folder, as recordings of ROS are, has none."""
    if os.path.isdir(path):
        return ""
    with open(path, encoding="utf-8", errors="replace") as text_file:
        return text_file.read(20_000)


def _questioned(answer: posterior.Answer, given: Given, ask: posterior.Search, *, placed: bool) -> posterior.Answer:
    """The answer with what was probably meant otherwise as its last finding, of which a person is warned."""
    if given.doubted:
        return answer
    frames = posterior.about_frames(answer, given.scale, given.measured)
    question = posterior.about_conventions(answer, given.readings, given.parts, ask, placed=placed)
    if question is None or (frames is not None and frames.kind == question.kind == "units"):
        question = frames  # of units it knows which were stated, and where
    if question is None:
        return answer
    others = tuple(one for one in answer.findings if one.role != "question")
    complain("warning", question.message)
    return replace(answer, findings=(*others, question))


def _report(
    path: str, answer: posterior.Answer, given: Given, options: Options, known: posterior.PosePrior | None
) -> None:
    from tanteo.planning import Sensing
    from tanteo.render import gather, report_page

    sensing = Sensing(
        options.sensor, options.robot, options.sd, options.tip_sd, given.rig, options.tolerance, options.bias_sd
    )
    page = report_page(answer, gather(given.readings, sensing, known), given.parts, files.this_run())
    files.write_page(path, page, as_json=options.json)
