"""Read the joints of a robot from a URDF or xacro, or from a table of Denavit and Hartenberg, and joint angles."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from tanteo.errors import InputError, did_you_mean
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.documents.mount_files import UrdfJoint, read_urdf
from tanteo.io.readings.headers import canonical
from tanteo.io.readings.units import ANGLE_UNITS, LENGTH_UNITS, parse_quantities
from tanteo.sensors.joints import JointChain

_TURNING, _SLIDING = ("revolute", "continuous"), "prismatic"
_JOINT = re.compile(r"(?:actual_)?(?:q|j|joint|axis|a)_?(\d)(?:_(deg|rad))?")
_DH = {"a": LENGTH_UNITS, "d": LENGTH_UNITS, "alpha": ANGLE_UNITS, "theta": ANGLE_UNITS}


def read_arm(path: str) -> JointChain:
    """Return the joints of a robot from its base to the hand.

    Args:
        path: ``robot.urdf#hand`` or ``robot.urdf#base/hand`` (also xacro), or a table ``dh.csv`` with a row for each
            joint and columns such as ``a_mm, alpha_deg, d_mm, theta_deg``; ``dh.csv#modified`` for Craig's convention.

    Raises:
        InputError: the file cannot be read, or has no chain of joints to the hand.
    """
    name, _, fragment = path.partition("#")
    return _of_table(Path(name), fragment) if Path(name).suffix.lower() == ".csv" else _of_urdf(Path(name), fragment)


def _of_urdf(file: Path, fragment: str) -> JointChain:
    base, _, hand = fragment.rpartition("/")
    joints = read_urdf(file)
    if hand not in joints:
        known = ", ".join(list(joints)[-8:])
        raise InputError(
            f"{file}: expected the frame of the hand as {file.name}#LINK, got '{hand}'. Links are {known}."
            f"{did_you_mean(hand, list(joints))}"
        )
    chain, link = list[UrdfJoint](), hand
    while link in joints and link != base and len(chain) <= len(joints):
        chain.append(joints[link])
        link = joints[link].parent
    if base and link != base:
        raise InputError(f"{file}: expected a base above '{hand}', got '{base}'. It ends at '{link}'.")
    names, before, turns, T = list[str](), list[Transforms](), list[bool](), np.eye(4)
    for joint in reversed(chain):
        T = T @ joint.T
        if joint.motion in (*_TURNING, _SLIDING):
            aimed = SE3.from_parts(SO3.frame_from_axis(joint.axis, 2), np.zeros(3))
            names.append(joint.name)
            before.append(T @ aimed)
            turns.append(joint.motion in _TURNING)
            T = SE3.inverse(aimed)
    if not names:
        raise InputError(f"{file}: expected joints that move above '{hand}', got none. Name the hand's link.")
    return JointChain(tuple(names), np.array(before), np.array(turns), T, file.name)


def _of_table(file: Path, convention: str) -> JointChain:
    """Return the joints of a table of Denavit and Hartenberg: classic by default, or modified (Craig)."""
    if convention not in ("", "classic", "modified"):
        raise InputError(f"{file}: expected #classic or #modified, got '#{convention}'. Name the convention.")
    rows = _rows(file)
    columns = {name: (k, units[unit]) for k, cell in enumerate(rows[0]) for name, units in _DH.items()
               for base, _, unit in [canonical(cell).rpartition("_")] if base == name and unit in units}  # fmt: skip
    if columns.keys() != _DH.keys():
        raise InputError(f"{file}: expected columns a_mm, alpha_deg, d_mm, theta_deg, got {', '.join(rows[0])}.")
    try:
        values = {n: np.array([float(row[k]) * unit for row in rows[1:]]) for n, (k, unit) in columns.items()}
    except (ValueError, IndexError) as error:
        raise InputError(f"{file}: expected four numbers for each joint, got: {error}. Correct it.") from None
    link = [
        SE3.from_parts(SO3.axis_rotation(0, alpha), np.array([a, 0.0, 0.0]))
        for a, alpha in zip(values["a"], values["alpha"], strict=True)
    ]
    along = [
        SE3.from_parts(SO3.axis_rotation(2, theta), np.array([0.0, 0.0, d]))
        for d, theta in zip(values["d"], values["theta"], strict=True)
    ]
    n = len(link)
    if not n:
        raise InputError(f"{file}: expected a row for each joint, got none. Add them.")
    # the joint turns about the z axis of its frame, so that its own constant rotation and slide may stand before it
    if convention == "modified":
        before, after = [link[k] @ along[k] for k in range(n)], np.eye(4)
    else:
        before, after = [(link[k - 1] if k else np.eye(4)) @ along[k] for k in range(n)], link[-1]
    return JointChain(
        tuple(f"row {k + 1}" for k in range(n)), np.array(before), np.ones(n, dtype=np.bool_), after, file.name
    )


def read_joints(text: str) -> FloatArray:
    """Return joint angles ``(m, d)`` [rad] from a text such as ``0,-90,90,-90,-90,0deg``, or from a table.

    Args:
        text: angles of the arm at about one reading, or a file with columns ``j1_deg ..``, ``joint_1_rad ..``,
            ``A1_deg`` or ``actual_q_0 ..`` (radians).

    Raises:
        InputError: the text is no angles with a unit, or the file has no such columns.
    """
    if not Path(text).suffix:
        return np.array([parse_quantities(text, "joints", ANGLE_UNITS, "0,-90,90,-90,-90,0deg")])
    rows = _rows(Path(text))
    found: dict[int, tuple[int, float]] = {}
    for k, cell in enumerate(rows[0]):
        match = _JOINT.fullmatch(canonical(cell))
        if match is not None and (match[2] or "q" in canonical(cell)):
            found[int(match[1])] = k, ANGLE_UNITS[match[2] or "rad"]
    if not found:
        raise InputError(f"{text}: expected columns j1_deg, j2_deg .. of joint angles, got {', '.join(rows[0][:12])}.")
    try:
        return np.array([[float(row[k]) * unit for _, (k, unit) in sorted(found.items())] for row in rows[1:]])
    except (ValueError, IndexError) as error:
        raise InputError(f"{text}: expected a joint angle in each row, got: {error}. Correct it.") from None


def _rows(file: Path) -> list[list[str]]:
    try:
        with file.open(encoding="utf-8-sig", newline="") as text:
            rows = [row for row in csv.reader(text) if row and not row[0].startswith("#")]
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: expected a table as CSV, got: {error}. Check the path.") from None
    if len(rows) < 2:
        raise InputError(f"{file}: expected a header and rows, got {len(rows)} rows. Add them.")
    return rows
