"""Read the hand's pose from table columns: position, and rotation as quaternion, vector, brand angles or matrix."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.poses.poses import pose_of
from tanteo.io.readings.brands import BRANDS

PLACE = ("hand_x", "hand_y", "hand_z")
MATRIX = tuple(f"hand_r{i}{j}" for i in "123" for j in "123")
QUATERNION = ("hand_qw", "hand_qx", "hand_qy", "hand_qz")
_SLACK = 1e-2
"""Largest deviation of ``R' R`` from the identity that rounding explains."""

ABB = ("hand_q1", "hand_q2", "hand_q3", "hand_q4")


@dataclass(frozen=True, slots=True)
class Notation:
    """Notation of a rotation in table columns.

    Attributes:
        names: column names without units.
        brands: robot brands that use this notation, the default first; an empty first entry means that the brand must
            be stated. Empty for notations without a brand.
        words: description for messages.
    """

    names: tuple[str, ...]
    brands: tuple[str, ...]
    words: str


NOTATIONS = (
    Notation(QUATERNION, (), "hand_qw .. hand_qz (a unit quaternion)"),
    Notation(("hand_rx", "hand_ry", "hand_rz"), ("ur", "yaskawa", "staubli", "denso"),
        "hand_rx_rad .. hand_rz_rad (a rotation vector)"),
    Notation(("hand_roll", "hand_pitch", "hand_yaw"), ("paper",), "hand_roll_deg, hand_pitch_deg, hand_yaw_deg"),
    Notation(("hand_w", "hand_p", "hand_r"), ("fanuc",), "hand_w_deg, hand_p_deg, hand_r_deg (FANUC)"),
    Notation(("hand_a", "hand_b", "hand_c"), ("", "kuka", "mitsubishi", "doosan"),
        "hand_a_deg, hand_b_deg, hand_c_deg (KUKA ..)"),
    Notation(("hand_o", "hand_a", "hand_t"), ("kawasaki",), "hand_o_deg, hand_a_deg, hand_t_deg (Kawasaki)"),
    Notation(("hand_a", "hand_e", "hand_r"), ("comau",), "hand_a_deg, hand_e_deg, hand_r_deg (Comau)"),
    Notation(ABB, ("abb",), "hand_q1 .. hand_q4 (ABB)"),
    Notation(MATRIX, (), "hand_r11 .. hand_r33 (a matrix)"),
)  # fmt: skip
"""Rotation notations, in the order of preference where a table matches two equally well."""

ANGLES = tuple(
    dict.fromkeys(
        n
        for notation in NOTATIONS
        for n in notation.names
        if notation.names not in (QUATERNION, MATRIX) and "q" not in n
    )
)
PLAIN = tuple(n for notation in NOTATIONS for n in notation.names if n not in ANGLES)
_ELEMENTS = {f"m{i}{j}": f"hand_r{i}{j}" for i in "123" for j in "123"} | {
    f"m{i}4": place for i, place in zip("123", PLACE, strict=True)
}


def notation_of(names: Iterable[str]) -> Notation:
    """Return the rotation notation that most of the names are part of; the first notation if none does.

    Args:
        names: column names without units.
    """
    given = set(names)
    return max(NOTATIONS, key=lambda notation: (len(given.intersection(notation.names)), given >= set(notation.names)))


def as_hand(names: list[str]) -> list[str]:
    """Return column names with ``hand_`` added to a pose written without it: X, Y, Z, W, P, R or matrix elements.

    Args:
        names: canonical column names, with units.
    """
    names = [f"hand_{n}" if n in ("qw", "qx", "qy", "qz") else n for n in names]
    bases = [_base(n) for n in names]
    if not set(PLACE).isdisjoint(bases):
        return names
    if {*_ELEMENTS} <= {b.removeprefix("hand_") for b in bases}:
        return [_renamed(n, b, _ELEMENTS[b.removeprefix("hand_")]) if b.removeprefix("hand_") in _ELEMENTS else n
                for n, b in zip(names, bases, strict=True)]  # fmt: skip
    found = next(
        (
            w
            for w in NOTATIONS
            if {n.removeprefix("hand_") for n in w.names} <= {b.removeprefix("hand_") for b in bases}
        ),
        None,
    )
    if found is None or not {"x", "y", "z"} <= set(bases):
        return names
    wanted = {"x": PLACE[0], "y": PLACE[1], "z": PLACE[2], **{n.removeprefix("hand_"): n for n in found.names}}
    return [_renamed(n, b, wanted[b]) if b in wanted else n for n, b in zip(names, bases, strict=True)]


