"""Images of what readings were taken of: read beside them, and the outline that one shows of the object."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo import io
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import complain, say

if TYPE_CHECKING:
    from tanteo.geometry.typing import Vectors
    from tanteo.posterior import SeenOutline, Table
    from tanteo.vision import View


def read_views(
    images: Sequence[str] | None, cameras: Sequence[str] | None, marks: Sequence[str] | None
) -> tuple[View, ...]:
    """Return what ``--image``, ``--camera`` and ``--marks`` name; none where none is given.

    Cameras and marks are one for all images, or one each, in their order.

    Raises:
        MisuseError: an image without a camera, a camera without an image, another number of cameras or marks than of
            images, or a camera whose place is not known.
        InputError: a file that cannot be read.
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
        taken, _ = io.place_camera(taken, marks)
    if taken.T_world_camera is None:
        raise MisuseError(
            f"--camera: expected where the camera stands in the world of the readings, got {camera} without it. Say "
            "--marks FILE, or add T_world_camera to the file."
        )
    return View(pixels, taken)


def outline_of(view: View, points: Vectors, parts: Sequence[Any], table: Table | None) -> SeenOutline:
    """The outline of the object that readings are of, with a line that says which it is and how many parts have it.

    Raises:
        InputError: the image does not show it.
    """
    from tanteo.vision import outline_of_readings

    frame = np.eye(4) if table is None else table.frame
    found = outline_of_readings(view.pixels, view.camera, points, T_world_table=frame)
    odds = found.outline.log_odds(parts)
    of = f"of {found.regions}" if found.regions > 1 else "the only one"
    say(
        f"The readings are on the object at {found.pixels[0]:.0f}, {found.pixels[1]:.0f} px of the image ({of}). "
        f"Parts that fit its outline: {int(np.count_nonzero(odds > 0)):,} of {len(odds):,}.",
        sys.stderr,
    )
    if found.beside:
        complain("warning", f"{found.beside} of {len(points)} readings are off that object in the image.")
    return found.outline
