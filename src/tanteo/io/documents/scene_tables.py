"""Define the tables of a scene file and their conversion to objects (``docs/formats_scenes.md``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeAlias

import numpy as np
from msgspec import Meta

from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.hand import Hand, gripper_body
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, RoundGuess, VertexGuess
from tanteo.hand.simulator import Cell, Solid, box
from tanteo.io.documents.document import made
from tanteo.io.documents.rig_file import read_rig
from tanteo.io.documents.schema import Direction, Length, Numbers, Point, Posed, Table
from tanteo.io.poses.prior_file import AngleSds, LengthSds
from tanteo.sensors.presets import robot_preset

AHEAD = 0.06
"""Default distance of the face to sense in front of the hand [m]."""


@dataclass(frozen=True, slots=True)
class CameraPaths:
    """Files of a camera that observes the scene.

    Attributes:
        file: path of the calibration file.
        marks: path of a file with known points, to localize the camera; None where the calibration states its pose.
    """

    file: str
    marks: str | None


SceneGuess: TypeAlias = FaceGuess | EdgeGuess | VertexGuess | RoundGuess
"""Rough position of a feature to sense."""

_NONE: Mapping[str, Any] = MappingProxyType({})


class TopTable(Table, frozen=True, kw_only=True, eq=False):
    """Table on which the parts stand."""

    top: Length = 0.0
    size: (
        Annotated[
            FloatArray, Numbers("length", ((2,),), lambda s: s if (s > 0).all() else None, "two positive lengths")
        ]
        | None
    ) = None

    def solid(self) -> Solid:
        """Return the table as a plate below its top."""
        x, y = (1.0, 1.0) if self.size is None else self.size
        return box("table", [-x / 2, -y / 2, self.top - 0.05], [x / 2, y / 2, self.top])


class PartTable(Posed, frozen=True, kw_only=True, eq=False):
    """Part given by its CAD file."""

    file: str
    units: str | None = None


class BoxTable(Posed, frozen=True, kw_only=True, eq=False):
    """Box in the world."""

    low: Point
    high: Point


class HandTable(Table, frozen=True, kw_only=True, eq=False):
    """Hand: its rig, start pose, and the motion limits of the robot."""

    rig: str = "paper-gripper"
    robot: str | None = None
    front: Point
    view_direction: Direction | None = None
    pair: Direction | None = None
    rate: Annotated[float, Numbers("rate"), Meta(ge=1.0)] = 100.0
    latency: Annotated[float, Numbers("time"), Meta(ge=0.0)] = 0.03
    speed: Annotated[float, Numbers("speed"), Meta(ge=1e-3)] = 0.25
    turn: Annotated[float, Numbers("turn"), Meta(ge=1e-2)] = 1.5
    cone_rays: Annotated[int, Meta(ge=0)] = 0

    def hand(self, folder: Path) -> tuple[Hand, Transforms]:
        """Return the hand and its start pose in the world ``(4, 4)`` [m].

        Args:
            folder: folder of the scene file.

        Raises:
            InputError: the rig is invalid, or ``pair`` is along ``view_direction``.
        """
        rig = read_rig(folder / self.rig if (folder / self.rig).exists() else self.rig)
        hand = Hand(rig, gripper_body(rig))
        z = np.array([0.0, 0.0, -1.0]) if self.view_direction is None else self.view_direction
        helper = np.eye(3)[int(np.argmin(np.abs(z)))]
        across = np.cross(z, helper - (helper @ z) * z if self.pair is None else self.pair)
        if self.pair is not None and np.linalg.norm(across) < 0.1:
            raise self.at.refused("pair", "a direction across view_direction", "Turn it.", "one along it")
        y = across / np.linalg.norm(across)
        own = np.stack([hand.pair, np.cross([0.0, 0.0, 1.0], hand.pair), [0.0, 0.0, 1.0]], axis=1)
        R = np.stack([np.cross(y, z), y, z], axis=1) @ own.T
        return hand, SE3.from_parts(R, self.front - R @ hand.front)

    def cell(self) -> Cell:
        """Return timing and motion limits of the robot."""
        robot = None if self.robot is None else robot_preset(self.robot)
        return Cell(1 / self.rate, self.latency, self.speed, self.turn, robot=robot, cone=self.cone_rays)


class SpaceTable(Table, frozen=True, kw_only=True, eq=False):
    """Bounds of the hand's workspace."""

    low: Point | None = None
    high: Point | None = None


class FaceTable(Table, frozen=True, kw_only=True, eq=False):
    """Rough position of a face."""

    point: Point
    normal: Direction


class EdgeTable(FaceTable, frozen=True, kw_only=True, eq=False):
    """Rough position of an edge."""

    direction: Direction


class VertexTable(FaceTable, frozen=True, kw_only=True, eq=False):
    """Rough position of a vertex."""

    arriving: Direction
    leaving: Direction


