"""Read samples for a hand-eye calibration, and write its result.

A sample is the pose ``T_base_hand`` that the robot reported and the pose ``T_camera_target`` that the camera reported.
A table has them in columns ``hand_x_mm .. hand_qw`` and ``target_x_mm .. target_qw``. YAML and JSON files are lists of
pairs of poses with the names of easy_handeye (``robot``, ``tracking`` or ``optical``), MoveIt's hand-eye calibration
(``effector_wrt_world``, ``object_wrt_sensor``) and OpenCV (``gripper2base``, ``target2cam``). The result is written as
easy_handeye2 does, so that ``--rig`` and the nodes of ROS read it; the covariance is a comment, because these nodes
refuse other keys.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.poses.camera_layouts import load_yaml
from tanteo.io.poses.transforms import pose_of
from tanteo.io.readings.units import ANGLE_UNITS, LENGTH_UNITS
from tanteo.vision import Camera
from tanteo.vision.camera import Mounting

_HAND = ("hand", "robot", "effector_wrt_world", "gripper2base", "T_base_hand", "base_hand")
_TARGET = ("target", "tracking", "optical", "object_wrt_sensor", "target2cam", "T_camera_target", "camera_target")
"""Names of the two poses of a sample, as programs write them."""

_LISTS = ("samples", "poses", "data")
_COVARIANCE = "# tanteo covariance x y z rx ry rz, camera frame, right, m rad:"
_SKEW = 1e-3
"""Largest deviation of a rotation matrix or of the length of a quaternion from one that rounding explains."""
_LARGEST = 20_000_000
"""Largest file that is read [bytes]."""


def read_hand_eye_samples(path: str | Path) -> tuple[Transforms, Transforms]:
    """Return the poses of hand and target of each sample.

    Args:
        path: CSV table, YAML or JSON file.

    Returns:
        ``T_base_hand`` and ``T_camera_target`` ``(n, 4, 4)`` [m].

    Raises:
        InputError: the file cannot be read, a pose is missing, has no unit or is no rigid motion.
    """
    file, text = Path(path), _text_of(path, "a file of samples")
    if file.suffix.lower() in (".yaml", ".yml", ".json", ".samples"):
        pairs = _of_document(load_yaml(text, file), str(path))
    else:
        pairs = _of_table(text, str(path))
    if not pairs:
        raise InputError(f"{path}: expected samples, got none. Give one row for each.")
    return np.stack([one for one, _ in pairs]), np.stack([one for _, one in pairs])


def _text_of(path: str | Path, what: str) -> str:
    file = Path(path)
    try:
        if file.stat().st_size > _LARGEST:
            raise InputError(f"{path}: expected {what} up to 20 MB, got a larger one. Check the path.")
        return file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "no text"
        raise InputError(f"{path}: expected {what}, got: {why}. Check the path.") from None


def _of_table(text: str, path: str) -> list[tuple[Transforms, Transforms]]:
    pairs = []
    for number, cells in _rows(text, path):
        pairs.append(tuple(_pose_of_cells(cells, which, f"{path}, line {number}") for which in ("hand", "target")))
    return pairs  # type: ignore[return-value]


def _rows(text: str, path: str) -> list[tuple[int, dict[str, str]]]:
    """Return the lines of a table with their numbers: cells by the names of their columns."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise InputError(f"{path}: expected a header line, got an empty file. Name the columns in it.")
    mark = max(",;\t", key=lines[0].count)
    rows = list(csv.reader(io.StringIO("\n".join(lines)), delimiter=mark))
    names = [name.strip().lower() for name in rows[0]]
    found = []
    for number, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise InputError(f"{path}, line {number}: expected {len(names)} cells as in the header, got {len(row)}.")
        cells = dict(zip(names, (cell.strip() for cell in row), strict=True))
        if mark != ",":
            cells = {name: cell.replace(",", ".") for name, cell in cells.items()}
        found.append((number, cells))
    return found


