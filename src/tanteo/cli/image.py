"""Read images with the poses of their cameras, and find the outline of the object of readings in them."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tanteo import io
from tanteo.cli.misuse import MisuseError
from tanteo.cli.printing import complain, print_text

INEXACT = 1.0
"""Rms residual of marks or corners of a board above which the fit is poor [px]."""

if TYPE_CHECKING:
    from tanteo.geometry.typing import Vectors
    from tanteo.io.poses.hand_eye_file import HandPose
    from tanteo.posterior import SeenOutline, Table
    from tanteo.vision import View


@dataclass(frozen=True, slots=True, kw_only=True)
class Cameras:
    """Options that state the cameras of images and their poses.

    Attributes:
        camera: calibration files, one for all images or one for each.
        marks: files of known points, one for all images or one for each; None for none.
        hand_poses: table of the poses of the hand at which a camera on it took the images; None for a fixed camera.
        hand_eye: result of the hand-eye calibration of that camera.
        hand_eye_sd: standard deviations of its position [m] and rotation [rad], in place of those of the file.
        robot: preset of the robot, whose errors apply to poses of the hand without their own.
        rectified: whether the images are rectified.
        no_table: whether the object may have any pose.
    """

    camera: Sequence[str] | None
    marks: Sequence[str] | None = None
    hand_poses: str | None = None
    hand_eye: str | None = None
    hand_eye_sd: tuple[float, float] | None = None
    robot: str | None = None
    rectified: bool = False
    no_table: bool = False

    @property
    def files(self) -> list[tuple[str, str | None]]:
        """Return the files that the options name, with the names of the options."""
        several = [("--camera", one) for one in self.camera or ()] + [("--marks", one) for one in self.marks or ()]
        hand_eye = self.hand_eye and self.hand_eye.partition("#")[0]
        return [*several, ("--hand-poses", self.hand_poses), ("--hand-eye", hand_eye)]


def read_views(images: Sequence[str] | None, cameras: Cameras) -> tuple[View, ...]:
    """Read images with their cameras.

    Args:
        images: image files; None for none.
        cameras: their cameras. The pose of a camera may be unknown if there is one image.

    Raises:
        MisuseError: an image has no camera, a camera has no image, the number of cameras, marks or poses of the hand
            differs from that of images, or options contradict each other.
        InputError: a file cannot be read.
    """
    if not images:
        if any(file is not None for _, file in cameras.files):
            raise MisuseError(
                "--image: expected an image beside --camera, --marks, --hand-poses and --hand-eye, got none. Name it, "
                "or drop them."
            )
        return ()
    if not cameras.camera:
        raise MisuseError("--image: expected --camera beside it, got none. Name the camera's calibration file.")
    if (cameras.hand_poses is None) != (cameras.hand_eye is None):
        raise MisuseError(
            "--hand-poses, --hand-eye: expected both, the poses of the hand and the camera's pose on it, got one. Add "
            "the other."
        )
    if cameras.hand_eye is not None and cameras.marks:
        raise MisuseError("--marks: expected none beside --hand-eye, which places the camera, got some. Drop one.")
    named = _one_each("--camera", cameras.camera, images)
    marks = _one_each("--marks", cameras.marks, images)
    views = [
        _read_view(image, str(own), mark, cameras, len(images) > 1)
        for image, own, mark in zip(images, named, marks, strict=True)
    ]
    return tuple(views if cameras.hand_eye is None else _on_hand(views, images, cameras))


def require_poses(views: Sequence[View], cameras: Cameras) -> None:
    """Check that the pose of each camera is known.

    Args:
        views: images with their cameras.
        cameras: options of the cameras.

    Raises:
        MisuseError: the pose of a camera is unknown.
    """
    for k, view in enumerate(views):
        if view.camera.T_world_camera is None:
            name = (cameras.camera or [""])[min(k, len(cameras.camera or [""]) - 1)]
            raise MisuseError(
                f"--camera: expected the camera's pose in the world of the readings and of all images, got {name} "
                "without it. Add --marks FILE, T_world_camera to the file, or --hand-poses and --hand-eye."
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


def _read_view(image: str, camera: str, marks: str | None, options: Cameras, is_one_of_many: bool) -> View:
    from tanteo.vision import View

    pixels = io.read_image(image)
    taken = io.read_camera(camera, rectified=options.rectified, shape=pixels.shape)
    for note in taken.notes:
        complain("warning", f"{camera}: {note}")
    if marks is not None:
        taken, fit = io.scenes.place_camera(taken, marks)
        worst = int(fit.offs.argmax())
        words = (
            f"Camera{f' of {image}' if is_one_of_many else ''} fitted to {len(fit.offs)} marks, {fit.rms:.2f} px rms"
        )
        off = f"; number {worst + 1} is {fit.offs[worst]:.1f} px off." if fit.rms > INEXACT else "."
        print_text(words + off, sys.stderr)
    return View(pixels, taken, on_table=not options.no_table)


def _on_hand(views: Sequence[View], images: Sequence[str], options: Cameras) -> list[View]:
    """Return images with the poses of their cameras, which follow from those of the hand."""
    from tanteo.io.poses.hand_eye_file import camera_on_hand, read_mounting
    from tanteo.sensors.presets import robot_preset

    assert options.hand_poses is not None
    assert options.hand_eye is not None
    poses = hand_poses_of(images, options.hand_poses)
    sds = 0.0, 0.0
    if options.robot is not None:
        # the absolute error of a robot differs from pose to pose, so that it is independent for each image
        robot = robot_preset(options.robot)
        sds = (
            math.hypot(robot.pos_repeat_std, robot.pos_abs_std),
            math.hypot(robot.rot_repeat_std, robot.rot_abs_std),
        )
    elif any(pose.sds is None for pose in poses):
        complain(
            "warning",
            "The poses of the hand count as exact: state --robot, or columns hand_sd_mm and hand_sd_deg.",
        )
    mounting = read_mounting(options.hand_eye, options.hand_eye_sd)
    return [
        replace(view, camera=camera_on_hand(view.camera, mounting, pose, sds))
        for view, pose in zip(views, poses, strict=True)
    ]


def hand_poses_of(images: Sequence[str], path: str) -> tuple[HandPose, ...]:
    """Return the pose of the hand at which each image was taken.

    Args:
        images: image files.
        path: table of the poses, whose column ``image`` names the files; without it rows have the order of the images.

    Raises:
        MisuseError: the rows are not those of the images.
        InputError: the table cannot be read.
    """
    from tanteo.io.poses.hand_eye_file import read_hand_poses

    poses = read_hand_poses(path)
    names = [pose.image for pose in poses]
    if all(names):
        by_name = dict(zip(map(_stem, names), poses, strict=True))
        missing = [image for image in images if _stem(image) not in by_name]
        if missing or len(by_name) < len(poses):
            raise MisuseError(
                f"--hand-poses: expected one row for each image, got {', '.join(names)} for {', '.join(images)}. "
                "Correct the column image."
            )
        return tuple(by_name[_stem(image)] for image in images)
    if len(poses) != len(images):
        raise MisuseError(
            f"--hand-poses: expected one row for each image ({len(images)}), got {len(poses)}. Add a column image with "
            "the names of the files, or drop rows."
        )
    return poses


def _stem(path: str) -> str:
    return Path(path).name


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
    import numpy as np

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
