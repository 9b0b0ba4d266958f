"""Implement ``tanteo sense part``: the simulated hand of a scene recognizes and locates a part."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.misuse import misuse
from tanteo.cli.printing import UNDECIDED, complain, emit, has_colour, layout, leave, print_text, put, warned
from tanteo.cli.session_options import SessionOptions
from tanteo.cli.session_record import kept, write_session
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.planning.execution import Visit
    from tanteo.planning.start import Start


def image_files(image: str | None, camera: str | None, marks: str | None) -> list[tuple[str, str | None]]:
    """Return the files of an image, each with its option.

    Args:
        image: value of ``--image``; ``render`` names no file.
        camera: value of ``--camera``.
        marks: value of ``--marks``.
    """
    return [("--image", None if image == "render" else image), ("--camera", camera), ("--marks", marks)]


def viewed(scene: io.documents.SceneFile, image: str, camera: str | None, marks: str | None) -> io.scenes.SceneView:
    """Return the image of a scene, and print warnings about assumptions on its camera.

    Args:
        scene: scene.
        image: value of ``--image``.
        camera: value of ``--camera``.
        marks: value of ``--marks``.
    """
    view = io.scenes.view_of(scene, image, camera, marks)
    for note in view.camera.notes:
        complain("warning", f"{camera or scene.source}: {note}")
    return view


def sense_part(
    scene: args.SceneFile,
    parts: Annotated[
        list[str], args.option("--parts", "FILE_OR_FOLDER...", "CAD files (STEP, STL) or folders of them.")
    ],
    options: SessionOptions,
    record: Annotated[
        str | None, args.option("--record", "FILE", "Write the session (JSON, or .mcap), or its readings (.csv).")
    ] = None,
    report: args.Report = None,
    json: args.Json = False,
    verbose: args.Verbose = False,
) -> None:
    """Recognize and locate a part with the range sensors of a simulated hand.

    Starts from a prior pose or an image.
    """
    from tanteo.planning import sense_part

    files.check_report(report)
    files.check_target("--record", record)
    sources = [("--scene", scene), *image_files(options.image, options.camera, options.marks)]
    files.check_different(("--record", record), ("--report", report), inputs=sources, parts=parts)
    place = io.scenes.change_scene(io.read_scene(scene), seed=options.seed, standoff=options.standoff)
    start = start_of(place, parts, options, as_json=json)
    with misuse(always=False):
        session, robot, rules = io.scenes.session_of(place, start, options.stop(), options.policy, options.form_sd)
    with kept(session, record) as keep, _shown(verbose=verbose) as show:

        def watch(visit: Visit) -> None:
            keep()
            show(visit)

        done = sense_part(
            session, robot, rules, furniture=io.scenes.furniture_of(place), errors=place.cell.robot, watch=watch
        )
    clearance = io.scenes.least_clearance(place, robot)
    answer = session.answer()
    if json:
        put(io.documents.executed_json(answer, done, readings=session.count, clearance=clearance, warnings=warned()))
        if not done.end.reached:
            print_text(done.end.message, sys.stderr)
    else:
        emit(render.text.executed_lines(answer, done, session.count, clearance, verbose=verbose, layout=layout()))
    write_session(session, record)
    if report is not None:
        files.report_session(report, session, *render.text.executed_facts(done, session.count, clearance), as_json=json)
    leave(decided=answer.status == "recognized" and done.end.reached)


def start_of(
    scene: io.documents.SceneFile, part_paths: Sequence[str], options: SessionOptions, *, as_json: bool = False
) -> Start:
    """Return the prior poses of a session in a scene; the result of an image is printed to standard error.

    Args:
        scene: scene.
        part_paths: files and folders of the parts.
        options: options of the session.
        as_json: whether standard output carries a JSON document.

    Raises:
        InputError: there is no prior pose and no image.
        Exit: the image shows none of the parts.
    """
    from tanteo.words.findings import NoPartOnTable

    known = options.known()
    view = None if options.image is None else viewed(scene, options.image, options.camera, options.marks)
    parts = files.read_all_parts(part_paths, options.units, quiet=as_json)
    start, seen = io.scenes.start_of(
        scene, parts, known, view, outlier_rate=options.outlier_rate, unknown=options.unknown_prior
    )
    if view is not None:
        print_text(render.text.sighting_words(seen), sys.stderr)
    if start is not None:
        return start
    if view is None:
        raise InputError(
            f"{scene.source}: expected a table [prior] with the prior pose, got none. Add it, give --pose-prior, "
            "or show an --image."
        )
    answer = posterior.Answer("unknown", (NoPartOnTable(),), (), 1.0)
    if as_json:
        put(io.documents.recognition_json(answer))
    print_text(f"unknown: {answer.message}", sys.stderr if as_json else sys.stdout)
    raise typer.Exit(UNDECIDED)


@contextmanager
def _shown(*, verbose: bool) -> Iterator[Callable[[Visit], None]]:
    """Print a line for every question to standard error; on a terminal also a status line."""
    if not sys.stderr.isatty():
        yield lambda visit: emit(render.text.visit_lines(visit, verbose=verbose), sys.stderr)
        return
    from rich.console import Console

    console = Console(stderr=True, no_color=not has_colour(sys.stderr), highlight=False)
    with console.status("sensing") as status:

        def watch(visit: Visit) -> None:
            for line in render.text.visit_lines(visit, verbose=verbose):
                console.print(line, markup=False, soft_wrap=True)
            status.update(f"sensing: {visit.seconds:.0f} s simulated")

        yield watch
