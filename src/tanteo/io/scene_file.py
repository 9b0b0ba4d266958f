"""Scene files: parts, table, occluders, the hand and what it shall sense (TOML, ``docs/formats.md``)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tanteo.acquisition import EdgeGuess, FaceGuess, VertexGuess
from tanteo.errors import PartError
from tanteo.frames import UncertainFrame
from tanteo.hand import ForbiddenBox, Hand, Workspace, gripper_body
from tanteo.io.document import load_toml, made
from tanteo.io.prior_file import AngleSds, LengthSds
from tanteo.io.prior_text import spread_pose
from tanteo.io.rig_file import read_rig
from tanteo.io.schema import Direction, Length, Numbers, Point, Posed, Table
from tanteo.lie import SE3
from tanteo.sensors import robot_preset
from tanteo.simulator import Cell, Scene, Solid, box
from tanteo.typing import FloatArray, IntArray, Transforms

MeshReader = Callable[[Path, str | None], tuple[FloatArray, IntArray]]
"""From a CAD file and the unit of files that carry none to vertices [m] and triangles."""

AHEAD = 0.06
"""Without an idea of a face, it is looked for so far ahead of the hand [m]."""

CLEARANCE = 0.6
"""Without one of its own, the clearance is this share of the stand-off."""


@dataclass(frozen=True, slots=True)
class CameraPaths:
    """Files of a camera that looks at the scene.

    Attributes:
        file: Calibration.
        marks: Known points of the table, to place the camera; None where the calibration says where it stands.
    """

    file: str
    marks: str | None


@dataclass(frozen=True, slots=True, eq=False)
class SceneFile:
    """What a scene file says.

    Attributes:
        scene: The solids in the world.
        hand: The hand.
        T_world_hand: Where it starts ``(4, 4)``.
        cell: How the robot behaves.
        workspace: Where the hand may be.
        seed: Of all errors.
        standoff: [m].
        clearance: [m].
        guesses: Rough ideas of what to sense: ``plane``, ``edge``, ``vertex``.
        prior: Where the middle of a part roughly is, and how it is turned; None if it is not said.
        camera: The camera that looks at it; None if there is none.
        furniture: The solids that are no parts: what is known to stand there.
        occluders: The same without the table, as boxes to stay out of.
        source: The file.
    """

    scene: Scene
    hand: Hand
    T_world_hand: Transforms
    cell: Cell
    workspace: Workspace
    seed: int
    standoff: float
    clearance: float
    guesses: Mapping[str, FaceGuess | EdgeGuess | VertexGuess]
    prior: UncertainFrame | None
    camera: CameraPaths | None
    furniture: tuple[Solid, ...]
    occluders: tuple[ForbiddenBox, ...]
    source: str


_NONE: Mapping[str, Any] = MappingProxyType({})


class TopTable(Table, frozen=True, kw_only=True, eq=False):
    """The table that parts stand on."""

    top: Length = 0.0
    size: (
        Annotated[
            FloatArray, Numbers("length", ((2,),), lambda s: s if (s > 0).all() else None, "two positive lengths")
        ]
        | None
    ) = None

    def solid(self) -> Solid:
        """A plate below its top."""
        x, y = (1.0, 1.0) if self.size is None else self.size
        return box("table", [-x / 2, -y / 2, self.top - 0.05], [x / 2, y / 2, self.top])


class PartTable(Posed, frozen=True, kw_only=True, eq=False):
    """A part by its CAD file."""

    file: str
    units: str | None = None


class BoxTable(Posed, frozen=True, kw_only=True, eq=False):
    """A box."""

    low: Point
    high: Point


class HandTable(Table, frozen=True, kw_only=True, eq=False):
    """The hand's rig, where it starts and which way it looks, how the robot moves it."""

    rig: str = "paper-gripper"
    robot: str | None = None
    front: Point
    looks: Direction | None = None
    pair: Direction | None = None
    rate: Annotated[float, Numbers("rate"), Meta(ge=1.0)] = 100.0
    latency: Annotated[float, Numbers("time"), Meta(ge=0.0)] = 0.03
    speed: Annotated[float, Numbers("speed"), Meta(ge=1e-3)] = 0.25
    turn: Annotated[float, Numbers("turn"), Meta(ge=1e-2)] = 1.5
    cone_rays: Annotated[int, Meta(ge=0)] = 0

    def hand(self, folder: Path) -> tuple[Hand, Transforms]:
        """The hand, and where it starts ``(4, 4)``."""
        rig = read_rig(folder / self.rig if (folder / self.rig).exists() else self.rig)
        hand = Hand(rig, gripper_body(rig))
        z = np.array([0.0, 0.0, -1.0]) if self.looks is None else self.looks
        helper = np.eye(3)[int(np.argmin(np.abs(z)))]
        across = np.cross(z, helper - (helper @ z) * z if self.pair is None else self.pair)
        if self.pair is not None and np.linalg.norm(across) < 0.1:
            raise self.at.refused("pair", "a direction across looks", "Turn it.", "one along it")
        y = across / np.linalg.norm(across)
        own = np.stack([hand.pair, np.cross([0.0, 0.0, 1.0], hand.pair), [0.0, 0.0, 1.0]], axis=1)
        R = np.stack([np.cross(y, z), y, z], axis=1) @ own.T
        return hand, SE3.from_parts(R, self.front - R @ hand.front)

    def cell(self) -> Cell:
        """How the robot behaves."""
        robot = None if self.robot is None else robot_preset(self.robot)
        return Cell(1 / self.rate, self.latency, self.speed, self.turn, robot=robot, cone=self.cone_rays)


