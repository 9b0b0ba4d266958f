"""``tanteo sense part --image``: where the session starts from what a camera sees of the scene."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tanteo.cli.options import MisuseError
from tanteo.cli.printing import emit, printable
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.active import Start
    from tanteo.inference import PreparedPart
    from tanteo.io import SceneFile
    from tanteo.parts import Part
    from tanteo.typing import BoolArray, FloatArray, Transforms
    from tanteo.vision import Camera, Sighting

RENDER = "render"
"""What ``--image`` says for the image that the simulator makes of the scene itself."""


@dataclass(frozen=True, slots=True)
class ImageOptions:
    """Options of the image.

    Attributes:
        image: File, or :data:`RENDER`.
        camera: Calibration file; None for the scene's.
        marks: File of known points of the table; None for the scene's, or where the calibration says where it stands.
    """

    image: str
    camera: str | None
    marks: str | None

    @property
    def files(self) -> list[tuple[str, str | None]]:
        """The files that are read, each with its option."""
        image = None if self.image == RENDER else self.image
        return [("--image", image), ("--camera", self.camera), ("--marks", self.marks)]


def image_options(image: str | None, camera: str | None, marks: str | None) -> ImageOptions | None:
    """The options from what was typed; None without an image.

    Raises:
        MisuseError: a camera without an image.
    """
    if image is None:
        if camera is not None or marks is not None:
            raise MisuseError(f"--camera, --marks: expected with --image, got none. Add --image FILE, or {RENDER}.")
        return None
    return ImageOptions(image, camera, marks)


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What the camera sees of the scene.

    Attributes:
        image: Grey levels.
        camera: Where it stands included.
        T_world_table: Of the table's top ``(4, 4)``.
        ignore: Pixels of known furniture; None without any.
    """

    image: FloatArray
    camera: Camera
    T_world_table: Transforms
    ignore: BoolArray | None


def view_of(scene: SceneFile, options: ImageOptions) -> View:
    """The image, read or rendered, and its camera.

    Raises:
        InputError: no table or no camera, or a file that cannot be read.
        MissingExtraError: without OpenCV.
    """
    import numpy as np

    from tanteo.io import read_image
    from tanteo.lie import SE3

    tables = [s for s in scene.furniture if s.name == "table"]
    if not tables:
        raise InputError(f"{scene.source}: expected a table [table] on which the part lies, got none. Add it.")
    T_world_table = SE3.from_parts(np.eye(3), np.array([0.0, 0.0, tables[0].vertices[:, 2].max()]))
    camera = _camera(scene, options)
    image = _rendered(scene, camera, T_world_table) if options.image == RENDER else read_image(options.image)
    return View(image, camera, T_world_table, _furniture(scene, camera))


def start_from_view(view: View, targets: tuple[PreparedPart, ...], prior: Start | None) -> Start | None:
    """What the image leaves open, said on standard error; None if it shows nothing and there is no prior pose.

    Args:
        view: the image and its camera.
        targets: the parts.
        prior: where they may be without the image.
    """
    from tanteo.execution import seen_start

    seen = seen_in(view, [target.part for target in targets], prior)
    return prior if seen is None else seen_start(seen, targets, prior)


def seen_in(view: View, parts: Sequence[Part], prior: Start | None = None) -> Sighting | None:
    """The object that is meant, None without any; what it may be is said on standard error."""
    from tanteo.execution import HYPOTHESES, part_seen
    from tanteo.vision import see_table

    sight = see_table(
        view.image, view.camera, parts, T_world_table=view.T_world_table, top=HYPOTHESES, ignore=view.ignore
    )
    seen = part_seen(sight, prior)
    emit([printable(image_words(seen))], sys.stderr)
    return seen


def image_words(seen: Sighting | None) -> str:
    """What the image says, in one line."""
    if seen is None:
        return "The image shows no part."
    answer, shares = seen.answer, dict[str, float]()
    for h in answer.hypotheses:
        shares[h.part] = shares.get(h.part, 0.0) + h.probability
    likely = [f"{name} {100 * p:.0f} %" for name, p in sorted(shares.items(), key=lambda item: -item[1]) if p > 0.005]
    words = f"The image: {', '.join([*likely, f'unknown object {100 * answer.unknown_probability:.0f} %'])}."
    return words if seen.question is None else f"{words} It leaves open: {seen.question.words}."


def _camera(scene: SceneFile, options: ImageOptions) -> Camera:
    from tanteo.cli.seeing import placed_camera
    from tanteo.io import read_camera

    paths = scene.camera
    if options.camera is None and paths is None:
        raise InputError(f"{scene.source}: expected a table [camera], got none. Add it, or say --camera FILE.")
    own = paths if options.camera is None else None
    file = options.camera if own is None else own.file
    marks = options.marks if own is None else options.marks or own.marks
    assert file is not None
    camera = placed_camera(read_camera(file), marks, quiet=True)
    if camera.T_world_camera is None:
        raise InputError(f"{file}: expected a key T_world_camera, where it stands, got none. Add it, or say --marks.")
    return camera


def _rendered(scene: SceneFile, camera: Camera, T_world_table: Transforms) -> FloatArray:
    """What the camera would see of the true scene."""
    from dataclasses import replace

    import numpy as np

    from tanteo.lie import SE3
    from tanteo.vision import Stage, Thing, render

    assert camera.T_world_camera is not None
    to_table = SE3.inverse(T_world_table)
    things = [
        Thing.of_mesh(SE3.apply(to_table, solid.vertices), solid.triangles)
        for solid in scene.scene.solids
        if solid.name != "table"
    ]
    stage = Stage(replace(camera, T_world_camera=to_table @ camera.T_world_camera), things)
    return render(stage, np.random.default_rng(scene.seed))[0]


def _furniture(scene: SceneFile, camera: Camera) -> BoolArray | None:
    """Pixels that show what is known to stand on the table."""
    import numpy as np

    from tanteo.lie import SE3
    from tanteo.simulator import Scene
    from tanteo.vision import silhouette

    standing = [s for s in scene.furniture if s.name != "table"]
    if not standing:
        return None
    assert camera.T_world_camera is not None
    return np.asarray(silhouette(Scene.of(standing).surface, camera, SE3.inverse(camera.T_world_camera)))
