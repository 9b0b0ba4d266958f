"""Implement ``tanteo sense part``: the simulated hand of a scene recognizes and locates a part."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import resources
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import io, posterior, render
from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.misuse import MisuseError, misuse
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
    options: SessionOptions,
    scene: Annotated[
        str | None,
        args.option(
            "--scene", "FILE", "Scene: parts, table, hand (TOML); an example of a cell if only --cell is given."
        ),
    ] = None,
    parts: Annotated[
        list[str] | None,
        args.option("--parts", "FILE_OR_FOLDER...", "CAD files (STEP, STL) or folders of them; those of the example."),
    ] = None,
    cell: Annotated[
        str | None,
        args.option(
            "--cell",
            "ARM",
            "Arm that carries the hand: ur5e, ur3, ur5, ur10, panda, xarm7, or FILE#flange (URDF, MJCF).",
        ),
    ] = None,
    sensors: Annotated[
        str, args.option("--sensors", "LIST", "Sensors of the hand: proximity, or camera,proximity.")
    ] = "proximity",
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
    if scene is None and cell is None:
        raise MisuseError("--scene: expected a scene, or --cell for an example of a cell, got neither. Name one.")
    if scene is not None and not parts:
        raise MisuseError("--parts: expected the candidate parts, got none. Name files or folders.")
    with resources.as_file(resources.files("tanteo.bench.demo")) as example:
        options = options if parts or options.units is not None else replace(options, units="mm")
        source = str(example / "cell.toml") if scene is None else scene
        folders = parts or [str(example / "parts")]
        _sense(source, folders, options, cell, sensors_of(sensors), record, report, as_json=json, verbose=verbose)


def sensors_of(text: str) -> frozenset[str]:
    """Return the sensors that ``--sensors`` names.

    Args:
        text: value as typed.

    Raises:
        MisuseError: a name is unknown, or the proximity sensors are missing.
    """
    names = frozenset(word.strip() for word in text.split(","))
    if not names <= {"camera", "proximity"} or "proximity" not in names:
        raise MisuseError(f"--sensors: expected proximity, or camera,proximity, got '{text}'. Correct it.")
    return names


def _sense(
    scene: str,
    parts: Sequence[str],
    options: SessionOptions,
    cell: str | None,
    sensors: frozenset[str],
    record: str | None,
    report: str | None,
    *,
    as_json: bool,
    verbose: bool,
) -> None:
    """Run the session of a scene and print its answer."""
    from tanteo.hand.simulator.arm import ArmMotion
    from tanteo.io.scenes.hand_camera import HandCamera
    from tanteo.planning import sense_part

    files.check_report(report)
    files.check_target("--record", record)
    sources = [("--scene", scene), *image_files(options.image, options.camera, options.marks)]
    files.check_different(("--record", record), ("--report", report), inputs=sources, parts=parts)
    place = io.scenes.change_scene(io.read_scene(scene), seed=options.seed, standoff=options.standoff)
    place = place if cell is None else io.scenes.sessions.on_arm(place, cell)
    start = start_of(place, parts, options, as_json=as_json)
    with misuse(always=False):
        session, robot, rules = io.scenes.session_of(
            place, start, options.stop(), options.policy, options.form_sd, options.stated_errors
        )
    with kept(session, record) as keep, _shown(verbose=verbose) as show:

        def watch(visit: Visit) -> None:
            keep()
            show(visit)

        arm = robot.carrier if isinstance(robot.carrier, ArmMotion) else None
        eyes = HandCamera(place, robot, start.targets, start) if "camera" in sensors else None
        done = sense_part(
            session, robot, rules, furniture=io.scenes.furniture_of(place), errors=place.cell.robot, reach=arm,
            eyes=eyes, watch=watch,
        )  # fmt: skip
    clearance = io.scenes.least_clearance(place, robot)
    answer = session.answer()
    if as_json:
        facts = None if arm is None else arm.facts
        put(
            io.documents.executed_json(
                answer, done, readings=session.count, clearance=clearance, arm=facts, warnings=warned()
            )
        )
        if not done.end.reached:
            print_text(done.end.message, sys.stderr)
    else:
        words = () if arm is None else (arm.words,)
        emit(
            render.text.executed_lines(
                answer, done, session.count, clearance, arm=words, verbose=verbose, layout=layout()
            )
        )
    write_session(session, record)
    if report is not None:
        cost = render.text.executed_facts(done, session.count, clearance)
        files.report_session(report, session, *cost, as_json=as_json)
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
