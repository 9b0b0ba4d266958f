"""Values of a session's record that are no plain tables: how it senses and chooses, and readings by their columns."""

from __future__ import annotations

from typing import Any

import numpy as np

from tanteo.active import POLICIES, Policy
from tanteo.errors import InputError
from tanteo.io.plain_values import as_plain, hints, made, refused, table
from tanteo.sensors import Readings, Rig, RobotPreset, SensorPreset, robot_preset, sensor_preset
from tanteo.session import Action, Observation, Sensing
from tanteo.typing import FloatArray

_SENSING: dict[str, Any] = {
    "sensor": SensorPreset | None, "robot": RobotPreset | None, "sd": float | None, "tip_sd": FloatArray | None,
    "rig": Rig | None, "tolerance": float,
}  # fmt: skip

_POLICIES = {type(policy).__name__: type(policy) for policy in POLICIES.values()}


def sensing_document(sensing: Sensing) -> dict[str, Any]:
    """The values of presets stand beside their names: a record outlives a change of them."""
    sensor, robot = sensing.sensor, sensing.robot
    return {name: as_plain(getattr(sensing, name)) for name in _SENSING} | {
        "sensor": as_plain(sensor_preset(sensor) if isinstance(sensor, str) else sensor),
        "robot": as_plain(robot_preset(robot) if isinstance(robot, str) else robot),
        "tip_sd": None if sensing.tip_sd is None else as_plain(np.asarray(sensing.tip_sd, dtype=np.float64)),
    }


def sensing_of(plain: Any, place: str) -> Sensing:
    """How readings are made into measurements, from its document; ``place`` says where that stands, for messages."""
    return Sensing(**table(plain, _SENSING, place))


def policy_document(policy: Policy) -> dict[str, Any]:
    """The kind of a policy, and its options."""
    kind = type(policy).__name__
    if type(policy) is not _POLICIES.get(kind):
        raise InputError(f"policy: expected one of {', '.join(POLICIES)}, got {kind}. A record can hold only these.")
    return {"kind": kind, **as_plain(policy)}


def policy_of(plain: Any, place: str) -> Policy:
    """Which reading is chosen, from its document."""
    kind = _POLICIES.get(str(plain.get("kind"))) if isinstance(plain, dict) else None
    if kind is None:
        raise refused(place, f"'kind' to be one of {', '.join(_POLICIES)}", plain)
    values = table(plain, {"kind": str, **hints(kind)}, place)
    policy: Policy = kind(**{name: values[name] for name in hints(kind)})
    return policy


def readings_document(readings: Readings | None) -> dict[str, Any] | None:
    """The columns that say something."""
    if readings is None:
        return None
    columns = {name: getattr(readings, name) for name in hints(Readings)}
    return {name: as_plain(column) for name, column in columns.items() if name == "ids" or _says(column)}


def _says(column: Any) -> bool:
    if isinstance(column, np.ndarray):
        return not np.isnan(column).all() if column.dtype == np.float64 else bool(column.any())
    return bool(column) if isinstance(column, str) else any(column)


def observation_of(plain: Any, place: str) -> Observation:
    """What was told at once, from its document."""
    values = table(plain, {"asked": Action | None, "readings": object, "note": str}, place)
    readings = None if values["readings"] is None else _readings(values["readings"], f"{place}, readings")
    return Observation(values["asked"], readings, values["note"])


def _readings(plain: Any, place: str) -> Readings:
    if not isinstance(plain, dict):
        raise InputError(f"{place}: expected a table of columns or null, got {plain!r}. Correct it.")
    kinds = hints(Readings)
    given = {name: kind for name, kind in kinds.items() if name == "ids" or name in plain}
    values = table(plain, given if set(plain) <= set(kinds) else kinds, place)
    blank = made(Readings.from_columns, {"points": np.zeros((len(values["ids"]), 3))}, place)
    values = {name: getattr(blank, name) for name in kinds} | {"points": np.full_like(blank.points, np.nan)} | values
    readings: Readings = made(Readings, values, place)
    return readings
