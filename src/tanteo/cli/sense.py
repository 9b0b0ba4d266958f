"""``tanteo sense``: a feature, or a part, sensed by the simulated hand of a scene."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tanteo import answers, io, scenes, text
from tanteo.cli import arguments as args
from tanteo.cli import files, typed
from tanteo.cli.misuse import MisuseError, misuse, require_image
from tanteo.cli.printing import UNDECIDED, complain, emit, has_colour, layout, leave, put, say, warned
from tanteo.cli.session_options import SessionOptions
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.acquisition import Predicted
    from tanteo.active import Start
    from tanteo.execution import Visit
    from tanteo.hand import ForbiddenBox
    from tanteo.session import Session

_ENDS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""The system's order to end, and a terminal that has gone."""


def parse_forbidden(texts: list[str]) -> list[ForbiddenBox]:
    """Boxes of ``--forbid``."""
    import numpy as np

    from tanteo.hand import ForbiddenBox

    boxes = []
    for corners in texts:
        values = io.parse_lengths(corners, "--forbid")
        if len(values) != 6:
            raise InputError(
                f"--forbid: expected two corners of three lengths, got '{corners}'. Write it as 150,0,0,180,60,250mm."
            )
        boxes.append(ForbiddenBox(corners, np.array(values[:3]), np.array(values[3:])))
    return boxes


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """Options of ``sense plane``, ``edge``, ``vertex``, ``circle`` and ``cylinder``."""

    scene: args.SceneFile
    standoff: args.Standoff = None
    seed: args.SceneSeed = None
    record: Annotated[str | None, args.option("--record", "FILE", "Write the readings (CSV).")] = None
    forbid: Annotated[
        list[Any] | None,
        args.option(
            "--forbid", "CORNERS", "Box to stay out of: two corners, as 150,0,0,180,60,250mm; may be repeated."
        ),
        typed.Words(parse_forbidden, list[str] | None),
    ] = None
    parts: Annotated[
        list[str] | None,
        args.option("--parts", "FILE_OR_FOLDER...", "CAD files that --image may show, or folders of them."),
    ] = None
    image: args.ImageFile = None
    camera: args.CameraFile = None
    marks: args.MarksFile = None
    face: Annotated[
        str | None, args.option("--face", "NAME", "Of the part in --image, as 'face 6' (see tanteo part show).")
    ] = None
    units: args.Units = None
    json: args.Json = False
    verbose: args.Verbose = False

    def __post_init__(self) -> None:
        require_image(self.image, self.camera, self.marks)
        if self.image is None and (self.parts or self.face is not None or self.units is not None):
            raise MisuseError("--parts, --face, --units: expected with --image, got none. Add --image render.")
        if self.image is not None and not self.parts:
            raise MisuseError("--image: expected with --parts, the CAD files that it may show, got none. Add --parts.")


def sense_plane(options: Options) -> None:
    """Acquire a flat face without touching it."""
    _sense("plane", options)


def sense_edge(options: Options) -> None:
    """Acquire a straight edge, and its face, without touching them."""
    _sense("edge", options)


def sense_vertex(options: Options) -> None:
    """Acquire a corner, its face and two edges, without touching them."""
    _sense("vertex", options)


def sense_circle(options: Options) -> None:
    """Acquire the rim of a bore or a boss, and its face, without touching them."""
    _sense("circle", options)


def sense_cylinder(options: Options) -> None:
    """Acquire the wall of a bore or a boss, its rim and its face, without touching them."""
    _sense("cylinder", options)


