"""The image of what readings were taken of: read beside them, and the outline that it shows of the object."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo import io, scenes
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import complain, say
from tanteo.lie import SE3

if TYPE_CHECKING:
    from tanteo.answers import SeenOutline, Table
    from tanteo.typing import FloatArray, Transforms, Vectors
    from tanteo.vision import Camera


@dataclass(frozen=True, slots=True, eq=False)
class Taken:
    """An image, and the camera that took it, standing in the world of the readings."""

    pixels: FloatArray
    camera: Camera


def read_taken(image: str | None, camera: str | None, marks: str | None) -> Taken | None:
    """What ``--image``, ``--camera`` and ``--marks`` name; None where none is given.

    Raises:
        MisuseError: an image without a camera, a camera without an image, or one whose place is not known.
        InputError: a file that cannot be read.
    """
    if image is None:
        if camera is not None or marks is not None:
            raise MisuseError(
                "--image: expected an image beside --camera and --marks, got none. Name it, or drop them."
            )
        return None
    if camera is None:
        raise MisuseError("--image: expected --camera beside it, got none. Name the camera's calibration file.")
    pixels = io.read_image(image)
    taken = io.read_camera(camera, shape=pixels.shape)
    for note in taken.notes:
        complain("warning", f"{camera}: {note}")
    if marks is not None:
        taken, _ = scenes.place_camera(taken, marks)
    if taken.T_world_camera is None:
        raise MisuseError(
            f"--camera: expected where the camera stands in the world of the readings, got {camera} without it. Say "
            "--marks FILE, or add T_world_camera to the file."
        )
    return Taken(pixels, taken)


def outline_of(taken: Taken, points: Vectors, parts: Sequence[Any], table: Table | None) -> SeenOutline:
    """The outline of the object that readings are of, with a line that says which it is and how many parts have it.

    Raises:
        InputError: the image does not show it.
    """
    from tanteo.vision import outline_of_readings

    found = outline_of_readings(taken.pixels, taken.camera, points, T_world_table=_frame_of(table))
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


def _frame_of(table: Table | None) -> Transforms:
    """The frame of a table, its plane z = 0; the world's own where none is named."""
    if table is None:
        return np.eye(4)
    x = np.linalg.svd(table.normal[None])[2][1]
    R = np.stack([x, np.cross(table.normal, x), table.normal], axis=1)
    return np.asarray(SE3.from_parts(R, table.point))
