"""Scene files: parts, table, occluders, the hand and what it shall sense (TOML, ``docs/formats.md``)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tanteo.acquisition import EdgeGuess, FaceGuess, RoundGuess, VertexGuess
from tanteo.errors import PartError
from tanteo.frames import UncertainFrame
from tanteo.hand import ForbiddenBox, Hand, Workspace
from tanteo.io.document import load_toml
from tanteo.io.part_files import read_one
from tanteo.io.prior_text import spread_pose
from tanteo.io.scene_tables import BoxTable, CameraPaths, Document, SenseTable, SpaceTable
from tanteo.simulator import Cell, Scene, Solid, box
from tanteo.typing import FloatArray, IntArray, Transforms

MeshReader = Callable[[Path, str | None], tuple[FloatArray, IntArray]]
"""From a CAD file and the unit of files that carry none to vertices [m] and triangles."""

CLEARANCE = 0.6
"""Without one of its own, the clearance is this share of the stand-off."""


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
        guesses: Rough ideas of what to sense: ``plane``, ``edge``, ``vertex``, ``circle``, ``cylinder``.
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
    guesses: Mapping[str, FaceGuess | EdgeGuess | VertexGuess | RoundGuess]
    prior: UncertainFrame | None
    camera: CameraPaths | None
    furniture: tuple[Solid, ...]
    occluders: tuple[ForbiddenBox, ...]
    source: str


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
    if not file.exists():
        raise PartError(f"{file}: expected a CAD file, got nothing there. Name it relative to the scene file.")
    part = read_one(file, unit)
    return part.vertices, part.triangles