class RoundTable(Table, frozen=True, kw_only=True, eq=False):
    """Rough position of a bore or a boss."""

    point: Point
    axis: Direction
    radius: Annotated[Length, Meta(gt=0)]
    boss: bool = False

    def guess(self) -> RoundGuess:
        """Return the rough position for an acquisition."""
        values = {"point": self.point, "axis": self.axis, "radius": self.radius, "convex": self.boss}
        return made(RoundGuess, values, str(self.at))


class SenseTable(Table, frozen=True, kw_only=True, eq=False):
    """Features to sense, and distances to keep."""

    standoff: Annotated[Length, Meta(ge=1e-3)] = 0.02
    clearance: Annotated[Length, Meta(ge=1e-4)] | None = None
    plane: FaceTable | None = None
    edge: EdgeTable | None = None
    vertex: VertexTable | None = None
    circle: RoundTable | None = None
    cylinder: RoundTable | None = None

    def guesses(self, T: Transforms, hand: Hand) -> dict[str, SceneGuess]:
        """Return the rough positions of features by kind; the default face lies in front of the hand.

        Args:
            T: start pose of the hand in the world ``(4, 4)`` [m].
            hand: hand that carries the sensors.
        """
        out: dict[str, SceneGuess] = {
            "plane": FaceGuess(SE3.apply(T, hand.front + np.array([0.0, 0.0, AHEAD])), -T[:3, 2])
        }
        kinds: dict[str, Any] = {"plane": FaceGuess, "edge": EdgeGuess, "vertex": VertexGuess}
        for name, kind in kinds.items():
            given: FaceTable | None = getattr(self, name)
            if given is not None:
                out[name] = made(kind, given.values(), str(given.at))
        out |= {n: given.guess() for n, given in (("circle", self.circle), ("cylinder", self.cylinder)) if given}
        return out


class PriorTable(Posed, frozen=True, kw_only=True, eq=False):
    """Prior pose of a part's centre."""

    sd: LengthSds
    turn_sd: AngleSds


class CameraTable(Table, frozen=True, kw_only=True, eq=False):
    """Files of a camera."""

    file: str
    marks: str | None = None

    def paths(self, folder: Path) -> CameraPaths:
        """Return the file paths, resolved relative to the scene file.

        Args:
            folder: folder of the scene file.
        """
        return CameraPaths(str(folder / self.file), None if self.marks is None else str(folder / self.marks))


@dataclass(frozen=True, slots=True)
class ArmPlace:
    """Arm that carries the hand.

    Attributes:
        model: name of the arm, or ``FILE#flange``; see :func:`tanteo.hand.simulator.arm.read_arm`.
        T_world_base: pose of its base ``(4, 4)`` [m].
    """

    model: str
    T_world_base: Transforms


@dataclass(frozen=True, slots=True)
class WristCamera:
    """Camera on the hand.

    Attributes:
        file: path of the calibration file.
        T_hand_camera: stated pose in the hand's frame ``(4, 4)`` [m].
        sds: standard deviations of its position [m] and rotation [rad] about each axis.
    """

    file: str
    T_hand_camera: Transforms
    sds: tuple[float, float]


class ArmTable(Posed, frozen=True, kw_only=True, eq=False):
    """Arm that carries the hand, with the pose of its base."""

    model: str = "ur5e"

    def place(self, folder: Path) -> ArmPlace:
        """Return the arm, with the file of its model relative to the scene file.

        Args:
            folder: folder of the scene file.
        """
        file = folder / self.model.partition("#")[0]
        return ArmPlace(str(folder / self.model) if file.exists() else self.model, self.pose())


class WristTable(Posed, frozen=True, kw_only=True, eq=False):
    """Camera on the hand, with its pose in the hand's frame."""

    file: str
    sd: Length = 3e-4
    turn_sd: Annotated[float, Numbers("angle")] = float(np.radians(0.05))

    def camera(self, folder: Path) -> WristCamera:
        """Return the camera, with its file relative to the scene file.

        Args:
            folder: folder of the scene file.
        """
        return WristCamera(str(folder / self.file), self.pose(), (self.sd, self.turn_sd))


class Document(Table, frozen=True, kw_only=True, eq=False):
    """Content of a scene file."""

    seed: Annotated[int, Meta(ge=0)] = 0
    table: TopTable | None = None
    parts: Annotated[
        Mapping[str, PartTable], Meta(title="part", min_length=1, description="at least one table [parts.NAME]")
    ]
    occluders: Annotated[Mapping[str, BoxTable], Meta(title="occluder")] = _NONE
    hand: HandTable
    workspace: SpaceTable | None = None
    forbidden: Annotated[Mapping[str, BoxTable], Meta(title="forbidden box")] = _NONE
    sense: SenseTable | None = None
    prior: PriorTable | None = None
    camera: CameraTable | None = None
    arm: ArmTable | None = None
    wrist_camera: WristTable | None = None
