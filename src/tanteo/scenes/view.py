"""What a camera sees of a scene: its image, read or rendered, and where the camera stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.active import Start
from tanteo.errors import DegenerateError, InputError
from tanteo.execution import HYPOTHESES, part_seen
from tanteo.io import SceneFile, read_camera, read_image, read_marks
from tanteo.lie import SE3
from tanteo.parts import Part
from tanteo.simulator import Scene
from tanteo.typing import BoolArray, FloatArray, Transforms
from tanteo.vision import Camera, CameraPose, Sighting, Stage, Thing, fit_camera, render, see_table, silhouette

RENDER = "render"
"""In place of a file: the image that the simulator makes of the scene itself."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneView:
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

    def look(self, parts: Sequence[Part], prior: Start | None = None) -> Sighting | None:
        """The object that is meant: the one nearest to the prior pose, else the largest; None without any.

        Args:
            parts: That it may be.
            prior: Where they may be without the image.
        """
        sight = see_table(
            self.image, self.camera, parts, T_world_table=self.T_world_table, top=HYPOTHESES, ignore=self.ignore
        )
        return part_seen(sight, prior)


def view_of(scene: SceneFile, image: str, camera: str | None = None, marks: str | None = None) -> SceneView:
    """What a camera sees of the table of a scene.

    Args:
        scene: The scene.
        image: File, or :data:`RENDER`.
        camera: Calibration file; that of the scene if not given.
        marks: File of known points of the table; that of the scene if not given, or where the calibration says where
            the camera stands.

    Raises:
        InputError: No table or no camera, or a file that cannot be read.
        MissingExtraError: Without OpenCV.
    """
    tables = [s for s in scene.furniture if s.name == "table"]
    if not tables:
        raise InputError(f"{scene.source}: expected a table [table] on which the part lies, got none. Add it.")
    T_world_table = SE3.from_parts(np.eye(3), np.array([0.0, 0.0, tables[0].vertices[:, 2].max()]))
    placed = _camera_of(scene, camera, marks)
    seen = _rendered(scene, placed, T_world_table) if image == RENDER else read_image(image)
    return SceneView(seen, placed, T_world_table, _furniture(scene, placed))


def place_camera(camera: Camera, marks: str) -> tuple[Camera, CameraPose]:
    """A camera with its place from a file of known points of the table, and how well they fit.

    Raises:
        InputError: The file cannot be read, or has too few points.
        DegenerateError: The points lie on a line.
    """
    pixels, points = read_marks(marks)
    try:
        fit = fit_camera(camera, pixels, points)
    except (InputError, DegenerateError) as error:
        raise type(error)(f"{marks}, {error}") from None
    return replace(camera, T_world_camera=fit.T_world_camera, covariance=fit.covariance), fit


def _camera_of(scene: SceneFile, file: str | None, marks: str | None) -> Camera:
    if file is None:
        if scene.camera is None:
            raise InputError(f"{scene.source}: expected a table [camera], got none. Add it, or say --camera FILE.")
        file, marks = scene.camera.file, marks or scene.camera.marks
    camera = read_camera(file)
    if marks is not None:
        camera, _ = place_camera(camera, marks)
    if camera.T_world_camera is None:
        raise InputError(f"{file}: expected a key T_world_camera, where it stands, got none. Add it, or say --marks.")
    return camera


def _rendered(scene: SceneFile, camera: Camera, T_world_table: Transforms) -> FloatArray:
    """What the camera would see of the true scene."""
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
    standing = [s for s in scene.furniture if s.name != "table"]
    if not standing:
        return None
    assert camera.T_world_camera is not None
    return np.asarray(silhouette(Scene.of(standing).surface, camera, SE3.inverse(camera.T_world_camera)))
