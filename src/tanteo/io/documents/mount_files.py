"""Read where a sensor sits on the hand from files of ROS and of calibration programs.

URDF and xacro state a chain of fixed joints to a link. Hand-eye results of easy_handeye and easy_handeye2, static
transforms of MoveIt's calibration and of launch files, and messages ``TransformStamped`` as YAML state one pose. In a
camera chain of Kalibr ``T_cam_imu`` maps the hand to the camera, and is inverted. A matrix of a script is read if its
name states what it maps: ``T_flange_sensor``, or OpenCV's ``R_cam2gripper`` and ``t_cam2gripper``.

A sensor's beam is along +x of its frame (``sensor_msgs/Range``, REP 103), along +z of an optical frame, of Kalibr's
cameras and of matrices.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import InputError, MissingExtraError, did_you_mean, install_command
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Rotations, Transforms
from tanteo.io.poses.camera_layouts import load_yaml
from tanteo.io.poses.transforms import pose_of

_SUFFIXES = (".urdf", ".xacro", ".xml", ".yaml", ".yml", ".calib", ".launch", ".py")
_FIXED = ("fixed",)
_HANDS = ("tool0", "flange", "tcp", "tool_flange")
"""Frames of a fixed chain that controllers report as the hand, the most likely first."""
_LARGEST = 20_000_000
"""Largest file that is read [bytes]."""
_SKEW = 1e-3
"""Largest deviation of a rotation matrix or of the length of a quaternion from one that rounding explains."""
_FARTHEST = 3.0
"""Largest distance of a sensor from the hand along an axis [m]; more indicates millimetres."""
_ALONG_Z = "camera chain of Kalibr", "matrix"
_HAND_WORD, _SENSOR_WORD = (
    r"(?:hand|flange|tool0?|tcp|ee|eef|effector|gripper|wrist)",
    r"(?:cam(?:era)?|sensor|tof|laser|lidar|eye|probe)",
)
_FORWARD = re.compile(
    rf"(?:[TXRt]_)?(?:{_HAND_WORD}_{_SENSOR_WORD}|{_SENSOR_WORD}2{_HAND_WORD}|{_SENSOR_WORD}_to_{_HAND_WORD})"
)
_BACKWARD = re.compile(
    rf"(?:[TXRt]_)?(?:{_SENSOR_WORD}_{_HAND_WORD}|{_HAND_WORD}2{_SENSOR_WORD}|{_HAND_WORD}_to_{_SENSOR_WORD})"
)
"""Names of matrices that map the sensor's frame to the hand's, and the opposite."""
_STATIC = re.compile(r"static_transform_publisher", re.IGNORECASE)
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


@dataclass(frozen=True, slots=True)
class Mount:
    """Sensor on the hand, as a file states it.

    Attributes:
        name: name of the sensor's frame.
        hand: name of the hand's frame.
        T_hand_sensor: pose of a sensor whose beam is along +z ``(4, 4)`` [m].
        axis: axis of the file's frame along which the beam runs: ``x``, ``z``, ...
        words: kind of file for messages.
    """

    name: str
    hand: str
    T_hand_sensor: Transforms
    axis: str
    words: str

    @property
    def note(self) -> str:
        """Sentence on the assumed hand and beam."""
        return (
            f"{self.words}: the hand is the frame '{self.hand}', and the beam runs along {self.axis} of '{self.name}'. "
            f"State others as FILE#{self.hand}/{self.name}:z."
        )


def is_mount(path: str) -> bool:
    """Return whether a path names a file of ROS or of a calibration program, with or without ``#link``.

    Args:
        path: path as given by the user.
    """
    return Path(path.partition("#")[0]).suffix.lower() in _SUFFIXES


def read_mount(path: str) -> Mount:
    """Return the pose of a sensor on the hand.

    Args:
        path: file, or ``FILE#link``, ``FILE#hand/link`` and ``FILE#link:axis`` to name frames and the beam's axis.

    Raises:
        InputError: the file cannot be read, states no such pose, or no chain of fixed joints connects the frames.
        MissingExtraError: a package for YAML or xacro is not installed.
    """
    name, _, fragment = path.partition("#")
    frames, _, axis = fragment.partition(":")
    hand, _, link = frames.rpartition("/")
    file = Path(name)
    text = _text(file)
    suffix = file.suffix.lower()
    if suffix == ".xacro":
        text = _expanded(file)
    if "<robot" in text:
        T, hand, link = _of_urdf(file, text, hand, link)
        words = "URDF"
    elif _STATIC.search(text):
        T, hand, link = _of_launch(file, text, link)
        words = "static transform"
    else:
        T, hand, link, words = _of_yaml(file, text, hand, link)
    if np.abs(T[:3, 3]).max() > _FARTHEST:
        raise InputError(
            f"{file}: expected a sensor within {_FARTHEST:g} m of the hand '{hand}', got it at {T[:3, 3].tolist()} m. "
            "Is it in millimetres? Write metres."
        )
    axis = axis or ("z" if "optical" in link.lower() or words in _ALONG_Z else "x")
    return Mount(link, hand, T @ SE3.from_parts(_aimed(axis, path), np.zeros(3)), axis, words)


def _aimed(axis: str, path: str) -> Rotations:
    """Return the rotation from a frame with the beam along +z to the file's frame, with the rows of zones along z."""
    sign = -1.0 if axis.startswith("-") else 1.0
    if axis.lstrip("+-") not in ("x", "y", "z"):
        raise InputError(f"{path}: expected the axis of the beam as x, -x, y or z, got '{axis}'. Write FILE#link:x.")
    if axis == "z":
        return np.eye(3)
    if axis == "x":  # from optical axes (z forward, y down) to those of a body (x forward, z up), REP 103
        return np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    direction = np.zeros(3)
    direction["xyz".index(axis[-1])] = sign
    return SO3.frame_from_axis(direction, 2)


