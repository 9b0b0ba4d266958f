"""Read images of the sensed object for ``identify`` and ``locate``, and find the outline of the object in them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo import io
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import complain, print_text

if TYPE_CHECKING:
    from tanteo.geometry.typing import Vectors
    from tanteo.posterior import SeenOutline, Table
    from tanteo.vision import View


def read_views(
    images: Sequence[str] | None, cameras: Sequence[str] | None, marks: Sequence[str] | None
) -> tuple[View, ...]:
    """Read the images of ``--image`` with their cameras.

    Args:
        images: image files; None for none.
        cameras: calibration files, one for all images or one for each.
        marks: files of known points, one for all images or one for each; None for none.

    Raises:
        MisuseError: an image has no camera, a camera has no image, the number of cameras or marks differs from that of
            images, or the pose of a camera is unknown.
        InputError: a file cannot be read.
    """
    if not images:
        if cameras or marks:
            raise MisuseError(
                "--image: expected an image beside --camera and --marks, got none. Name it, or drop them."
            )
        return ()
    if not cameras:
        raise MisuseError("--image: expected --camera beside it, got none. Name the camera's calibration file.")
    return tuple(
        _read_view(*three)
        for three in zip(
            images, _one_each("--camera", cameras, images), _one_each("--marks", marks, images), strict=True
        )
    )


def _one_each(option: str, given: Sequence[str] | None, images: Sequence[str]) -> list[str | None]:
    """Return one value of an option for each image."""
    if not given:
        return [None] * len(images)
    if len(given) not in (1, len(images)):
        raise MisuseError(
            f"{option}: expected one for all images or one each ({len(images)}), got {len(given)}. Name each once."
        )
    return [*given] * (len(images) if len(given) == 1 else 1)


def _read_view(image: str, camera: str | None, marks: str | None) -> View:
    from tanteo.vision import View

    assert camera is not None
    pixels = io.read_image(image)
    taken = io.read_camera(camera, shape=pixels.shape)
    for note in taken.notes:
        complain("warning", f"{camera}: {note}")
    if marks is not None:
        taken, _ = io.scenes.place_camera(taken, marks)
    if taken.T_world_camera is None:
        raise MisuseError(
            f"--camera: expected the camera's pose in the world of the readings, got {camera} without it. Add "
            "--marks FILE, or T_world_camera to the file."
        )
    return View(pixels, taken)


def outline_of(view: View, points: Vectors, parts: Sequence[Any], table: Table | None) -> SeenOutline:
    """Return the outline of the object on which the readings lie, and print how many parts fit it.

    Args:
        view: image with its camera.
        points: points of the readings, world frame ``(n, 3)`` [m].
        parts: candidate parts.
        table: table under the object; None for the world's x-y plane.

    Raises:
        InputError: the image does not show the object.
    """
    from tanteo.vision import outline_of_readings

    frame = np.eye(4) if table is None else table.frame
    found = outline_of_readings(view.pixels, view.camera, points, T_world_table=frame)
    odds = found.outline.log_odds(parts)
    of = f"of {found.regions}" if found.regions > 1 else "the only one"
    print_text(
        f"The readings are on the object at {found.pixels[0]:.0f}, {found.pixels[1]:.0f} px of the image ({of}). "
        f"Parts that fit its outline: {int(np.count_nonzero(odds > 0)):,} of {len(odds):,}.",
        sys.stderr,
    )
    if found.beside:
        complain("warning", f"{found.beside} of {len(points)} readings are off that object in the image.")
    return found.outline