def _sense(kind: str, options: Options) -> None:
    """Acquire a feature of the scene, print it."""
    files.check_target("--record", options.record)
    sources = [("--scene", options.scene), *_read_from(options.image, options.camera, options.marks)]
    files.check_different(("--record", options.record), inputs=sources, parts=options.parts or [])
    scene = scenes.change_scene(
        io.read_scene(options.scene),
        seed=options.seed,
        standoff=options.standoff,
        forbidden=options.forbid or (),
        scaled=True,
    )
    expected = None if options.image is None else _expected(kind, scene, options)
    if expected is not None:
        scene = replace(scene, guesses={**scene.guesses, kind: expected.guess})
    got, robot = scenes.acquire(kind, scene)
    clearance = scenes.least_clearance(scene, robot)
    if options.record is not None:
        if got.readings is None:
            emit(["warning: nothing was read on purpose, so there is no record."], sys.stderr)
        else:
            with files.writing("--record", options.record):
                io.write_readings(got.readings, options.record, unit="m")
    if options.json:
        put(io.sensed_json(got, seed=scene.seed, clearance=clearance, expected=expected))
    else:
        lines = text.sensed_lines(
            got, standoff=scene.standoff, clearance=clearance, seed=scene.seed, record=options.record,
            expected=expected, verbose=options.verbose, layout=layout(),
        )  # fmt: skip
        emit(lines)
    leave(decided=got.acquired)


def _read_from(image: str | None, camera: str | None, marks: str | None) -> list[tuple[str, str | None]]:
    """The files of an image that are read, each with its option."""
    return [("--image", None if image == "render" else image), ("--camera", camera), ("--marks", marks)]


def _view(scene: io.SceneFile, image: str, options: Options | SessionOptions) -> scenes.SceneView:
    """What the image shows of the scene, with a warning for what was taken as something of its camera file."""
    view = scenes.view_of(scene, image, options.camera, options.marks)
    for note in view.camera.notes:
        complain("warning", f"{options.camera or scene.source}: {note}")
    return view


def _expected(kind: str, scene: io.SceneFile, options: Options) -> Predicted:
    """The feature that the likeliest part has for the hand; where it should be is said on standard error.

    Raises:
        InputError: Nothing was seen, or the part has no such feature that the hand can come to.
    """
    assert options.image is not None
    view = _view(scene, options.image, options)
    parts = files.read_all_parts(options.parts or [], options.units, quiet=True)
    seen = view.look(parts)
    say(text.sighting_words(seen), sys.stderr)
    if seen is None or not seen.answer.hypotheses:
        raise InputError("--image: expected a part on the table, got none that is known. Add its CAD file to --parts.")
    best, unknown = seen.answer.hypotheses[0], seen.answer.unknown_probability
    if unknown > best.probability:
        raise InputError(
            f"--image: expected one of the parts of --parts, got an unknown object with {100 * unknown:.0f} %. "
            "Add the CAD file of what lies there."
        )
    part = next(part for part in parts if part.name == best.part)
    expected = scenes.expected_feature(kind, scene, part, best, options.face)
    words = f"The hand goes to {expected.name} of {part.name}, P = {best.probability:.2f}"
    say(f"{words}, {text.known_words(expected)}.", sys.stderr)
    return expected


def sense_part(
    scene: args.SceneFile,
    parts: Annotated[
        list[str], args.option("--parts", "FILE_OR_FOLDER...", "CAD files (STEP, STL) or folders of them.")
    ],
    options: SessionOptions,
    record: Annotated[
        str | None, args.option("--record", "FILE", "Write the session (JSON), or its readings (.csv).")
    ] = None,
    report: args.Report = None,
    json: args.Json = False,
    verbose: args.Verbose = False,
) -> None:
    """Find out which part is there and where, from a rough idea of its place, by range sensors on a hand."""
    from tanteo.execution import sense_part

    files.check_report(report)
    files.check_target("--record", record)
    sources = [("--scene", scene), *_read_from(options.image, options.camera, options.marks)]
    files.check_different(("--record", record), ("--report", report), inputs=sources, parts=parts)
    place = scenes.change_scene(io.read_scene(scene), seed=options.seed, standoff=options.standoff)
    start = start_of(place, parts, options, as_json=json)
    with misuse(always=False):
        session, robot, rules = scenes.session_of(place, start, options.stop(), options.policy)
    with kept(session, record) as keep, _shown(verbose=verbose) as show:

        def watch(visit: Visit) -> None:
            keep()
            show(visit)

        done = sense_part(
            session, robot, rules, furniture=scenes.furniture_of(place), errors=place.cell.robot, watch=watch
        )
    clearance = scenes.least_clearance(place, robot)
    answer = session.answer()
    if json:
        put(io.executed_json(answer, done, readings=session.count, clearance=clearance, warnings=warned()))
        if not done.end.reached:
            say(done.end.why, sys.stderr)
    else:
        emit(text.executed_lines(answer, done, session.count, clearance, verbose=verbose, layout=layout()))
    _write(session, record)
    if report is not None:
        files.report_session(report, session, *text.executed_facts(done, session.count, clearance), as_json=json)
    leave(decided=answer.status == "recognized" and done.end.reached)