def _text(file: Path) -> str:
    try:
        if file.stat().st_size > _LARGEST:
            raise InputError(f"{file}: expected a file of up to {_LARGEST:.0e} bytes, got a larger one.")
        return file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{file}: expected a file of a rig, got: {error.strerror}. Check the path.") from None


def _expanded(file: Path) -> str:
    """Return the URDF of a xacro file."""
    try:
        import xacro
    except ImportError:
        raise MissingExtraError(
            f"{file}: expected the package xacro to expand it, got none. Run {install_command('urdf')}, or "
            f"expand the file where ROS is: xacro {file.name} > robot.urdf."
        ) from None
    try:
        return str(xacro.process_file(str(file)).toxml())
    except Exception as error:  # noqa: BLE001  xacro evaluates expressions of the file, which can raise anything
        raise InputError(f"{file}: expected a xacro file, got: {str(error)[:200]}. Correct it.") from None


@dataclass(frozen=True, slots=True, eq=False)
class UrdfJoint:
    """Joint of a URDF.

    Attributes:
        name: name of the joint.
        parent: link before it.
        motion: type, such as ``fixed`` or ``revolute``.
        T: pose of the joint in the frame of its parent ``(4, 4)`` [m].
        axis: axis of the motion in the frame of the joint ``(3,)``.
    """

    name: str
    parent: str
    motion: str
    T: Transforms
    axis: np.ndarray


def read_urdf(file: Path) -> dict[str, UrdfJoint]:
    """Return the joint above each link of a URDF or xacro file, by the name of the link.

    Args:
        file: file to read.

    Raises:
        InputError: the file cannot be read or is no URDF.
        MissingExtraError: the package xacro is not installed.
    """
    text = _text(file)
    return _joints(file, _expanded(file) if file.suffix.lower() == ".xacro" else text)[0]


def _joints(file: Path, text: str) -> tuple[dict[str, UrdfJoint], list[str]]:
    """Return the joint above each link, and the names of all links."""
    from lxml import etree

    try:
        root = etree.fromstring(text.encode(), etree.XMLParser(resolve_entities=False, no_network=True))
    except (etree.XMLSyntaxError, ValueError) as error:
        raise InputError(f"{file}: expected URDF (XML), got: {str(error)[:200]}. Correct it.") from None
    if any("xacro" in str(one.tag) for one in root.iter()):
        raise InputError(f"{file}: expected URDF, got xacro. Name it .xacro, or expand it: xacro {file.name}.")
    joints: dict[str, UrdfJoint] = {}
    for joint in root.findall("joint"):
        parent, child, axis = joint.find("parent"), joint.find("child"), joint.find("axis")
        if parent is None or child is None:
            continue
        numbers = [float(w) for w in re.findall(_NUMBER, "1 0 0" if axis is None else axis.get("xyz", "1 0 0"))]
        length = float(np.linalg.norm(numbers))
        if len(numbers) != 3 or not length > 0:
            raise InputError(f"{file}, joint '{joint.get('name')}': expected an axis of three numbers, got {numbers}.")
        joints[child.get("link", "")] = UrdfJoint(
            joint.get("name", ""), parent.get("link", ""), joint.get("type", ""), _origin(file, joint),
            np.array(numbers) / length,
        )  # fmt: skip
    return joints, [one.get("name", "") for one in root.findall("link")]


