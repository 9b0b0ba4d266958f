"""Scene files: parts, table, occluders, the hand and what it shall sense (TOML, ``docs/formats.md``)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.acquisition import EdgeGuess, FaceGuess, VertexGuess
from tanteo.errors import InputError, PartError
from tanteo.frames import UncertainFrame
from tanteo.hand import ForbiddenBox, Hand, Workspace
from tanteo.io.prior_text import spread_pose
from tanteo.io.scene_hand import hand_of
from tanteo.io.toml_keys import POSE, Keys, load_toml, pose_of
from tanteo.lie import SE3
from tanteo.simulator import Cell, Scene, Solid, box
from tanteo.typing import FloatArray, IntArray, Transforms

MeshReader = Callable[[Path, str | None], tuple[FloatArray, IntArray]]
"""From a CAD file and the unit of files that carry none to vertices [m] and triangles."""

_TABLES = ("seed", "table", "parts", "occluders", "hand", "workspace", "forbidden", "sense", "prior", "camera")
_SENSE = {"standoff": "length", "clearance": "length"}
_BOX = {"low": "length", "high": "length", **POSE}
_PLACE = {"point": "length", "normal": "plain", "direction": "plain", "arriving": "plain", "leaving": "plain"}

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
    document = load_toml(path, "scene file")
    for key in document:
        if key not in _TABLES:
            raise InputError(f"{path}: expected one of {', '.join(_TABLES)}, got '{key}'. Correct the name.")
    seed = document.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"{path}, seed: expected a whole number of zero or more, got {seed!r}. Correct it.")
    table, top = _table(document.get("table"), f"{path}, table")
    parts = [_part(name, entry, path, read_mesh or _mesh) for name, entry in _entries(document, "parts", path)]
    if not parts:
        raise InputError(f"{path}: expected at least one table [parts.NAME], got none. Add one.")
    occluders = [
        _occluder(name, entry, f"{path}, occluder '{name}'") for name, entry in _entries(document, "occluders", path)
    ]
    clamps = [solid for solid, _ in occluders]
    hand, T_world_hand, cell = hand_of(document.get("hand", {}), path)
    return SceneFile(
        scene=Scene.of([*table, *parts, *clamps]),
        hand=hand,
        T_world_hand=T_world_hand,
        cell=cell,
        workspace=_workspace(document, path, top),
        seed=seed,
        prior=_prior(document["prior"], f"{path}, prior") if "prior" in document else None,
        camera=_camera(document["camera"], path) if "camera" in document else None,
        furniture=(*table, *clamps),
        occluders=tuple(forbidden for _, forbidden in occluders),
        source=str(path),
        **_sense(document.get("sense", {}), f"{path}, sense", T_world_hand, hand),
    )


def _entries(document: Mapping[str, Any], name: str, path: Path) -> list[tuple[str, Any]]:
    tables = document.get(name, {})
    if not isinstance(tables, dict):
        raise InputError(f"{path}, {name}: expected tables [{name}.NAME], got {tables!r}. Write one for each.")
    return list(tables.items())


def _table(entry: Any, place: str) -> tuple[list[Solid], float]:
    """The table, if there is one, and the height above which everything happens."""
    if entry is None:
        return [], -math.inf
    keys = Keys(entry, place, {"top": "length", "size": "length"})
    top, (x, y) = keys.number("top", 0.0), keys.vector("size", (1.0, 1.0), n=2)
    if not (x > 0 and y > 0):
        raise InputError(f"{place}, size: expected two positive lengths, got {[x, y]}. Correct it.")
    return [box("table", [-x / 2, -y / 2, top - 0.05], [x / 2, y / 2, top])], top


def _part(name: str, entry: Any, path: Path, read_mesh: MeshReader) -> Solid:
    place = f"{path}, part '{name}'"
    keys = Keys(entry, place, POSE, ("file", "units"))
    vertices, triangles = read_mesh(path.parent / keys.word("file"), keys.word("units") if "units" in keys else None)
    return Solid.at(name, vertices, triangles, pose_of(keys))


def _mesh(file: Path, unit: str | None) -> tuple[FloatArray, IntArray]:
    from tanteo.parts import read_part

    if not file.exists():
        raise PartError(f"{file}: expected a CAD file, got nothing there. Name it relative to the scene file.")
    part = read_part(file, unit=unit) if unit else read_part(file)
    return part.vertices, part.triangles


def _occluder(name: str, entry: Any, place: str) -> tuple[Solid, ForbiddenBox]:
    """A box that stands there, and the same for the hand to stay out of."""
    keys = Keys(entry, place, _BOX)
    corners, T = (keys.vector("low"), keys.vector("high")), pose_of(keys)
    return box(name, *corners, T), ForbiddenBox(name, *corners, T)


def _prior(entry: Any, place: str) -> UncertainFrame:
    keys = Keys(entry, place, {"sd": "length", "turn_sd": "angle", **POSE})
    sds, turns = (keys.vector(name) if keys.size(name) == 3 else [keys.number(name)] for name in ("sd", "turn_sd"))
    return spread_pose(pose_of(keys), sds, turns, place)


def _camera(entry: Any, path: Path) -> CameraPaths:
    keys = Keys(entry, f"{path}, camera", {}, ("file", "marks"))
    marks = str(path.parent / keys.word("marks")) if "marks" in keys else None
    return CameraPaths(str(path.parent / keys.word("file")), marks)


def _workspace(document: Mapping[str, Any], path: Path, top: float) -> Workspace:
    """Bounds, and boxes that the hand stays out of."""
    keys = Keys(document.get("workspace", {}), f"{path}, workspace", {"low": "length", "high": "length"})
    forbidden = [
        _forbidden(name, entry, f"{path}, forbidden box '{name}'")
        for name, entry in _entries(document, "forbidden", path)
    ]
    low = keys.vector("low", (-math.inf, -math.inf, top))
    return Workspace(low, keys.vector("high", (math.inf,) * 3), forbidden)


def _forbidden(name: str, entry: Any, place: str) -> ForbiddenBox:
    keys = Keys(entry, place, _BOX)
    return ForbiddenBox(name, keys.vector("low"), keys.vector("high"), pose_of(keys))


def _sense(entry: Any, place: str, T: Transforms, hand: Hand) -> dict[str, Any]:
    """Stand-off, clearance and ideas; without one, a face is looked for ahead of the hand."""
    if not isinstance(entry, dict):
        raise InputError(f"{place}: expected a table [sense], got {entry!r}. Write it so.")
    kinds = {k: entry[k] for k in ("plane", "edge", "vertex") if k in entry}
    keys = Keys({k: v for k, v in entry.items() if k not in kinds}, place, _SENSE)
    standoff = keys.number("standoff", 0.02, least=1e-3)
    guesses: dict[str, FaceGuess | EdgeGuess | VertexGuess] = {
        "plane": FaceGuess(SE3.apply(T, hand.front + np.array([0.0, 0.0, AHEAD])), -T[:3, 2])
    }
    for kind, table in kinds.items():
        guess = Keys(table, f"{place}.{kind}", _PLACE)
        point, normal = guess.vector("point"), guess.vector("normal")
        if kind == "plane":
            guesses[kind] = FaceGuess(point, normal)
        elif kind == "edge":
            guesses[kind] = EdgeGuess(point, guess.vector("direction"), normal)
        else:
            guesses[kind] = VertexGuess(point, guess.vector("arriving"), guess.vector("leaving"), normal)
    clearance = keys.number("clearance", CLEARANCE * standoff, least=1e-4)
    return {"standoff": standoff, "clearance": clearance, "guesses": guesses}