class SpaceTable(Table, frozen=True, kw_only=True, eq=False):
    """Where the hand may be."""

    low: Point | None = None
    high: Point | None = None


class FaceTable(Table, frozen=True, kw_only=True, eq=False):
    """A rough idea of a face."""

    point: Point
    normal: Direction


class EdgeTable(FaceTable, frozen=True, kw_only=True, eq=False):
    """A rough idea of an edge."""

    direction: Direction


class VertexTable(FaceTable, frozen=True, kw_only=True, eq=False):
    """A rough idea of a vertex."""

    arriving: Direction
    leaving: Direction


class SenseTable(Table, frozen=True, kw_only=True, eq=False):
    """How and what to sense."""

    standoff: Annotated[Length, Meta(ge=1e-3)] = 0.02
    clearance: Annotated[Length, Meta(ge=1e-4)] | None = None
    plane: FaceTable | None = None
    edge: EdgeTable | None = None
    vertex: VertexTable | None = None

    def guesses(self, T: Transforms, hand: Hand) -> dict[str, FaceGuess | EdgeGuess | VertexGuess]:
        """The rough ideas; without one, a face is looked for ahead of the hand."""
        out: dict[str, FaceGuess | EdgeGuess | VertexGuess] = {
            "plane": FaceGuess(SE3.apply(T, hand.front + np.array([0.0, 0.0, AHEAD])), -T[:3, 2])
        }
        kinds: dict[str, Any] = {"plane": FaceGuess, "edge": EdgeGuess, "vertex": VertexGuess}
        for name, kind in kinds.items():
            given: FaceTable | None = getattr(self, name)
            if given is not None:
                out[name] = made(kind, given.values(), str(given.at))
        return out


class PriorTable(Posed, frozen=True, kw_only=True, eq=False):
    """Where the middle of a part roughly is."""

    sd: LengthSds
    turn_sd: AngleSds


class CameraTable(Table, frozen=True, kw_only=True, eq=False):
    """Files of a camera."""

    file: str
    marks: str | None = None

    def paths(self, folder: Path) -> CameraPaths:
        """The files, which are named relative to the scene."""
        return CameraPaths(str(folder / self.file), None if self.marks is None else str(folder / self.marks))


class Document(Table, frozen=True, kw_only=True, eq=False):
    """A scene file."""

    seed: Annotated[int, Meta(ge=0)] = 0
    table: TopTable | None = None
    parts: Annotated[Mapping[str, PartTable], Meta(title="part", description="at least one table [parts.NAME]")]
    occluders: Annotated[Mapping[str, BoxTable], Meta(title="occluder")] = _NONE
    hand: HandTable
    workspace: SpaceTable | None = None
    forbidden: Annotated[Mapping[str, BoxTable], Meta(title="forbidden box")] = _NONE
    sense: SenseTable | None = None
    prior: PriorTable | None = None
    camera: CameraTable | None = None


def read_scene(path: str | Path, read_mesh: MeshReader | None = None) -> SceneFile:
    """Read a scene file.

    Args:
        path: The file; the CAD files that it names are beside it.
        read_mesh: How a CAD file is read; :func:`tanteo.parts.read_part` if not given.

    Raises:
        InputError: The file cannot be read, is not TOML, or says something that a scene cannot say; the message names
            file, table, key and value.
        UnitError: A unit in a key is missing or unknown.
        PartError: A part cannot be read.
    """
    path = Path(path)
    file, folder = load_toml(path, "scene file", Document), path.parent
    read_mesh = read_mesh or _mesh
    parts = [
        Solid.at(name, *read_mesh(folder / part.file, part.units), part.pose()) for name, part in file.parts.items()
    ]
    tops = [] if file.table is None else [file.table.solid()]
    clamps = [box(name, one.low, one.high, one.pose()) for name, one in file.occluders.items()]
    hand, T_world_hand = file.hand.hand(folder)
    sense = file.sense or SenseTable(at=file.at.inside("sense"))
    camera, prior = file.camera, file.prior
    return SceneFile(
        scene=Scene.of([*tops, *parts, *clamps]),
        hand=hand,
        T_world_hand=T_world_hand,
        cell=file.hand.cell(),
        workspace=_workspace(file),
        seed=file.seed,
        standoff=sense.standoff,
        clearance=CLEARANCE * sense.standoff if sense.clearance is None else sense.clearance,
        guesses=sense.guesses(T_world_hand, hand),
        prior=None if prior is None else spread_pose(prior.pose(), prior.sd, prior.turn_sd, str(prior.at)),
        camera=None if camera is None else camera.paths(folder),
        furniture=(*tops, *clamps),
        occluders=_boxes(file.occluders),
        source=str(path),
    )


def _workspace(file: Document) -> Workspace:
    """Bounds, and boxes that the hand stays out of; everything happens above the table."""
    bounds = file.workspace or SpaceTable(at=file.at)
    top = -math.inf if file.table is None else file.table.top
    low = np.array([-math.inf, -math.inf, top]) if bounds.low is None else bounds.low
    high = np.full(3, math.inf) if bounds.high is None else bounds.high
    return Workspace(low, high, _boxes(file.forbidden))


def _boxes(tables: Mapping[str, BoxTable]) -> tuple[ForbiddenBox, ...]:
    return tuple(ForbiddenBox(name, one.low, one.high, one.pose()) for name, one in tables.items())


def _mesh(file: Path, unit: str | None) -> tuple[FloatArray, IntArray]:
    from tanteo.parts import read_part

    if not file.exists():
        raise PartError(f"{file}: expected a CAD file, got nothing there. Name it relative to the scene file.")
    part = read_part(file, unit=unit) if unit else read_part(file)
    return part.vertices, part.triangles
