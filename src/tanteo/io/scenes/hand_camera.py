"""Camera on the hand of a simulated scene: its images, and the start of a session with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import Transforms
from tanteo.hand.simulator import SimulatedHand
from tanteo.io.documents.scene_file import SceneFile
from tanteo.io.poses.camera_file import read_camera
from tanteo.io.scenes.view import furniture_pixels, rendered, top_of_table
from tanteo.planning.execution import HYPOTHESES, part_seen, seen_start
from tanteo.planning.execution.camera_views import Eye
from tanteo.planning.start import Start
from tanteo.posterior import PreparedPart
from tanteo.vision import View
from tanteo.vision.camera import Mounting
from tanteo.vision.sight import see_shots, shot_of
from tanteo.vision.table import TableErrors


class HandCamera:
    """Camera on the hand of a simulated robot; its true pose on the hand differs from the stated one.

    Args:
        scene: scene with a camera on the hand.
        robot: simulated robot.
        targets: candidate parts.
        prior: prior poses of the parts; None without any.

    Attributes:
        views: images so far.

    Raises:
        InputError: the scene has no camera on the hand, or no table.
    """

    def __init__(
        self, scene: SceneFile, robot: SimulatedHand, targets: Sequence[PreparedPart], prior: Start | None
    ) -> None:
        if scene.wrist is None:
            raise InputError(f"{scene.source}: expected a table [wrist_camera] for --sensors camera, got none. Add it.")
        self._scene, self._robot, self._targets, self._prior = scene, robot, tuple(targets), prior
        self._T_world_table = top_of_table(scene)
        rng = np.random.default_rng([scene.seed, 1])
        sds = np.repeat(scene.wrist.sds, 3)
        mounting = Mounting(scene.wrist.T_hand_camera, np.diag(sds**2))
        self._T_true = mounting.T_hand_camera @ SE3.exp(sds * rng.normal(size=6))
        self._eye = Eye(read_camera(scene.wrist.file), mounting, _errors(scene))
        self.views: list[View] = []
        self._shots: list[Any] = []  # of shot_of

    @property
    def eye(self) -> Eye:
        """Return the camera and its place on the hand."""
        return self._eye

    def photograph(self) -> Start:
        """Take an image at the present pose of the hand, and return the start of a session with all images so far."""
        true = replace(self._eye.camera, T_world_camera=self._robot.truth[-1] @ self._T_true)
        pixels = rendered(self._scene, true, self._T_world_table, len(self.views))
        camera = self._eye.camera_at(self._robot.sensed.T_world_hand)
        self.views.append(View(pixels, camera, ignore=furniture_pixels(self._scene, camera)))
        parts, table = [target.part for target in self._targets], TableErrors()
        self._shots.append(shot_of(self.views[-1], parts, self._T_world_table, table))
        sight = see_shots(self._shots, parts, T_world_table=self._T_world_table, table=table, top=HYPOTHESES)
        return seen_start(part_seen(sight, self._prior), self._targets, self._prior)


def _errors(scene: SceneFile) -> Transforms | None:
    """Return the covariance of a pose of the hand ``(6, 6)``; None if the robot's poses are exact."""
    robot = scene.cell.robot
    if robot is None:
        return None
    sds = np.repeat(
        [np.hypot(robot.pos_repeat_std, robot.pos_abs_std), np.hypot(robot.rot_repeat_std, robot.rot_abs_std)], 3
    )
    return np.diag(sds**2)
