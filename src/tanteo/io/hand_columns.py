"""The columns of the hand's pose: place, and rotation in the way of quaternions, vectors, brands or matrices."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.io.brands import BRANDS
from tanteo.io.poses import pose_of
from tanteo.lie import SE3, SO3
from tanteo.typing import FloatArray, Transforms

PLACE = ("hand_x", "hand_y", "hand_z")
MATRIX = tuple(f"hand_r{i}{j}" for i in "123" for j in "123")
QUATERNION = ("hand_qw", "hand_qx", "hand_qy", "hand_qz")
_SLACK = 1e-2
"""How far a matrix may be from a rotation, by rounding."""

ABB = ("hand_q1", "hand_q2", "hand_q3", "hand_q4")


@dataclass(frozen=True, slots=True)
class Way:
    """A way to write a rotation.

    Attributes:
        names: The columns.
        brands: Who writes it so, the one that is meant unless another is named first; ``""`` if nobody is meant.
        words: For messages.
    """

    names: tuple[str, ...]
    brands: tuple[str, ...]
    words: str


WAYS = (
    Way(QUATERNION, (), "hand_qw .. hand_qz (a unit quaternion)"),
    Way(("hand_rx", "hand_ry", "hand_rz"), ("ur", "yaskawa", "staubli", "denso"),
        "hand_rx_rad .. hand_rz_rad (a rotation vector)"),
    Way(("hand_roll", "hand_pitch", "hand_yaw"), ("paper",), "hand_roll_deg, hand_pitch_deg, hand_yaw_deg"),
    Way(("hand_w", "hand_p", "hand_r"), ("fanuc",), "hand_w_deg, hand_p_deg, hand_r_deg (FANUC)"),
    Way(("hand_a", "hand_b", "hand_c"), ("", "kuka", "mitsubishi", "doosan"),
        "hand_a_deg, hand_b_deg, hand_c_deg (KUKA ..)"),
    Way(("hand_o", "hand_a", "hand_t"), ("kawasaki",), "hand_o_deg, hand_a_deg, hand_t_deg (Kawasaki)"),
    Way(("hand_a", "hand_e", "hand_r"), ("comau",), "hand_a_deg, hand_e_deg, hand_r_deg (Comau)"),
    Way(ABB, ("abb",), "hand_q1 .. hand_q4 (ABB)"),
    Way(MATRIX, (), "hand_r11 .. hand_r33 (a matrix)"),
)  # fmt: skip
"""In the order in which they are preferred where two have as many of their columns."""

ANGLES = tuple(
    dict.fromkeys(n for way in WAYS for n in way.names if way.names not in (QUATERNION, MATRIX) and "q" not in n)
)
PLAIN = tuple(n for way in WAYS for n in way.names if n not in ANGLES)
_ELEMENTS = {f"m{i}{j}": f"hand_r{i}{j}" for i in "123" for j in "123"} | {
    f"m{i}4": place for i, place in zip("123", PLACE, strict=True)
}


def way_of(names: Iterable[str]) -> Way:
    """The way that most of the names are of; the first if none is."""
    given = set(names)
    return max(WAYS, key=lambda way: (len(given.intersection(way.names)), given >= set(way.names)))


def as_hand(names: list[str]) -> list[str]:
    """Names with ``hand_`` before a pose that is written without it: X, Y, Z, W, P, R or the elements of a matrix."""
    names = [f"hand_{n}" if n in ("qw", "qx", "qy", "qz") else n for n in names]
    bases = [_base(n) for n in names]
    if not set(PLACE).isdisjoint(bases):
        return names
    if {*_ELEMENTS} <= {b.removeprefix("hand_") for b in bases}:
        return [_renamed(n, b, _ELEMENTS[b.removeprefix("hand_")]) if b.removeprefix("hand_") in _ELEMENTS else n
                for n, b in zip(names, bases, strict=True)]  # fmt: skip
    found = next(
        (w for w in WAYS if {n.removeprefix("hand_") for n in w.names} <= {b.removeprefix("hand_") for b in bases}),
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
    """Who writes the rotation of these columns so: the brand that was stated, else the one that is meant without.

    Raises:
        ReadingsError: It is open whose they are, or another brand was stated.
    """
    given = set(names)
    way = way_of(given)
    if way.names[0] not in given:
        return ""
    if stated in way.brands:
        return str(stated)
    if (stated is None and way.brands and not way.brands[0]) or stated is not None:
        listed = ", ".join(b for b in way.brands if b) or "no brand"
        advice = next((f"Say --brand {b}." for b in way.brands if b), "Drop --brand.")
        raise ReadingsError(
            f"{place}: expected whose pose the columns {', '.join(way.names)} are ({listed}), got {stated or 'none'}. "
            f"{advice}"
        )
    return way.brands[0] if way.brands else ""


def skewed_row(values: Mapping[str, FloatArray]) -> int | None:
    """The first row whose matrix scales, shears or mirrors; None without."""
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
    """Poses ``(n, 4, 4)`` of columns in metres and radians, NaN where a row has none; None without columns."""
    if PLACE[0] not in values:
        return None
    way = way_of(values)
    places = np.stack([values[name] for name in PLACE], axis=-1)
    turns = np.stack([values[name] for name in way.names], axis=-1)
    Ts = np.full((len(places), 4, 4), np.nan)
    given = ~np.isnan(places[:, 0])
    if way.names == QUATERNION:
        Ts[given] = SE3.from_parts(SO3.from_quaternion(turns[given]), places[given])
    elif way.names == MATRIX:
        Ts[given] = SE3.from_parts(nearest_rotation(turns[given].reshape(-1, 3, 3)), places[given])
    else:
        Ts[given] = pose_of(BRANDS[brand], places[given], turns[given])
    return Ts


def nearest_rotation(matrices: FloatArray) -> FloatArray:
    """Rotations nearest to matrices that were rounded when they were written."""
    u, _, v = np.linalg.svd(matrices)
    return np.asarray(u @ v)
