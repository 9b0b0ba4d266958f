"""Implement ``tanteo sense``: the simulated hand of a scene senses a feature."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

from tanteo import io, render
from tanteo.cli import arguments as args
from tanteo.cli import files, typed
from tanteo.cli.misuse import MisuseError, require_image
from tanteo.cli.printing import emit, layout, leave, print_text, put
from tanteo.cli.sense_part import image_files, viewed
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.hand import Predicted


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
            "--forbid",
            "CORNERS",
            "Forbidden box: two corners, as 150,0,0,180,60,250mm; may be repeated.",
        ),
        typed.Words(typed.forbidden, list[str] | None),
    ] = None
    parts: Annotated[
        list[str] | None,
        args.option("--parts", "FILE_OR_FOLDER...", "CAD files that --image may show, or folders of them."),
    ] = None
    image: args.ImageFile = None
    camera: args.CameraFile = None
    marks: args.MarksFile = None
    face: Annotated[
        str | None,
        args.option("--face", "NAME", "Face of the part in --image, as 'face 6' (tanteo part show lists them)."),
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
    """Acquire the rim of a bore or boss, without touching it.

    Also acquires the face around it.
    """
    _sense("circle", options)


def sense_cylinder(options: Options) -> None:
    """Acquire the wall of a bore or boss, without touching it.

    Also acquires its rim and the face around it.
    """
    _sense("cylinder", options)


def _sense(kind: str, options: Options) -> None:
    """Acquire a feature of the scene, and print it."""
    files.check_target("--record", options.record)
    sources = [("--scene", options.scene), *image_files(options.image, options.camera, options.marks)]
    files.check_different(("--record", options.record), inputs=sources, parts=options.parts or [])
    scene = io.scenes.change_scene(
        io.read_scene(options.scene),
        seed=options.seed,
        standoff=options.standoff,
        forbidden=options.forbid or (),
        scaled=True,
    )
    expected = None if options.image is None else _expected(kind, scene, options)
    if expected is not None:
        scene = replace(scene, guesses={**scene.guesses, kind: expected.guess})
    got, robot = io.scenes.acquire(kind, scene)
    clearance = io.scenes.least_clearance(scene, robot)
    if options.record is not None:
        if got.readings is None:
            emit(["warning: there are no readings of the feature, so no record is written."], sys.stderr)
        else:
            with files.writing("--record", options.record):
                io.write_readings(got.readings, options.record, unit="m")
    if options.json:
        put(io.documents.sensed_json(got, seed=scene.seed, clearance=clearance, expected=expected))
    else:
        lines = render.text.sensed_lines(
            got, standoff=scene.standoff, clearance=clearance, seed=scene.seed, record=options.record,
            expected=expected, verbose=options.verbose, layout=layout(),
        )  # fmt: skip
        emit(lines)
    leave(decided=got.acquired)


def _expected(kind: str, scene: io.documents.SceneFile, options: Options) -> Predicted:
    """Return the expected feature of the most probable part in the image, and print its pose to standard error.

    Raises:
        InputError: the image shows no part, or the part has no such feature within reach of the hand.
    """
    assert options.image is not None
    view = viewed(scene, options.image, options.camera, options.marks)
    parts = files.read_all_parts(options.parts or [], options.units, quiet=True)
    seen = view.recognize(parts)
    print_text(render.text.sighting_words(seen), sys.stderr)
    if seen is None or not seen.answer.hypotheses:
        raise InputError("--image: expected a part on the table, got none that is known. Add its CAD file to --parts.")
    best, unknown = seen.answer.hypotheses[0], seen.answer.unknown_probability
    if unknown > best.probability:
        raise InputError(
            f"--image: expected one of the parts of --parts, got an unknown object with {100 * unknown:.0f} %. "
            "Add the CAD file of the object."
        )
    part = next(part for part in parts if part.name == best.part)
    expected = io.scenes.expected_feature(kind, scene, part, best, options.face)
    words = f"The hand goes to {expected.name} of {part.name}, P = {best.probability:.2f}"
    print_text(f"{words}, {render.text.known_words(expected)}.", sys.stderr)
    return expected
