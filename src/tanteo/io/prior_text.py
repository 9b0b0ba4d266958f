"""What is known of a part's pose, as typed: a table, a box, a prior pose, each with its unit and how sure it is."""

from __future__ import annotations

import os
import re

import numpy as np
import numpy.typing as npt

from tanteo.answers import Furniture, Table
from tanteo.errors import InputError
from tanteo.frames import ROS, NamedCovariance, UncertainFrame, uncertain_frame
from tanteo.io.part_files import read_one
from tanteo.io.pose_syntax import parse_pose
from tanteo.io.units import parse_lengths, parse_lengths_angles
from tanteo.parts import is_unitless
from tanteo.typing import FloatArray, Transforms

_NEAR = "400,200,0mm 0,0,90deg +- 5mm 3deg"
_TABLE = "0+-1mm"
_FURNITURE = "vise.stl@400,200,0mm 0,0,90deg +- 0.5mm"
_MOST_TURN = np.pi / 3
"""Largest sd of an attitude [rad]: three of them are half a turn, beyond which a normal density meets itself."""

_GIVE_OR_TAKE = re.compile(r"\+-|\+/-|±")


def parse_table(text: str, name: str = "table") -> Table:
    """``'0+-1mm'``: what the part rests on is level, at this height of the world; the sd follows ``+-``.

    Raises:
        InputError: No height, no standard deviation or one that is not positive.
        UnitError: No unit, or one that is none.
    """
    values = parse_lengths(",".join(value_and_sd(text, name, _TABLE)), name)
    if len(values) != 2 or values[1] <= 0:
        raise InputError(f"{name}: expected one height and a positive sd, got '{text}'. Write it as {_TABLE}.")
    return Table(np.array([0.0, 0.0, values[0]]), np.array([0.0, 0.0, 1.0]), values[1])


def read_furniture(text: str, unit: str | None = None, name: str = "furniture") -> Furniture:
    """``'vise.stl@400,200,0mm 0,0,90deg +- 0.5mm'``: a CAD file at a pose; its sd follows ``+-``.

    Args:
        text: the file, ``@`` and x, y, z with roll, pitch, yaw (left out: the file is in the world's frame), and how
            well its surface is known.
        unit: of formats that carry none.
        name: for messages.

    Raises:
        InputError: no sd, or one that is not positive; no pose; a file that cannot be read.
        UnitError: No unit, or one that is none.
    """
    where, sd = value_and_sd(text, name, _FURNITURE)
    path, _, pose = where.partition("@")
    sds = parse_lengths(sd, name)
    if len(sds) != 1 or sds[0] <= 0:
        raise InputError(f"{name}: expected one positive sd behind +-, got '{sd}'. Write it as {_FURNITURE}.")
    T = parse_pose(pose, name) if pose.strip() else np.eye(4)
    needed = unit if is_unitless(os.path.splitext(path.strip())[1]) else None  # it may be meant for the parts
    return Furniture.of_part(read_one(path.strip(), needed), T, sds[0])


def parse_box(text: str, name: str = "box") -> FloatArray:
    """``'0,0,0,500,400,200mm'``: lowest x, y, z of the world and highest, ``(2, 3)`` [m].

    Raises:
        InputError: Not six lengths, or the lowest not below the highest.
        UnitError: No unit, or one that is none.
    """
    values = parse_lengths(text, name)
    box = np.array(values).reshape(2, 3) if len(values) == 6 else np.zeros((2, 3))
    if not np.all(box[1] > box[0]):
        raise InputError(
            f"{name}: expected six lengths, the lowest x, y, z and then the highest, got '{text}'. "
            "Write it as 0,0,0,500,400,200mm."
        )
    return box


def parse_pose_prior(text: str, name: str = "pose_prior") -> UncertainFrame:
    """``'400,200,0mm 0,0,90deg +- 5mm 3deg'`` or ``'kuka 400,200,0,90,0,0 +- 5mm 3deg'``: a prior pose and its sds.

    Before ``+-``: x, y, z and roll, pitch, yaw, as answers are printed; or the name of a brand and its fields, also as
    its controller writes them: ``kuka {X 400, Y 200, ..}``, ``ur p[0.4, ..]``, ``abb [[..],[..]]``.
    Behind it: one length or three, one angle or three; see :func:`spread_pose`.

    Raises:
        InputError: Numbers are missing, or a standard deviation is not positive.
        UnitError: No unit, or one that is none.
    """
    pose, sds = value_and_sd(text, name, _NEAR)
    return spread_pose(parse_pose(pose, name), *parse_lengths_angles(sds, name), name)


def spread_pose(T: Transforms, sds: npt.ArrayLike, turn_sds: npt.ArrayLike, name: str = "pose_prior") -> UncertainFrame:
    """A pose of a part with standard deviations along the world's axes.

    Args:
        T: ``T_world_part`` ``(4, 4)``.
        sds: of the place of the part's origin along x, y, z of the world, one for all or three [m].
        turn_sds: of its rotation about axes along x, y, z of the world through that origin, one or three [rad].
        name: for messages.

    Raises:
        InputError: Not one or three, or not positive.
    """
    spread = [np.atleast_1d(np.asarray(values, dtype=np.float64)) for values in (sds, turn_sds)]
    got = f"{len(spread[0])} and {len(spread[1])}" if any(len(values) not in (1, 3) for values in spread) else ""
    if not got and not all(np.all(values > 0) for values in spread):
        lengths, angles = (
            ", ".join(f"{k * v:g}" for v in values) for k, values in zip((1e3, 180 / np.pi), spread, strict=True)
        )
        got = f"{lengths} mm and {angles} deg"
    if got:
        raise InputError(
            f"{name}: expected positive standard deviations, one length or three and one angle or three (along and "
            f"about x, y, z of the world), got {got}. Write it as {_NEAR}."
        )
    six = np.concatenate([np.broadcast_to(values, 3) for values in spread])
    return check_pose_prior(uncertain_frame(NamedCovariance(T, np.diag(six**2), ROS)), name)


def check_pose_prior(frame: UncertainFrame, name: str) -> UncertainFrame:
    """The frame, if it can be a prior pose.

    Raises:
        InputError: Something of it is certain, or its attitude is hardly known.
    """
    turn = float(np.sqrt(np.linalg.eigvalsh(frame.C[3:, 3:])[-1]))
    if np.linalg.eigvalsh(frame.C)[0] <= 0:
        raise InputError(
            f"{name}: expected a positive variance in every direction, got zero. Nothing is known that well."
        )
    if turn > _MOST_TURN:
        raise InputError(
            f"{name}: expected an attitude known to {np.degrees(_MOST_TURN):.0f} degrees (1 sd) or better, got "
            f"{np.degrees(turn):.0f}. Give a box for the place and leave the attitude open."
        )
    return frame


def value_and_sd(text: str, name: str, example: str) -> tuple[str, str]:
    """What stands before and behind ``+-``.

    Raises:
        InputError: one of both is missing.
    """
    halves = [half.strip() for half in _GIVE_OR_TAKE.split(text)]
    if len(halves) != 2 or not all(halves):
        raise InputError(
            f"{name}: expected a value and its standard deviation such as {example}, got '{text}'. "
            "Say behind +- how well it is known."
        )
    return halves[0], halves[1]