def _of_urdf(file: Path, text: str, hand: str, link: str) -> tuple[Transforms, str, str]:
    """Return the pose of a link in the hand, and the names of both, from the fixed joints of a URDF."""
    joints, links = _joints(file, text)
    parents = {child: (joint.parent, joint.motion, joint.T) for child, joint in joints.items()}
    leaves = [one for one in links if one in parents and one not in {p for p, _, _ in parents.values()}]
    fixed = [one for one in leaves if parents[one][1] in _FIXED]
    if not link and len(fixed) != 1:
        raise InputError(
            f"{file}: expected the link of the sensor as {file.name}#LINK, got none. Links at the end of fixed joints: "
            f"{', '.join(fixed) or 'none'}."
        )
    link = link or fixed[0]
    if link not in parents:
        raise InputError(f"{file}: expected a link with a joint above it, got '{link}'.{did_you_mean(link, links)}")
    chain, T = [(link, np.eye(4))], np.eye(4)
    while chain[-1][0] in parents and parents[chain[-1][0]][1] in _FIXED and len(chain) <= len(parents):
        parent, _, step = parents[chain[-1][0]]
        T = step @ T
        chain.append((parent, T))
    above = dict(chain[1:])
    if not hand:
        hand = next((one for one in _HANDS if one in above), chain[-1][0])
    if hand not in above:
        joint = parents[chain[-1][0]][1] if chain[-1][0] in parents else ""
        moving = f", above which is a joint of type {joint}" if joint and joint not in _FIXED else ""
        raise InputError(
            f"{file}: expected a hand above '{link}' by fixed joints ({', '.join(above) or 'none'}{moving}), got "
            f"'{hand}'. Name one of them."
        )
    return above[hand], hand, link


def _origin(file: Path, joint: Any) -> Transforms:
    """Return the pose of a joint: fixed axes roll, pitch and yaw."""
    origin = joint.find("origin")
    numbers = {"xyz": np.zeros(3), "rpy": np.zeros(3)}
    for name in numbers:
        words = "" if origin is None else origin.get(name, "0 0 0")
        found = np.array([float(w) for w in re.findall(_NUMBER, words)])
        if origin is not None:
            if len(found) != 3 or len(words.split()) != 3:
                raise InputError(
                    f"{file}, joint '{joint.get('name')}': expected three numbers in {name}, got '{words[:60]}'. "
                    "Correct it."
                )
            numbers[name] = found
    if origin is not None and (words := origin.get("quat_xyzw")):
        return _quaternion_pose(file, numbers["xyz"], np.array([float(w) for w in re.findall(_NUMBER, words)]))
    roll, pitch, yaw = numbers["rpy"]
    R = SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)
    return SE3.from_parts(R, numbers["xyz"])


def _of_launch(file: Path, text: str, link: str) -> tuple[Transforms, str, str]:
    """Return the transform of a static transform publisher: seven or six numbers and two frames, or named arguments."""
    found: dict[str, tuple[str, Transforms]] = {}
    lists = [re.sub(r"['\",]", " ", one) for one in re.findall(r"arguments\s*=\s*\[([^\]]*)\]", text)]
    for args in [*re.findall(r"args\s*=\s*\"([^\"]*)\"", text), *lists]:
        words = args.split()
        frames = [w for w in words if not re.fullmatch(_NUMBER, w)]
        numbers = [float(w) for w in words if re.fullmatch(_NUMBER, w)]
        if len(frames) >= 2 and len(numbers) in (6, 7, 8) and not any(w.startswith("--") for w in words):
            count = 7 if len(numbers) >= 7 and abs(np.linalg.norm(numbers[3:7]) - 1) < _SKEW else 6
            found[frames[1].lstrip("/")] = frames[0].lstrip("/"), _placed(file, numbers[:3], numbers[3:count])
    words = [w for w in re.split(r"[\s,'\"\[\]]+", re.sub(r"(--[\w-]+)=", r"\1 ", text)) if w]
    named: dict[str, str] = {}
    for key, value in pairwise(words):
        if key.startswith("--"):
            named[key[2:]] = value
            if {"frame-id", "child-frame-id"} <= named.keys() and len(named) >= 5:
                place = [float(named.get(k, 0)) for k in "xyz"]
                turn = [named.get(k) for k in ("qx", "qy", "qz", "qw")]
                angles = [float(named.get(k, 0)) for k in ("yaw", "pitch", "roll")]
                rest = [float(t) for t in turn if t is not None] if None not in turn else angles
                found[named["child-frame-id"]] = named["frame-id"], _placed(file, place, rest)
    if not found or (link and link not in found) or (not link and len(found) > 1):
        raise InputError(
            f"{file}: expected one static transform of a sensor, got {', '.join(found) or 'none that is complete'}. "
            f"Name its frame as {file.name}#FRAME."
        )
    link = link or next(iter(found))
    hand, T = found[link]
    return T, hand, link