def _pose_of_cells(cells: Mapping[str, str], which: str, where: str) -> Transforms:
    unit = next((unit for unit in LENGTH_UNITS if f"{which}_x_{unit}" in cells), None)
    if unit is None:
        raise InputError(
            f"{where}: expected columns {which}_x_mm, {which}_y_mm, {which}_z_mm and {which}_qw .. {which}_qz, got "
            f"{', '.join(cells)}. Name them with their unit."
        )
    position = np.array([_number(cells, f"{which}_{axis}_{unit}", where) for axis in "xyz"]) * LENGTH_UNITS[unit]
    if f"{which}_qw" in cells:
        q = np.array([_number(cells, f"{which}_q{axis}", where) for axis in "xyzw"])
        return _pose(position, q, f"{where}, {which}")
    for angle, factor in ANGLE_UNITS.items():
        if f"{which}_roll_{angle}" in cells:
            names = [f"{which}_{name}_{angle}" for name in ("roll", "pitch", "yaw")]
            roll, pitch, yaw = (_number(cells, name, where) * factor for name in names)
            R = SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)
            return SE3.from_parts(R, position)
        if f"{which}_rx_{angle}" in cells:
            turn = np.array([_number(cells, f"{which}_r{axis}_{angle}", where) for axis in "xyz"]) * factor
            return SE3.from_parts(SO3.exp(turn), position)
    raise InputError(
        f"{where}: expected the rotation of the {which} as {which}_qw .. {which}_qz, as a rotation vector "
        f"{which}_rx_rad .. {which}_rz_rad, or as {which}_roll_deg, pitch and yaw, got none. Add the columns."
    )


def _number(cells: Mapping[str, str], name: str, where: str) -> float:
    try:
        value = float(cells[name])
    except (KeyError, ValueError):
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"{where}, column '{name}': expected a number, got '{cells.get(name, '')}'. Correct it.")
    return value


def _of_document(document: Any, path: str) -> list[tuple[Transforms, Transforms]]:
    rows = document
    if isinstance(document, Mapping):
        rows = next((document[name] for name in _LISTS if name in document), None)
        hands, targets = (next((document[n] for n in names if n in document), None) for names in (_HAND, _TARGET))
        if rows is None and isinstance(hands, list) and isinstance(targets, list) and len(hands) == len(targets):
            rows = [{"hand": one, "target": other} for one, other in zip(hands, targets, strict=True)]
    if not isinstance(rows, list):
        raise InputError(
            f"{path}: expected a list of samples with two poses each, named {', '.join(_HAND[:4])} and "
            f"{', '.join(_TARGET[:5])}, got another document. Name the poses so."
        )
    pairs = []
    for number, row in enumerate(rows, 1):
        where = f"{path}, sample {number}"
        if not isinstance(row, Mapping):
            raise InputError(
                f"{where}: expected two poses by name, got {type(row).__name__}. Name them hand and target."
            )
        found = []
        for names in (_HAND, _TARGET):
            name = next((name for name in names if name in row), None)
            if name is None:
                raise InputError(f"{where}: expected one of {', '.join(names)}, got {', '.join(map(str, row))}.")
            found.append(_pose_of(row[name], f"{where}, {name}"))
        pairs.append((found[0], found[1]))
    return pairs


