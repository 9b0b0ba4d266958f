"""Implement ``tanteo see``: recognize and locate the parts in an image."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import io, render
from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.printing import complain, emit, layout, leave, print_text, put, warned

if TYPE_CHECKING:
    from tanteo.vision import Camera, Sight
    from tanteo.vision.table import CameraPose

_DARK, _INEXACT = 32.0, 1.0
"""Largest grey level of a dark image; rms residual of marks above which the fit is poor [px]."""


def see(
    image: Annotated[str, typer.Argument(metavar="IMAGE", help="Image file (PNG, JPEG, ...).")],
    camera: Annotated[str, args.option("--camera", "FILE", "Calibration file of the camera (OpenCV, ROS, Kalibr).")],
    parts: args.PartPaths,
    units: args.Units = None,
    marks: Annotated[
        str | None,
        args.option(
            "--marks", "FILE", "Known points of the table and their pixels in the image, to place the camera (CSV)."
        ),
    ] = None,
    rectified: Annotated[
        bool, args.option("--rectified", None, "The image is rectified: use the projection_matrix of the camera file.")
    ] = False,
    picture: Annotated[
        str | None, args.option("--picture", "FILE", "Write the image with the result drawn into it (PNG, JPEG).")
    ] = None,
    top: args.Top = 5,
    json: args.Json = False,
    verbose: args.Verbose = False,
) -> None:
    """Recognize and locate the parts in an image.

    Finds several parts on a table whose pose the camera file or --marks states, else one part in any pose.
    """
    start = time.perf_counter()
    files.check_target("--picture", picture, (".png", ".jpg"))
    files.check_different(
        ("--picture", picture), inputs=[("the image", image), ("--camera", camera), ("--marks", marks)]
    )
    pixels = io.read_image(image)
    taken, fit = io.read_camera(camera, rectified=rectified, shape=pixels.shape), None
    for note in taken.notes:
        complain("warning", f"{camera}: {note}")
    if marks is not None:
        taken, fit = io.scenes.place_camera(taken, marks)
    if fit is not None and not json:
        emit([_fit_words(fit)], sys.stderr)
    if not json:
        emit(_taken(taken), sys.stderr)
    if pixels.max() < _DARK and not json:
        words = f"a dark image, its largest level is {pixels.max():.0f} of 255. If it has 12 bits in 16, scale it."
        print_text(f"{image}: {words}", sys.stderr)
    models = files.read_all_parts(parts, units, quiet=json)
    from tanteo.render import draw_sight
    from tanteo.vision import see_anywhere, see_table

    loaded = time.perf_counter() - start
    recognize = see_anywhere if taken.T_world_camera is None else see_table
    sight = recognize(pixels, taken, models, top=top)
    if picture is not None:
        io.write_image(picture, draw_sight(pixels, taken, sight))
    sight = _timed(sight, loaded, time.perf_counter() - start)
    if json:
        put(io.documents.sight_json(sight, warned()))
    else:
        emit(render.text.sight_lines(sight, verbose=verbose, layout=layout()))
    leave(decided=bool(sight.objects) and all(seen.answer.status == "recognized" for seen in sight.objects))


def _fit_words(fit: CameraPose) -> str:
    worst = int(fit.offs.argmax())
    words = f"Camera fitted to {len(fit.offs)} marks, {fit.rms:.2f} px rms"
    return words + (f"; number {worst + 1} is {fit.offs[worst]:.1f} px off." if fit.rms > _INEXACT else ".")


def _taken(camera: Camera) -> list[str]:
    """Return lines about the assumptions on the camera."""
    lines = [f"Edges within {camera.edge_sd:.3g} px of where the lens puts them, 1 sd (edge_sd_px of the camera file)."]
    if camera.T_world_camera is None:
        lines.append(
            "The pose of the camera is unknown (T_world_camera in its file, or --marks), and so is the table. The "
            "search is for one part in any pose, in the camera's frame (x right, y down, z ahead)."
        )
    return lines


def _timed(sight: Sight, load: float, total: float) -> Sight:
    elapsed = {"load": load, "search": total - load, "total": total}
    objects = (replace(seen, answer=replace(seen.answer, elapsed=elapsed)) for seen in sight.objects)
    return replace(sight, objects=tuple(objects))