def _placed(file: Path, place: list[float], turn: list[float]) -> Transforms:
    """Return the pose of a position and a quaternion x, y, z, w or angles yaw, pitch, roll."""
    if len(turn) == 4:
        return _quaternion_pose(file, np.array(place), np.array(turn))
    yaw, pitch, roll = turn
    R = SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)
    return SE3.from_parts(R, np.array(place))


def _quaternion_pose(file: Path, place: np.ndarray, xyzw: np.ndarray) -> Transforms:
    if len(xyzw) != 4 or not np.isfinite([*place, *xyzw]).all() or abs(np.linalg.norm(xyzw) - 1) > 10 * _SKEW:
        raise InputError(
            f"{file}: expected a finite position and a unit quaternion, got {place.tolist()} and {xyzw.tolist()} "
            "(x, y, z, w). Correct it."
        )
    return pose_of(place, xyzw)


def _of_yaml(file: Path, text: str, hand: str, link: str) -> tuple[Transforms, str, str, str]:
    # OpenCV writes a directive that is not valid YAML
    lines = [line for line in text.splitlines() if not line.startswith(("%YAML", "---"))]
    content = load_yaml("\n".join(lines), file)
    if not isinstance(content, Mapping):
        raise InputError(f"{file}: expected a pose of a sensor as YAML, got no keys. Is it the right file?")
    for reader in _YAMLS:
        if (found := reader(file, content, link)) is not None:
            T, own_hand, own_link, words = found
            return T, hand or own_hand, own_link, words
    numbers = [key for key, value in content.items() if isinstance(value, int | float)]
    if numbers and any(str(key).endswith(("_x", "_a", "_joint")) for key in numbers):
        raise InputError(
            f"{file}: expected a pose of a sensor, got offsets of joints as robot_calibration writes them. Use the "
            "calibrated URDF that it writes beside them: --rig calibrated.urdf#LINK."
        )
    raise InputError(
        f"{file}: expected a hand-eye result, a TransformStamped, a camera chain of Kalibr or a matrix "
        f"T_flange_sensor, got keys {', '.join(map(str, list(content)[:6]))}. Write a rig (TOML) with its position and "
        "direction."
    )


_Found = tuple[Transforms, str, str, str]


def _of_handeye(file: Path, content: Mapping[str, Any], link: str) -> _Found | None:
    """Return the result of easy_handeye (1 and 2): the pose of the camera's base frame in the effector's frame."""
    own = content.get("parameters")
    parameters = own if isinstance(own, Mapping) else content
    body = content.get("transformation", content.get("transform"))
    if not isinstance(body, Mapping) or "tracking_base_frame" not in parameters:
        return None
    on_hand = parameters.get("eye_on_hand", parameters.get("calibration_type") in ("eye_in_hand", "eye_on_hand"))
    if not on_hand:
        raise InputError(
            f"{file}: expected a sensor on the hand, got a result of eye-on-base: a sensor beside the robot. Give the "
            "readings in its frame, or its pose as --hand with an identity rig."
        )
    T = _transform(file, body)
    return (
        T,
        str(parameters.get("robot_effector_frame", "hand")),
        str(parameters["tracking_base_frame"]),
        "hand-eye result",
    )


def _of_stamped(file: Path, content: Mapping[str, Any], link: str) -> _Found | None:
    """Return a ``TransformStamped``, or one of a list of them."""
    many = content.get("transforms")
    rows = many if isinstance(many, list) else [content]
    found = {
        str(row["child_frame_id"]): row
        for row in rows
        if isinstance(row, Mapping) and {"child_frame_id", "transform"} <= row.keys()
    }
    if not found:
        return None
    if (link and link not in found) or (not link and len(found) > 1):
        raise InputError(f"{file}: expected one of the frames {', '.join(found)}, got '{link}'. Name it as FILE#FRAME.")
    link = link or next(iter(found))
    header = found[link].get("header")
    parent = header.get("frame_id") if isinstance(header, Mapping) else found[link].get("frame_id")
    return _transform(file, found[link]["transform"]), str(parent or "hand"), link, "TransformStamped"


