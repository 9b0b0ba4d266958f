"""Implement ``tanteo see``: recognize and locate the parts in images."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import typer

from tanteo import io, render
from tanteo.cli import arguments as args
from tanteo.cli import files
from tanteo.cli.image import Cameras, read_views, require_poses
from tanteo.cli.printing import emit, layout, leave, print_text, put, warned

if TYPE_CHECKING:
    from tanteo.vision import Camera, Sight

_DARK = 32.0
"""Largest grey level of a dark image."""


def see(
    images: Annotated[list[str], typer.Argument(metavar="IMAGE...", help="Image files (PNG, JPEG, ...) of one scene.")],
    camera: Annotated[
        list[str],
        args.option(
            "--camera", "FILE", "Calibration file of the camera (OpenCV, ROS, Kalibr), one for all or one each."
        ),
    ],
    parts: args.PartPaths,
    units: args.Units = None,
    marks: args.MarksPaths = None,
    hand_poses: args.HandPosesPath = None,
    hand_eye: args.HandEyePath = None,
    hand_eye_sd: args.HandEyeSd = None,
    robot: args.Robot = None,
    no_table: args.NoTable = False,
    rectified: Annotated[
        bool, args.option("--rectified", None, "The image is rectified: use the projection_matrix of the camera file.")
    ] = False,
    picture: Annotated[
        str | None,
        args.option(
            "--picture",
            "FILE",
            "Write the image with the result drawn into it (PNG, JPEG); several are below each other.",
        ),
    ] = None,
    write_detections: args.DetectionsTarget = None,
    top: args.Top = 5,
    json: args.Json = False,
    verbose: args.Verbose = False,
) -> None:
    """Recognize and locate the parts in images.

    Finds several parts on a table if the pose of the camera is known (its file, --marks, --hand-poses), else one part
    in any pose. Several images of one scene give one answer.
    """
    start = time.perf_counter()
    cameras = Cameras(
        camera=camera, marks=marks, hand_poses=hand_poses, hand_eye=hand_eye, hand_eye_sd=hand_eye_sd, robot=robot,
        rectified=rectified, no_table=no_table,
    )  # fmt: skip
    files.check_target("--picture", picture, (".png", ".jpg"))
    sources = [("the image", image) for image in images]
    files.check_target("--write-detections", write_detections, (".json",))
    targets = ("--picture", picture), ("--write-detections", write_detections)
    files.check_different(*targets, inputs=[*sources, *cameras.files])
    views = read_views(images, cameras)
    if len(views) > 1:
        require_poses(views, cameras)
    first, others = views[0].camera, views[1:]
    if not json:
        emit(_taken(first, no_table), sys.stderr)
    for image, view in zip(images, views, strict=True):
        if view.pixels.max() < _DARK and not json:
            largest = f"its largest level is {view.pixels.max():.0f} of 255"
            print_text(f"{image}: a dark image, {largest}. If it has 12 bits in 16, scale it.", sys.stderr)
    models = files.read_all_parts(parts, units, quiet=json)
    from tanteo.render.image_picture import draw_sight, stacked
    from tanteo.vision import see

    loaded = time.perf_counter() - start
    sight = see(views[0].pixels, first, models, others=others, on_table=not no_table, top=top)
    if picture is not None:
        drawn = [
            draw_sight(view.pixels, view.camera, one) for view, one in zip(views, (sight, *sight.others), strict=True)
        ]
        io.write_image(picture, stacked(drawn))
    if write_detections is not None:
        files.write_detections(write_detections, [seen.answer for seen in sight.objects], sight.frame)
    sight = _timed(sight, loaded, time.perf_counter() - start)
    if json:
        put(io.documents.sight_json(sight, warned()))
    else:
        emit(render.text.sight_lines(sight, verbose=verbose, layout=layout()))
    leave(decided=bool(sight.objects) and all(seen.answer.status == "recognized" for seen in sight.objects))


def _taken(camera: Camera, no_table: bool) -> list[str]:
    """Return lines about the assumptions on the camera."""
    lines = [f"Edges within {camera.edge_sd:.3g} px of where the lens puts them, 1 sd (edge_sd_px of the camera file)."]
    if camera.T_world_camera is None:
        lines.append(
            "The pose of the camera is unknown (T_world_camera in its file, or --marks), and so is the table. The "
            "search is for one part in any pose, in the camera's frame (x right, y down, z ahead)."
        )
    elif no_table:
        lines.append("The search is for one part in any pose, in the world of the cameras (--no-table).")
    return lines


def _timed(sight: Sight, load: float, total: float) -> Sight:
    elapsed = {"load": load, "search": total - load, "total": total}
    objects = (replace(seen, answer=replace(seen.answer, elapsed=elapsed)) for seen in sight.objects)
    return replace(sight, objects=tuple(objects))
