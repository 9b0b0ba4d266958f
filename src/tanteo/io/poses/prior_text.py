"""Parse pose priors that a user types: a table, a box, a prior pose, each with its unit and standard deviation."""

from __future__ import annotations

import os
import re

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.geometry import ROS, UncertainFrame, uncertain_frame
from tanteo.geometry.named import NamedCovariance
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.documents.part_files import read_one
from tanteo.io.poses.pose_syntax import parse_pose
from tanteo.io.readings.units import parse_lengths, parse_lengths_angles
from tanteo.parts.readers import is_unitless
from tanteo.posterior import Furniture, Table

_NEAR = "400,200,0mm 0,0,90deg +- 5mm 3deg"
_TABLE = "0+-1mm"
_PLANE = "120,0,0mm -1,0,0 +- 0.1mm"
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_FURNITURE = "vise.stl@400,200,0mm 0,0,90deg +- 0.5mm"
_MOST_TURN = np.pi / 3
"""Largest standard deviation of an attitude [rad]; beyond it the normal density wraps around half a turn within 3 sd.
One direction may be free up to half a turn, such as the heading of a level part.
"""

_GIVE_OR_TAKE = re.compile(r"\+-|\+/-|±")


def parse_table(text: str, name: str = "table") -> Table:
    """Return the plane of a text such as ``'0+-1mm'``, level at a height, or ``'120,0,0mm -1,0,0 +- 0.1mm'``.

    The second has a point of the plane in the world and its normal towards the part.

    Args:
        text: height, or x, y, z of a point, a space, and a normal; ``+-`` and the standard deviation of the height.
        name: name of the input, for messages.

    Raises:
        InputError: point, normal or standard deviation are missing or invalid.
        UnitError: the unit is missing or unknown.
    """
    where, sd = value_and_sd(text, name, _TABLE)
    point, _, normal = where.strip().partition(" ")
    if normal.strip():
        numbers = [part.strip() for part in normal.split(",")]
        if len(numbers) != 3 or not all(_NUMBER.fullmatch(part) for part in numbers):
            raise InputError(
                f"{name}: expected a normal of three numbers, got '{normal.strip()}'. Write it as {_PLANE}."
            )
        place, sds = parse_lengths(point, name), parse_lengths(sd, name)
        if len(place) != 3 or len(sds) != 1 or sds[0] <= 0:
            raise InputError(f"{name}: expected a point and a positive sd, got '{text}'. Write it as {_PLANE}.")
        return Table(np.array(place), np.array([float(part) for part in numbers]), sds[0])
    values = parse_lengths(f"{where},{sd}", name)
    if len(values) != 2 or values[1] <= 0:
        raise InputError(f"{name}: expected one height and a positive sd, got '{text}'. Write it as {_TABLE}.")
    return Table(np.array([0.0, 0.0, values[0]]), np.array([0.0, 0.0, 1.0]), values[1])


def read_furniture(text: str, unit: str | None = None, name: str = "furniture") -> Furniture:
    """Read a fixed object that is not a part, from a text such as ``'vise.stl@400,200,0mm 0,0,90deg +- 0.5mm'``.

    Args:
        text: CAD file, ``@``, x, y, z with roll, pitch, yaw, ``+-`` and the standard deviation of its surface. Without
            a pose the file is in the world frame.
        unit: length unit of file formats that carry none; None if not needed.
        name: name of the input, for messages.

    Raises:
        InputError: the standard deviation is missing or not positive, or the pose is invalid.
        PartError: the file cannot be read.
        UnitError: a unit is missing or unknown.
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
    """Return the lowest and highest corner ``(2, 3)`` [m] of a box in the world, typed as ``'0,0,0,500,400,200mm'``.

    Args:
        text: lowest x, y, z, then highest x, y, z.
        name: name of the input, for messages.

    Raises:
        InputError: there are not six lengths, or the lowest corner is not below the highest.
        UnitError: the unit is missing or unknown.
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
    """Return the prior pose of a text such as ``'400,200,0mm 0,0,90deg +- 5mm 3deg'``.

    Before ``+-`` stands a pose: x, y, z and roll, pitch, yaw as answers print them, or a brand name with its fields as
    the controller writes them: ``kuka {X 400, Y 200, ..}``, ``ur p[0.4, ..]``, ``abb [[..],[..]]``. After it stand one
    or three standard deviations of position and one or three of rotation; see :func:`spread_pose`.

    Args:
        text: pose and standard deviations.
        name: name of the input, for messages.

    Raises:
        InputError: numbers are missing, or a standard deviation is not positive.
        UnitError: a unit is missing or unknown.
    """
    pose, sds = value_and_sd(text, name, _NEAR)
    return spread_pose(parse_pose(pose, name), *parse_lengths_angles(sds, name), name)


def spread_pose(T: Transforms, sds: npt.ArrayLike, turn_sds: npt.ArrayLike, name: str = "pose_prior") -> UncertainFrame:
    """Return a pose of a part with standard deviations along the world's axes.

    Args:
        T: ``T_world_part`` ``(4, 4)`` [m].
        sds: standard deviations of the part's origin along x, y, z of the world, one for all or three [m].
        turn_sds: standard deviations of rotation about axes through that origin parallel to x, y, z of the world, one
            for all or three [rad].
        name: name of the input, for messages.

    Raises:
        InputError: the standard deviations are not one or three, or not positive.
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
    """Return the frame unchanged if it can serve as a prior pose.

    Args:
        frame: pose with covariance.
        name: name of the input, for messages.

    Raises:
        InputError: a variance is zero, or the attitude's standard deviation exceeds 60 degrees about two axes, or half
            a turn about one.
    """
    turns = np.sqrt(np.linalg.eigvalsh(frame.C[3:, 3:])[1:])
    if np.linalg.eigvalsh(frame.C)[0] <= 0:
        raise InputError(f"{name}: expected a positive variance in every direction, got zero. Give a positive one.")
    if turns[0] > _MOST_TURN or turns[1] > np.pi * (1 + 1e-9):
        wrong = turns[0] if turns[0] > _MOST_TURN else turns[1]
        raise InputError(
            f"{name}: expected an attitude known to {np.degrees(_MOST_TURN):.0f} degrees (1 sd) or better about two "
            f"axes, and to 180 about the third, got {np.degrees(wrong):.0f}. Give a box for the place and leave the "
            "attitude open."
        )
    return frame


def value_and_sd(text: str, name: str, example: str) -> tuple[str, str]:
    """Return the text before and after ``+-``.

    Args:
        text: value and standard deviation.
        name: name of the input, for messages.
        example: correct form, for messages.

    Raises:
        InputError: one of the two is missing.
    """
    halves = [half.strip() for half in _GIVE_OR_TAKE.split(text)]
    if len(halves) != 2 or not all(halves):
        raise InputError(
            f"{name}: expected a value and its standard deviation such as {example}, got '{text}'. "
            "Write the standard deviation after +-."
        )
    return halves[0], halves[1]
