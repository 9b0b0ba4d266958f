"""The table ``[hand]`` of a scene file: its rig, where it starts and which way it looks, how the robot moves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.hand import Hand, gripper_body
from tanteo.io.rig_file import read_rig
from tanteo.io.toml_keys import Keys
from tanteo.lie import SE3
from tanteo.sensors import robot_preset
from tanteo.simulator import Cell
from tanteo.typing import FloatArray, Transforms

_HAND = {
    "front": "length", "looks": "plain", "pair": "plain", "rate": "rate", "latency": "time", "speed": "speed",
    "turn": "turn", "cone_rays": "plain",
}  # fmt: skip


def hand_of(entry: Any, path: Path) -> tuple[Hand, Transforms, Cell]:
    """The hand, where it starts ``(4, 4)``, and the robot that moves it; ``entry`` may be empty."""
    keys = Keys(entry, f"{path}, hand", _HAND, ("rig", "robot"))
    name = keys.word("rig", "paper-gripper")
    rig = read_rig(path.parent / name if (path.parent / name).exists() else name)
    hand = Hand(rig, gripper_body(rig))
    z = _direction(keys, "looks", (0.0, 0.0, -1.0))
    helper = np.eye(3)[int(np.argmin(np.abs(z)))]
    pair = _direction(keys, "pair", tuple(helper - (helper @ z) * z))
    across = np.cross(z, pair)
    if np.linalg.norm(across) < 0.1:
        raise InputError(f"{keys.place}, pair: expected a direction across looks, got one along it. Turn it.")
    y = across / np.linalg.norm(across)
    own = np.stack([hand.pair, np.cross([0.0, 0.0, 1.0], hand.pair), [0.0, 0.0, 1.0]], axis=1)
    R = np.stack([np.cross(y, z), y, z], axis=1) @ own.T
    cell = Cell(
        period=1 / keys.number("rate", 100.0, least=1.0),
        latency=keys.number("latency", 0.03, least=0.0),
        max_speed=keys.number("speed", 0.25, least=1e-3),
        max_turn=keys.number("turn", 1.5, least=1e-2),
        robot=robot_preset(keys.word("robot")) if "robot" in keys else None,
        cone=int(keys.number("cone_rays", 0.0, least=0.0)),
    )
    return hand, SE3.from_parts(R, keys.vector("front") - R @ hand.front), cell


def _direction(keys: Keys, name: str, default: tuple[float, ...]) -> FloatArray:
    d = keys.vector(name, default)
    if np.linalg.norm(d) < 1e-9:
        raise InputError(f"{keys.place}, {name}: expected a direction that is not zero, got {d.tolist()}. Correct it.")
    return np.asarray(d / np.linalg.norm(d))
