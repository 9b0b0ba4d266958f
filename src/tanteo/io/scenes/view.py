"""Camera image of a scene, read or rendered, with the pose of the camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import BoolArray, FloatArray, Transforms
from tanteo.hand.simulator import Scene
from tanteo.io.documents.scene_file import SceneFile
from tanteo.io.poses.camera_file import read_camera
from tanteo.io.poses.images import read_image
from tanteo.io.readings.marks_csv import read_marks
from tanteo.parts import Part
from tanteo.planning.execution import HYPOTHESES, part_seen
from tanteo.planning.start import Start
from tanteo.vision import Camera, Sighting, render, see_table
from tanteo.vision.regions import silhouette
from tanteo.vision.rendering import RenderedObject, Stage
from tanteo.vision.table import CameraPose, fit_camera

RENDER = "render"
"""Image argument for a rendering of the scene by the simulator, instead of a file."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneView:
    """Camera image of a scene.

    Attributes:
        image: grey levels ``(H, W)``.
        camera: camera with its pose.
        T_world_table: pose of the top of the table ``(4, 4)``.
        ignore: mask of the pixels of known furniture ``(H, W)``; None without any.
    """

    image: FloatArray
    camera: Camera
    T_world_table: Transforms
    ignore: BoolArray | None

    def recognize(self, parts: Sequence[Part], prior: Start | None = None) -> Sighting | None:
        """Recognize the objects in the image, and return the one nearest to the prior pose, or the largest one.

        Args:
            parts: candidate parts.
            prior: prior poses of the parts; None for the largest object.

        Returns:
            Object with its hypotheses; None if no object was recognized.
        """
        sight = see_table(
            self.image, self.camera, parts, T_world_table=self.T_world_table, top=HYPOTHESES, ignore=self.ignore
        )
        return part_seen(sight, prior)


def view_of(scene: SceneFile, image: str, camera: str | None = None, marks: str | None = None) -> SceneView:
    """Return the camera image of the table of a scene.

    Args:
        scene: scene with a table.
        image: image file, or :data:`RENDER`.
        camera: calibration file; that of the scene if None.
        marks: file of known points on the table, for the pose of the camera; that of the scene if None.

    Raises:
        InputError: The scene has no table or camera, or a file cannot be read.
        MissingExtraError: OpenCV is missing.
    """
    T_world_table = top_of_table(scene)
    placed = _camera_of(scene, camera, marks)
    seen = rendered(scene, placed, T_world_table) if image == RENDER else read_image(image)
    return SceneView(seen, placed, T_world_table, furniture_pixels(scene, placed))


def place_camera(camera: Camera, marks: str) -> tuple[Camera, CameraPose]:
    """Return a camera with its pose, fitted to known points on the table, and the fit.

    Args:
        camera: calibrated camera.
        marks: file of pixels and positions of the points.

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
        raise InputError(
            f"{file}: expected a key T_world_camera, the pose of the camera, got none. Add it, or use --marks."
        )
    return camera


def top_of_table(scene: SceneFile) -> Transforms:
    """Return the pose of the top of the table of a scene ``(4, 4)``.

    Args:
        scene: scene with a table.

    Raises:
        InputError: the scene has no table.
    """
    tables = [s for s in scene.furniture if s.name == "table"]
    if not tables:
        raise InputError(f"{scene.source}: expected a table [table] on which the part lies, got none. Add it.")
    return SE3.from_parts(np.eye(3), np.array([0.0, 0.0, tables[0].vertices[:, 2].max()]))


def rendered(scene: SceneFile, camera: Camera, T_world_table: Transforms, number: int = 0) -> FloatArray:
    """Render the true scene from a camera.

    Args:
        scene: scene; its seed determines the noise.
        camera: camera with its true pose.
        T_world_table: pose of the top of the table ``(4, 4)``.
        number: number of the image, whose noise differs from that of others.
    """
    assert camera.T_world_camera is not None
    to_table = SE3.inverse(T_world_table)
    objects = [
        RenderedObject.of_mesh(SE3.apply(to_table, solid.vertices), solid.triangles)
        for solid in scene.scene.solids
        if solid.name != "table"
    ]
    stage = Stage(replace(camera, T_world_camera=to_table @ camera.T_world_camera), objects)
    return render(stage, np.random.default_rng(scene.seed if not number else [scene.seed, number]))[0]


def furniture_pixels(scene: SceneFile, camera: Camera) -> BoolArray | None:
    """Return the mask of the pixels that show known furniture on the table, or None without any.

    Args:
        scene: scene with its furniture.
        camera: camera with its pose.
    """
    standing = [s for s in scene.furniture if s.name != "table"]
    if not standing:
        return None
    assert camera.T_world_camera is not None
    return np.asarray(silhouette(Scene.of(standing).surface, camera, SE3.inverse(camera.T_world_camera)))