def _of_kalibr(file: Path, content: Mapping[str, Any], link: str) -> _Found | None:
    """Return a camera of Kalibr's chain: ``T_cam_imu`` maps body to camera, ``T_cn_cnm1`` the one before to it."""
    cameras = {
        key: one for key, one in content.items() if isinstance(one, Mapping) and re.fullmatch(r"cam\d+", str(key))
    }
    if not cameras:
        return None
    link = link or next(iter(cameras))
    if link not in cameras:
        raise InputError(f"{file}: expected one of {', '.join(cameras)}, got '{link}'. Name it as {file.name}#cam0.")
    T, current = np.eye(4), link
    while "T_cam_imu" not in cameras[current]:
        before = f"cam{int(current[3:]) - 1}"
        if "T_cn_cnm1" not in cameras[current] or before not in cameras:
            raise InputError(
                f"{file}: expected T_cam_imu of '{current}' or a chain to a camera that has it, got neither: the chain "
                "relates cameras to each other only. Calibrate with an IMU or the hand, or write a rig (TOML)."
            )
        T, current = T @ _matrix(file, cameras[current]["T_cn_cnm1"]), before
    T_cam_hand = T @ _matrix(file, cameras[current]["T_cam_imu"])
    return SE3.inverse(T_cam_hand), "imu", link, "camera chain of Kalibr"


def _of_matrices(file: Path, content: Mapping[str, Any], link: str) -> _Found | None:
    """Return a matrix of four rows, or a rotation and a translation, whose names state what they map."""
    parts: dict[str, np.ndarray] = {}
    backward = False
    for key, value in content.items():
        rows = value.get("data", value) if isinstance(value, Mapping) else value
        one_way, other = _FORWARD.fullmatch(str(key)), _BACKWARD.fullmatch(str(key))
        if (one_way or other) and isinstance(rows, list):
            try:
                numbers = np.array(rows, dtype=np.float64).ravel()
            except (TypeError, ValueError):
                continue
            name = {16: "T", 9: "R", 3: "t"}.get(len(numbers), "")
            parts[name] = numbers
            backward = backward or other is not None
    if "T" in parts:
        T = _matrix(file, parts["T"].reshape(4, 4))
    elif {"R", "t"} <= parts.keys():
        T = _matrix(file, np.vstack([np.column_stack([parts["R"].reshape(3, 3), parts["t"]]), [0, 0, 0, 1]]))
    else:
        return None
    return (SE3.inverse(T) if backward else T), "hand", link or "sensor", "matrix"


def _of_pose(file: Path, content: Mapping[str, Any], link: str) -> _Found | None:
    """Return a pose without frames: flat ``x`` .. ``qw``, or ``position`` and ``orientation``."""
    body = content.get("pose", content.get("transform", content))
    if not isinstance(body, Mapping) or not (
        {"x", "y", "z", "qw"} <= body.keys() or {"position", "orientation"} <= body.keys()
    ):
        return None
    return _transform(file, body), "hand", link or "sensor", "pose"


_YAMLS: tuple[Callable[[Path, Mapping[str, Any], str], _Found | None], ...] = (
    _of_handeye, _of_stamped, _of_kalibr, _of_matrices, _of_pose,
)  # fmt: skip


def _transform(file: Path, body: Mapping[str, Any]) -> Transforms:
    """Return the pose of a mapping: flat x .. qw, or translation and rotation."""
    place = body.get("translation", body.get("position", body))
    turn = body.get("rotation", body.get("orientation", body))
    try:
        names = ("qx", "qy", "qz", "qw") if "qw" in turn else ("x", "y", "z", "w")
        position, xyzw = [float(place[k]) for k in "xyz"], [float(turn[k]) for k in names]
    except (KeyError, TypeError, ValueError):
        raise InputError(
            f"{file}: expected a transform with x, y, z and a quaternion, got {str(dict(body))[:120]}. Correct it."
        ) from None
    return _quaternion_pose(file, np.array(position), np.array(xyzw))


def _matrix(file: Path, rows: Any) -> Transforms:
    try:
        T = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        T = np.zeros(0)
    good = T.shape == (4, 4) and np.isfinite(T).all() and np.allclose(T[3], [0, 0, 0, 1])
    if not good or np.abs(T[:3, :3].T @ T[:3, :3] - np.eye(3)).max() > _SKEW or np.linalg.det(T[:3, :3]) < 0:
        raise InputError(f"{file}: expected a rigid transform of four rows, got {str(rows)[:120]}. Correct it.")
    return T