def _base(name: str) -> str:
    head, _, unit = name.rpartition("_")
    return head if head and unit in ("mm", "m", "um", "in", "deg", "rad") else name


def _renamed(name: str, base: str, new: str) -> str:
    return new + name[len(base) :]


def stated_brand(names: Iterable[str], stated: str | None, place: str) -> str:
    """Return the brand whose notation the rotation columns follow: the stated one, or the default of the notation.

    Args:
        names: column names without units.
        stated: brand that the user states; None if not stated.
        place: file name and line for messages.

    Returns:
        Name of the brand; empty where the notation has none.

    Raises:
        ReadingsError: the notation needs a brand and none is stated, or the stated brand does not use it.
    """
    given = set(names)
    notation = notation_of(given)
    if notation.names[0] not in given:
        return ""
    if stated in notation.brands:
        return str(stated)
    if (stated is None and notation.brands and not notation.brands[0]) or stated is not None:
        listed = ", ".join(b for b in notation.brands if b) or "no brand"
        advice = next((f"Use --brand {b}." for b in notation.brands if b), "Drop --brand.")
        raise ReadingsError(
            f"{place}: expected the brand of the columns {', '.join(notation.names)} ({listed}), "
            f"got {stated or 'none'}. {advice}"
        )
    return notation.brands[0] if notation.brands else ""


def skewed_row(values: Mapping[str, FloatArray]) -> int | None:
    """Return the index of the first row whose rotation matrix scales, shears or mirrors; None if all are rotations.

    Args:
        values: numbers by column name without unit.
    """
    if MATRIX[0] not in values:
        return None
    R = np.stack([values[name] for name in MATRIX], axis=-1).reshape(-1, 3, 3)
    given = ~np.isnan(R[:, 0, 0])
    R = np.where(given[:, None, None], R, np.eye(3))
    off = np.asarray(~(np.abs(R) < 2).all(axis=(1, 2)))
    R = np.where(off[:, None, None], 2 * np.eye(3), R)
    off |= np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2)) > _SLACK
    off |= np.linalg.det(R) < 0
    return int(np.argmax(off)) if off.any() else None


def hand_poses(values: Mapping[str, FloatArray], brand: str) -> Transforms | None:
    """Return the hand's poses in the world ``(n, 4, 4)``, NaN where a row has none; None if the columns are missing.

    Args:
        values: numbers by column name without unit [m, rad].
        brand: name of the brand whose notation the rotation follows; empty for quaternions and matrices.
    """
    if PLACE[0] not in values:
        return None
    notation = notation_of(values)
    places = np.stack([values[name] for name in PLACE], axis=-1)
    turns = np.stack([values[name] for name in notation.names], axis=-1)
    Ts = np.full((len(places), 4, 4), np.nan)
    given = ~np.isnan(places[:, 0])
    if notation.names == QUATERNION:
        Ts[given] = SE3.from_parts(SO3.from_quaternion(turns[given]), places[given])
    elif notation.names == MATRIX:
        Ts[given] = SE3.from_parts(nearest_rotation(turns[given].reshape(-1, 3, 3)), places[given])
    else:
        Ts[given] = pose_of(BRANDS[brand], places[given], turns[given])
    return Ts


def nearest_rotation(matrices: FloatArray) -> FloatArray:
    """Return the rotations nearest to rounded rotation matrices ``(*batch, 3, 3)`` in the Frobenius norm.

    Source: orthogonal Procrustes problem by SVD (Schönemann 1966).

    Args:
        matrices: matrices close to rotations ``(*batch, 3, 3)``.
    """
    u, _, v = np.linalg.svd(matrices)
    return np.asarray(u @ v)
