"""What is known of a part's pose, as a file (TOML, ``docs/formats.md``): a table, a box, a prior pose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tanteo.answers import PosePrior, Table
from tanteo.errors import CovarianceError, InputError
from tanteo.frames import UncertainFrame, from_ros_covariance
from tanteo.io.poses import BRANDS, Brand, brand, pose_from_brand
from tanteo.io.prior_text import check_pose_prior, spread_pose
from tanteo.io.toml_keys import POSE, Keys, load_toml, pose_of
from tanteo.typing import FloatArray, Transforms

_TABLES = ("table", "box", "pose_prior")
_TABLE = {"top": "length", "point": "length", "normal": "plain", "sd": "length"}
_COVARIANCES = ("covariance_m_rad", "ros_covariance_m_rad")
_PRIOR = {
    "sd": "length", "turn_sd": "angle", **POSE,
    **dict.fromkeys((*BRANDS, *_COVARIANCES), "plain"),
}  # fmt: skip


def read_prior(path: str | Path) -> PosePrior:
    """Read a file with what is known of the pose.

    Args:
        path: The file, with one or more of the tables ``[table]``, ``[box]`` and ``[pose_prior]``.

    Raises:
        InputError: The file cannot be read, is not TOML, or says something that no prior can say; the message names
            file, table, key and value.
        UnitError: A unit in a key is missing or unknown.

    Example:
        >>> prior = tanteo.read_prior("scenes/feeder.toml")
        >>> prior.T_world_part.shape
        (4, 4)
    """
    path = Path(path)
    document = load_toml(path, "file with the prior pose")
    for key in document:
        if key not in _TABLES:
            raise InputError(f"{path}: expected one of {', '.join(_TABLES)}, got '{key}'. Correct the name.")
    if not document:
        raise InputError(f"{path}: expected a table [table], [box] or [pose_prior], got an empty file. Add one.")
    prior = _prior(document["pose_prior"], f"{path}, pose_prior") if "pose_prior" in document else None
    return PosePrior(
        T_world_part=None if prior is None else prior.T,
        covariance=None if prior is None else prior.C,
        box=_box(document["box"], f"{path}, box") if "box" in document else None,
        table=_table(document["table"], f"{path}, table") if "table" in document else None,
    )


def prior_brand(path: str | Path) -> Brand | None:
    """In whose convention the prior pose of a file is written that :func:`read_prior` can read; None for our own."""
    prior = load_toml(Path(path), "file with the prior pose").get("pose_prior", {})
    return next((BRANDS[name] for name in BRANDS if name in prior), None)


def _table(entry: Any, place: str) -> Table:
    """Level at a height, or any plane."""
    keys = Keys(entry, place, _TABLE)
    if ("top" in keys) == ("point" in keys):
        raise InputError(f"{place}: expected top_mm or point_mm with normal, got both or none. Give one.")
    sd, normal = keys.number("sd"), keys.vector("normal", (0.0, 0.0, 1.0))
    if sd <= 0:
        raise keys.refused("sd", "a positive length", "Say how well the table is known.")
    if not normal.any():
        raise keys.refused("normal", "a direction that is not zero", "Let it point from the table to the part.")
    point = np.array([0.0, 0.0, keys.number("top")]) if "top" in keys else keys.vector("point")
    return Table(point, normal, sd)


def _box(entry: Any, place: str) -> FloatArray:
    keys = Keys(entry, place, {"low": "length", "high": "length"})
    box = np.stack([keys.vector("low"), keys.vector("high")])
    if not np.all(box[1] > box[0]):
        raise keys.refused("high", "low below high in x, y and z")
    return box


def _prior(entry: Any, place: str) -> UncertainFrame:
    keys = Keys(_flat(entry), place, _PRIOR)
    T = _pose(keys)
    sds = "sd" in keys or "turn_sd" in keys
    given = ["sd_mm and turn_sd_deg"] * sds + [name for name in _COVARIANCES if name in keys]
    if len(given) != 1:
        raise InputError(
            f"{place}: expected how well it is known once, as sd_mm and turn_sd_deg or as one of "
            f"{', '.join(_COVARIANCES)}, got {' and '.join(given) or 'nothing'}. Give one of them."
        )
    if sds:
        return spread_pose(T, _positive(keys, "sd"), _positive(keys, "turn_sd"), place)
    try:
        C = keys.vector(given[0], n=36)
        ros = given == ["ros_covariance_m_rad"]
        frame = from_ros_covariance(T, C) if ros else UncertainFrame(T, C.reshape(6, 6))
    except CovarianceError as error:
        raise InputError(f"{place}, {given[0]}: {error} Copy it as it was written.") from None
    return check_pose_prior(frame, f"{place}, {given[0]}")


def _pose(keys: Keys) -> Transforms:
    brands = [name for name in BRANDS if name in keys]
    own = any(name in keys for name in ("position", "turn", "quaternion_wxyz"))
    if len(brands) + own != 1:
        raise InputError(
            f"{keys.place}: expected one pose, as position_mm with turn_deg or quaternion_wxyz, or by the name of a "
            f"brand ({', '.join(BRANDS)}), got {len(brands) + own}. Give one."
        )
    if own:
        if "position" not in keys or not ("turn" in keys or "quaternion_wxyz" in keys):
            raise InputError(f"{keys.place}: expected a position and an attitude, got one of them. Give both.")
        return pose_of(keys)
    fields = keys.vector(brands[0], n=len(brand(brands[0]).fields))
    try:
        return pose_from_brand(brands[0], fields)
    except InputError as error:
        raise InputError(f"{keys.place}, {brands[0]}: {error}") from None


def _positive(keys: Keys, name: str) -> FloatArray:
    """One number, or three, that are standard deviations."""
    values = keys.vector(name, n=keys.size(name)) if keys.size(name) > 1 else np.array([keys.number(name)])
    if len(values) not in (1, 3) or not np.all(values > 0):
        raise keys.refused(name, "one positive number or three", "Say how well it is known along or about each axis.")
    return values


def _flat(entry: Any) -> Any:
    """Covariances row by row, also where they are written as six rows."""
    if not isinstance(entry, dict):
        return entry
    return {k: [v for row in value for v in row] if _rows(k, value) else value for k, value in entry.items()}


def _rows(key: str, value: Any) -> bool:
    return key in _COVARIANCES and isinstance(value, list) and all(isinstance(row, list) for row in value)
