"""Whether image, camera, its place and the parts fit together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.errors import InputError
from tanteo.lie import SE3
from tanteo.parts import Part
from tanteo.typing import FloatArray, Transforms
from tanteo.vision.camera import Camera, on_plane
from tanteo.vision.models import VisionModel, prepare_vision

_FARTHEST = 200.0
"""A camera that stands more diagonals of the largest part above the table is told in a wrong unit."""


def check_sight(image: FloatArray, camera: Camera, parts: Sequence[Part] | Sequence[VisionModel]) -> list[VisionModel]:
    """The parts prepared, if all fits together.

    Raises:
        InputError: it does not.
    """
    if not parts:
        raise InputError("parts: expected at least one part, got none.")
    if np.shape(image) != (camera.size[1], camera.size[0]):
        raise InputError(
            f"image: expected {camera.size[1]} rows x {camera.size[0]} columns as the camera has, got "
            f"{np.shape(image)}. Give the calibration of this camera at this resolution."
        )
    return [part if isinstance(part, VisionModel) else prepare_vision(part) for part in parts]


def check_place(camera: Camera, T_camera_table: Transforms, models: Sequence[VisionModel]) -> None:
    """The camera is above the table, not far away, and looks at it.

    Raises:
        InputError: it does not.
    """
    height = float(SE3.inverse(T_camera_table)[2, 3])
    size = max(model.part.diagonal for model in models)
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * (np.array(camera.size) - 1.0)
    if height <= 0:
        got = f"one {-1e3 * height:.0f} mm below. Are x and y of the marks exchanged or mirrored, or its pose inverted?"
    elif height > _FARTHEST * size:
        got = f"one {height:.4g} m above, for parts of {size:.2g} m. Are its pose or the marks in another unit?"
    elif not np.any(np.isfinite(on_plane(camera, corners, T_camera_table))):
        got = "one that looks away. Is its pose inverted, or written column by column?"
    else:
        return
    raise InputError(f"camera: expected it above the table, looking at it, got {got}")
