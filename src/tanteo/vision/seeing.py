"""An image to an answer, whether the camera's place is known or not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tanteo.typing import FloatArray
from tanteo.vision.sight import see_table
from tanteo.vision.solid import see_anywhere

if TYPE_CHECKING:
    from tanteo.parts import Part
    from tanteo.vision.camera import Camera
    from tanteo.vision.models import VisionModel
    from tanteo.vision.sight import Sight


def see(image: FloatArray, camera: Camera, parts: Sequence[Part] | Sequence[VisionModel], *, top: int = 5) -> Sight:
    """Which parts an image shows, where they are, and what a touch should settle.

    Args:
        image: grey levels from 0 to 255 ``(rows, columns)``; see :func:`tanteo.read_image`.
        camera: calibrated. Where it says where it stands (``T_world_camera``), parts lie on the table z = 0 of the
            world (:func:`tanteo.vision.see_table`); where it does not, one part in any pose is looked for, in the
            frame of the camera (:func:`tanteo.vision.see_anywhere`).
        parts: candidates.
        top: number of hypotheses for each object.

    Returns:
        The objects that were seen, each with its answer: part, pose with covariance, probability.

    Raises:
        InputError: no parts, or an image of another size than the camera's.
        MissingExtraError: without OpenCV (the extra ``vision``).

    Example:
        >>> image = tanteo.read_image("images/twins.png")
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> sight = tanteo.see(image, camera, [tanteo.read_part("parts/step_12mm.step")])
        >>> sight.frame, [seen.answer.status for seen in sight.objects]
        ('camera', ['recognized'])
    """
    look = see_anywhere if camera.T_world_camera is None else see_table
    return look(image, camera, parts, top=top)
