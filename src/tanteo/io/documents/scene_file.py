"""Read scene files: parts, table, obstacles, hand, and the features to sense (TOML, ``docs/formats_scenes.md``)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tanteo.errors import PartError
from tanteo.geometry import UncertainFrame
from tanteo.geometry.typing import FloatArray, IntArray, Transforms
from tanteo.hand import ForbiddenBox, Hand, Workspace
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, RoundGuess, VertexGuess
from tanteo.hand.simulator import Cell, Scene, Solid, box
from tanteo.io.documents.document import load_toml
from tanteo.io.documents.part_files import read_one
from tanteo.io.documents.scene_tables import (
    ArmPlace,
    BoxTable,
    CameraPaths,
    Document,
    SenseTable,
    SpaceTable,
    WristCamera,
)
from tanteo.io.poses.prior_text import spread_pose

MeshReader = Callable[[Path, str | None], tuple[FloatArray, IntArray]]
"""Function that reads a CAD file, given the unit of formats that carry none, as vertices [m] and triangles."""

CLEARANCE = 0.6
"""Default clearance as a fraction of the stand-off."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneFile:
    """Content of a scene file.

    Attributes:
        scene: solids in the world.
        hand: hand that carries the sensors.
        T_world_hand: start pose of the hand ``(4, 4)`` [m].
        cell: timing and motion limits of the robot.
        workspace: region that the hand may use.
        seed: seed of all simulated errors.
        standoff: distance of the sensor from a surface while sensing [m].
        clearance: smallest allowed distance of the hand from obstacles [m].
        guesses: rough positions of features to sense, by kind: ``plane``, ``edge``, ``vertex``, ``circle``,
            ``cylinder``.
        prior: prior pose of a part's centre; None if not given.
        camera: files of the camera that observes the scene; None if there is none.
        furniture: solids that are not parts.
        occluders: known solids other than parts and table, as boxes that the hand avoids.
        source: path of the file.
        arm: arm that carries the hand; None for a hand that moves as commanded.
        wrist: camera on the hand; None if there is none.
    """

    scene: Scene
    hand: Hand
    T_world_hand: Transforms
    cell: Cell
    workspace: Workspace
    seed: int
    standoff: float
    clearance: float
    guesses: Mapping[str, FaceGuess | EdgeGuess | VertexGuess | RoundGuess]
    prior: UncertainFrame | None
    camera: CameraPaths | None
    furniture: tuple[Solid, ...]
    occluders: tuple[ForbiddenBox, ...]
    source: str
    arm: ArmPlace | None = None
    wrist: WristCamera | None = None


def read_scene(path: str | Path, read_mesh: MeshReader | None = None) -> SceneFile:
    """Read a scene file.

    Args:
        path: scene file; CAD files are named relative to it.
        read_mesh: function that reads a CAD file; None for :func:`tanteo.parts.read_part`.

    Raises:
        InputError: the file cannot be read, is not TOML, or has an invalid entry; the message names file, table, key
            and value.
        UnitError: a unit in a key is missing or unknown.
        PartError: a part cannot be read.
    """
    path = Path(path)
    file = load_toml(path, "scene file", Document)
    folder = path.parent
    read_mesh = read_mesh or _mesh
    parts = [
        Solid.at(name, *read_mesh(folder / part.file, part.units), part.pose()) for name, part in file.parts.items()
    ]
    tops = [] if file.table is None else [file.table.solid()]
    clamps = [box(name, one.low, one.high, one.pose()) for name, one in file.occluders.items()]
    hand, T_world_hand = file.hand.hand(folder)
    sense = file.sense or SenseTable(at=file.at.inside("sense"))
    camera = file.camera
    prior = file.prior
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
        arm=None if file.arm is None else file.arm.place(folder),
        wrist=None if file.wrist_camera is None else file.wrist_camera.camera(folder),
    )


def _workspace(file: Document) -> Workspace:
    """Return the bounds of the hand above the table, with its forbidden boxes."""
    bounds = file.workspace or SpaceTable(at=file.at)
    top = -math.inf if file.table is None else file.table.top
    low = np.array([-math.inf, -math.inf, top]) if bounds.low is None else bounds.low
    high = np.full(3, math.inf) if bounds.high is None else bounds.high
    return Workspace(low, high, _boxes(file.forbidden))


def _boxes(tables: Mapping[str, BoxTable]) -> tuple[ForbiddenBox, ...]:
    return tuple(ForbiddenBox(name, one.low, one.high, one.pose()) for name, one in tables.items())


def _mesh(file: Path, unit: str | None) -> tuple[FloatArray, IntArray]:
    if not file.exists():
        raise PartError(f"{file}: expected a CAD file, got nothing there. Name it relative to the scene file.")
    part = read_one(file, unit)
    return part.vertices, part.triangles