def _pose_of(value: Any, where: str) -> Transforms:
    """Return a pose from a matrix of 16 numbers, or a translation and a quaternion by name [m]."""
    if isinstance(value, Mapping):
        value = value.get("transform", value.get("pose", value))
        if isinstance(value, Mapping):
            position = value.get("translation", value.get("position"))
            rotation = value.get("rotation", value.get("orientation", value.get("quaternion")))
            if isinstance(position, Mapping) and isinstance(rotation, Mapping):
                p = [position.get(axis) for axis in "xyz"]
                q = [rotation.get(axis) for axis in "xyzw"]
                return _pose(_floats(p, 3, where), _floats(q, 4, where), where)
            raise InputError(
                f"{where}: expected translation x y z and rotation x y z w, got {', '.join(map(str, value))}."
            )
    flat = [number for row in value for number in (row if isinstance(row, list) else [row])] if _is_list(value) else []
    T = _floats(flat, 16, where).reshape(4, 4)
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > _SKEW or np.linalg.det(R) < 0 or np.abs(T[3] - [0, 0, 0, 1]).max() > _SKEW:
        raise InputError(f"{where}: expected the matrix of a rigid motion by rows, got another one. Check the order.")
    U, _, Vt = np.linalg.svd(R)
    return SE3.from_parts(U @ Vt, T[:3, 3])


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _floats(values: Sequence[Any], count: int, where: str) -> Any:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise InputError(f"{where}: expected {count} finite numbers, got {values!r:.80}. Correct the pose.")
    return array


def _pose(position: Any, q: Any, where: str) -> Transforms:
    length = float(np.linalg.norm(q))
    if abs(length - 1) > _SKEW:
        raise InputError(
            f"{where}: expected a quaternion of length 1, got length {length:.4g}. Check the order and the columns."
        )
    return pose_of(position, q)


@dataclass(frozen=True, slots=True, eq=False)
class HandPose:
    """The pose of a hand at which an image was taken.

    Attributes:
        T_base_hand: pose that the robot reported ``(4, 4)`` [m].
        sds: standard deviations of position [m] and rotation [rad] about each axis, where the file states them.
        image: name of the image's file; empty if the file does not name it.
    """

    T_base_hand: Transforms
    sds: tuple[float, float] | None
    image: str = ""


def read_hand_poses(path: str | Path) -> tuple[HandPose, ...]:
    """Return the poses of a hand at which images were taken, one for each row of a table.

    Columns are ``hand_x_mm .. hand_qw`` as for samples of a hand-eye calibration, and, if known, ``image`` (the name of
    the file), ``hand_sd_mm`` and ``hand_sd_deg`` (standard deviations of position and rotation about each axis).

    Args:
        path: CSV table.

    Raises:
        InputError: the file cannot be read, or a pose is missing or has no unit.
    """
    out = []
    for number, cells in _rows(_text_of(path, "a table of poses of the hand"), str(path)):
        where = f"{path}, line {number}"
        T = _pose_of_cells(cells, "hand", where)
        length = next((unit for unit in LENGTH_UNITS if f"hand_sd_{unit}" in cells), None)
        angle = next((unit for unit in ANGLE_UNITS if f"hand_sd_{unit}" in cells), None)
        sds = None
        if length is not None or angle is not None:
            if length is None or angle is None:
                raise InputError(f"{where}: expected both hand_sd_mm and hand_sd_deg, got one. Add the other column.")
            sds = (
                _number(cells, f"hand_sd_{length}", where) * LENGTH_UNITS[length],
                _number(cells, f"hand_sd_{angle}", where) * ANGLE_UNITS[angle],
            )
            if min(sds) < 0:
                raise InputError(f"{where}: expected standard deviations of 0 or more, got {sds}. Correct them.")
        out.append(HandPose(T, sds, cells.get("image", "")))
    if not out:
        raise InputError(f"{path}: expected one row for each image, got none. Add rows.")
    return tuple(out)


