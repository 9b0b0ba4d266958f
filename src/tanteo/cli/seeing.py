"""``tanteo see``: read image, camera and parts, look, draw, print."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import typer

from tanteo.cli.answer import answer_lines
from tanteo.cli.part_files import read_all_parts
from tanteo.cli.printing import emit, printable, put, warned
from tanteo.cli.running import UNDECIDED
from tanteo.cli.targets import check_different, check_target
from tanteo.errors import DegenerateError, InputError

if TYPE_CHECKING:
    from tanteo.vision import Camera, Sight, Sighting


_DARK, _ROUGH = 32.0, 1.0
"""Below this level an image is dark; from this on marks are rough [px]."""


@dataclass(frozen=True, slots=True)
class SeeOptions:
    """Options of ``see``.

    Attributes:
        image: File of the image.
        camera: Calibration file.
        parts: Files and folders of parts.
        units: Of part files that carry none.
        marks: File of known points of the table; None where the camera's file says where it stands.
        picture: File to draw to; None for no picture.
        top: How many hypotheses to report for each object.
    """

    image: str
    camera: str
    parts: Sequence[str]
    units: str | None
    marks: str | None
    picture: str | None
    top: int


def see_image(options: SeeOptions, *, as_json: bool, verbose: bool) -> None:
    """Read everything, look, draw, print; exits with 3 unless every object is recognized."""
    start = time.perf_counter()
    check_target("--picture", options.picture, (".png", ".jpg"))
    sources = [("the image", options.image), ("--camera", options.camera), ("--marks", options.marks)]
    check_different(("--picture", options.picture), inputs=sources)
    from tanteo.io import read_camera, read_image, sight_json, write_image

    camera = placed_camera(read_camera(options.camera), options.marks, quiet=as_json)
    image = read_image(options.image)
    if not as_json:
        emit(_taken(camera), sys.stderr)
    if image.max() < _DARK and not as_json:
        words = f"a dark image, its largest level is {image.max():.0f} of 255. Of 12 bits in 16? Scale them."
        emit([printable(f"{options.image}: {words}")], sys.stderr)
    parts = read_all_parts(options.parts, options.units, quiet=as_json)
    from tanteo.vision import draw_sight, see_anywhere, see_table

    loaded = time.perf_counter() - start
    look = see_anywhere if camera.T_world_camera is None else see_table
    sight = look(image, camera, parts, top=options.top)
    if options.picture is not None:
        write_image(options.picture, draw_sight(image, camera, sight))
    sight = _timed(sight, loaded, time.perf_counter() - start)
    statuses = [seen.answer.status for seen in sight.objects] or ["unknown"]
    if as_json:
        put(sight_json(sight, warned()))
    else:
        emit(sight_lines(sight, verbose=verbose))
    if any(status != "recognized" for status in statuses):
        raise typer.Exit(UNDECIDED)


def placed_camera(camera: Camera, marks: str | None, *, quiet: bool) -> Camera:
    """The camera with its place, from marks if there are any."""
    if marks is None:
        return camera
    from tanteo.io import read_marks
    from tanteo.vision import fit_camera

    pixels, points = read_marks(marks)
    try:
        fit = fit_camera(camera, pixels, points)
    except (InputError, DegenerateError) as error:
        raise type(error)(f"{marks}, {error}") from None
    if not quiet:
        worst = int(fit.offs.argmax())
        words = f"Camera fitted to {len(points)} marks, {fit.rms:.2f} px rms"
        words += f"; number {worst + 1} is {fit.offs[worst]:.1f} px off." if fit.rms > _ROUGH else "."
        emit([words], sys.stderr)
    return replace(camera, T_world_camera=fit.T_world_camera, covariance=fit.covariance)


def _taken(camera: Camera) -> list[str]:
    """What is taken of the camera."""
    lines = [f"Edges within {camera.edge_sd:g} px of where the lens puts them, 1 sd (edge_sd_px of the camera file)."]
    if camera.T_world_camera is None:
        lines.append(
            "No place of the camera (T_world_camera in its file, or --marks), so no table: one part in any pose is "
            "looked for, in the frame of the camera (x right, y down, z ahead)."
        )
    return lines


def _timed(sight: Sight, load: float, total: float) -> Sight:
    def with_time(seen: Sighting) -> Sighting:
        elapsed = {"load": load, "search": total - load, "total": total}
        return replace(seen, answer=replace(seen.answer, elapsed=elapsed))

    return replace(sight, objects=tuple(with_time(seen) for seen in sight.objects))


def sight_lines(sight: Sight, *, verbose: bool = False) -> list[str]:
    """The lines for a person: every object, largest first."""
    if not sight.objects:
        from tanteo.io import EMPTY

        return [f"unknown: {EMPTY.message}"]
    lines: list[str] = []
    for k, seen in enumerate(sight.objects, start=1):
        lines += [""] if lines else []
        lines.append(_heading(k, len(sight.objects), seen))
        lines += answer_lines(seen.answer, frame=sight.frame, verbose=verbose)
        if verbose and seen.alike:
            lines.append(f"By the outline alone: {printable(', '.join(seen.alike[:3]))}.")
        if seen.question is not None and seen.answer.status != "ambiguous":
            lines.append(f"To be sure, {printable(seen.question.words)}.")
    return lines


def _heading(k: int, n: int, seen: Sighting) -> str:
    if seen.region is None:
        return f"Object {k} of {n}"
    x0, x1, y0, y1 = seen.region.box
    words = f"Object {k} of {n}, columns {x0} to {x1}, rows {y0} to {y1}"
    if seen.region.cut:
        words += ", partly outside the image"
    if seen.outline is not None:
        o = seen.outline
        words += (
            f"; outline on the table {o['area'] * 1e4:.2f} +- {o.sd('area') * 1e4:.2f} cm2, "
            f"perimeter {o['perimeter'] * 1e3:.1f} +- {o.sd('perimeter') * 1e3:.1f} mm"
        )
    return words