def start_of(
    scene: io.SceneFile, part_paths: Sequence[str], options: SessionOptions, *, as_json: bool = False
) -> Start:
    """Where a session in a scene starts; what an image shows is said on standard error.

    Raises:
        InputError: Nobody says where the parts may be.
        Exit: An image shows none of them, and nobody says either.
    """
    known = options.known()
    view = None if options.image is None else _view(scene, options.image, options)
    parts = files.read_all_parts(part_paths, options.units, quiet=as_json)
    start, seen = scenes.start_of(
        scene, parts, known, view, outlier_rate=options.outlier_rate, unknown=options.unknown_prior
    )
    if view is not None:
        say(text.sighting_words(seen), sys.stderr)
    if start is not None:
        return start
    if view is None:
        raise InputError(
            f"{scene.source}: expected a table [prior] with the prior pose, got none. Add it, give --pose-prior, "
            "or show an --image."
        )
    message = "the image shows no part on the table, and no prior pose is given. Give --pose-prior."
    if as_json:
        put(io.recognition_json(answers.Answer("unknown", message, (), 1.0)))
    say(f"unknown: {message}", sys.stderr if as_json else sys.stdout)
    raise typer.Exit(UNDECIDED)


@contextmanager
def _shown(*, verbose: bool) -> Iterator[Callable[[Visit], None]]:
    """A line for every question on standard error; on a terminal also that the hand is under way."""
    if not sys.stderr.isatty():
        yield lambda visit: emit(text.visit_lines(visit, verbose=verbose), sys.stderr)
        return
    from rich.console import Console

    console = Console(stderr=True, no_color=not has_colour(sys.stderr), highlight=False)
    with console.status("sensing") as status:

        def watch(visit: Visit) -> None:
            for line in text.visit_lines(visit, verbose=verbose):
                console.print(line, markup=False, soft_wrap=True)
            status.update(f"sensing: {visit.seconds:.0f} s simulated")

        yield watch


@contextmanager
def kept(session: Session, record: str | None) -> Iterator[Callable[[], None]]:
    """What was told until an interruption (Ctrl-C, an order to end, a terminal that has gone) is in the record.

    Yields:
        To call after every question: who is killed, or loses power, has the record up to there.
    """
    failed = list[InputError]()

    def keep() -> None:
        if record is None or session.readings is None or failed:
            return
        try:
            _write(session, record)
        except InputError as error:  # the end will say it again, and then it is a failure
            failed.append(error)
            complain("warning", f"{error} Sensing goes on.")

    ours = threading.current_thread() is threading.main_thread()  # others may not listen to signals
    heard = [number for number in _ENDS if ours and signal.getsignal(number) != signal.SIG_IGN]  # nohup means it
    before = {number: signal.signal(number, _interrupt) for number in heard}
    try:
        yield keep
    except KeyboardInterrupt:
        if record is not None and session.readings is not None:
            _write(session, record)
            say(f"record written up to here: {record}", sys.stderr)
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _write(session: Session, record: str | None) -> None:
    """The record of the session; of a file whose name ends in .csv, the readings alone."""
    if record is None:
        return
    if session.readings is None:
        complain("warning", "nothing was read, so there is no record.")
        return
    with files.writing("--record", record):
        if record.lower().endswith(".csv"):
            io.write_readings(session.readings, record, unit="m")
        else:
            io.write_record(session, record)