def read_mounting(path: str | Path, sds: tuple[float, float] | None = None) -> Mounting:
    """Return the pose of a camera on the hand with its covariance.

    Files that ``tanteo calibrate hand-eye --write`` or ``--json`` writes have a covariance. Those of other programs (a
    result of easy_handeye, a ``TransformStamped``) have none, and the standard deviations are stated.

    Args:
        path: YAML or JSON file; ``FILE#hand/link`` names the frames of a URDF.
        sds: standard deviations of position [m] and rotation [rad] about each axis, in place of those of the file.

    Raises:
        InputError: the file cannot be read, describes a fixed camera, or neither it nor ``sds`` states a covariance.
    """
    from tanteo.io.documents.mount_files import read_mount

    file, _, frames = str(path).partition("#")
    text = _text_of(file, "a result of a hand-eye calibration")
    covariance = None if sds is None else np.diag(np.repeat(np.square(sds), 3))
    own: FloatArray | None
    if '"tanteo.hand_eye/1"' in text:
        T, own = _of_result(text, str(path))
    else:
        T = read_mount(f"{file}#{frames if ':' in frames else frames + ':z'}").T_hand_sensor  # z along the optical axis
        line = next((one for one in text.splitlines() if one.startswith(_COVARIANCE)), None)
        own = None if line is None else _covariance(line[len(_COVARIANCE) :].split(), str(path))
    covariance = own if covariance is None else covariance
    if covariance is None:
        raise InputError(
            f"{path}: expected the covariance of the camera's pose, as tanteo calibrate hand-eye writes it, got none. "
            "State standard deviations: --hand-eye-sd 1mm,0.2deg."
        )
    return Mounting(T, covariance)


def _of_result(text: str, path: str) -> tuple[Transforms, FloatArray]:
    try:
        document = json.loads(text)
        camera = document["camera"]
        frame, T = camera["pose"]["frame"], camera["pose"]["matrix"]
        status, numbers = document["status"], camera["covariance"]["matrix"]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: expected a document tanteo.hand_eye/1, got: {error}. Write it again.") from None
    if frame != "hand" or status != "calibrated":
        raise InputError(
            f"{path}: expected a calibrated camera on the hand, got status {status}, frame {frame}. Use such a result."
        )
    return _pose_of(T, path), _covariance([one for row in numbers for one in row], path)


def _covariance(numbers: Sequence[Any], path: str) -> FloatArray:
    C = np.asarray(_floats(list(numbers), 36, f"{path}, covariance")).reshape(6, 6)
    return 0.5 * (C + C.T)


def camera_on_hand(camera: Camera, mounting: Mounting, pose: HandPose, sds: tuple[float, float]) -> Camera:
    """Return a camera on a hand with its pose in the robot's base, and the errors of both.

    Args:
        camera: calibrated camera.
        mounting: its pose on the hand.
        pose: pose of the hand.
        sds: standard deviations of the hand's position [m] and rotation [rad] about each axis, where the pose states
            none.
    """
    own = np.diag(np.repeat(np.square(pose.sds or sds), 3))
    return mounting.camera_at(camera, pose.T_base_hand, own if own.any() else None)


def hand_eye_yaml(
    T: Transforms, covariance: FloatArray, *, on_hand: bool, hand: str, camera: str, base: str, target: str
) -> str:
    """Return the result as text in the format of easy_handeye2.

    Args:
        T: pose of the camera ``(4, 4)`` in the hand's frame, or in the base's for a fixed camera [m].
        covariance: its covariance ``(6, 6)``, camera frame, right [m, rad].
        on_hand: whether the camera is on the hand.
        hand: name of the hand's frame.
        camera: name of the camera's frame.
        base: name of the robot's base frame.
        target: name of the target's frame.
    """
    w, x, y, z = SO3.as_quaternion(T[:3, :3])
    p = T[:3, 3]
    numbers = " ".join(f"{value:.9g}" for value in np.asarray(covariance).ravel())
    return (
        f"{_COVARIANCE} {numbers}\n"
        "parameters:\n"
        f"  calibration_type: {'eye_in_hand' if on_hand else 'eye_on_base'}\n"
        f"  robot_base_frame: {base}\n  robot_effector_frame: {hand}\n"
        f"  tracking_base_frame: {camera}\n  tracking_marker_frame: {target}\n"
        "transform:\n"
        f"  translation: {{x: {p[0]:.9f}, y: {p[1]:.9f}, z: {p[2]:.9f}}}\n"
        f"  rotation: {{x: {x:.9f}, y: {y:.9f}, z: {z:.9f}, w: {w:.9f}}}\n"
    )
