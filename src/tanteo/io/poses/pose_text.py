"""Write the pose of an answer in the language of a robot controller or program.

Numbers are rounded so that the pose read back deviates by less than a hundredth of its standard deviation, and by
less than a micrometre at a distance of one metre. ROS and GTSAM also take the covariance, each in its own convention
(``tanteo.geometry``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import InputError, did_you_mean
from tanteo.geometry import SO3, UncertainFrame, as_ros_covariance
from tanteo.geometry.named import as_gtsam_covariance
from tanteo.io.poses.poses import pose_as_brand, pose_from_brand
from tanteo.io.readings.brands import BRANDS, Brand

if TYPE_CHECKING:
    from tanteo.geometry.typing import FloatArray, Transforms

_MATRICES = ("matrix", "gtsam")

POSE_NAMES = (*BRANDS, *_MATRICES)
"""Names of all controllers and programs that a pose can be written for."""

_SHARE, _LARGEST, _LEAST = 1e-2, 1e-6, 1e-12
"""Rounding tolerance: fraction of one standard deviation; its upper and lower bound [m, rad]."""

_MOST_DIGITS = 15


@dataclass(frozen=True, slots=True)
class WrittenPose:
    """Pose in the syntax of a controller.

    Attributes:
        name: name of the controller.
        text: pose in one or more lines, without a final line break.
        values: numbers in the order of the text, rounded as in the text; for ``matrix`` and ``gtsam`` the matrix, row
            by row.
        units: units of position and rotation, as ``mm deg``.
        verified: whether the convention was read in documentation; otherwise compare one pose on the controller first.
    """

    name: str
    text: str
    values: tuple[float, ...]
    units: str
    verified: bool


def check_pose_name(name: str) -> str:
    """Return the name unchanged if a pose can be written for it.

    Args:
        name: name of a controller or program.

    Raises:
        InputError: the name is unknown; the message names the nearest.
    """
    if name not in POSE_NAMES:
        raise InputError(f"expected one of {', '.join(POSE_NAMES)}, got '{name}'.{did_you_mean(name, POSE_NAMES)}")
    return name


def write_pose(name: str, frame: UncertainFrame, parent: str = "world", stamp: float = math.nan) -> WrittenPose:
    """Return the pose of a frame in the syntax of a controller.

    Args:
        name: one of :data:`POSE_NAMES`.
        frame: pose in its parent frame, with covariance.
        parent: name of the parent frame, for ROS headers.
        stamp: time of the last reading, for ROS headers [s]; NaN if unknown.

    Raises:
        InputError: the name is unknown.

    Example:
        >>> import numpy as np
        >>> from tanteo.geometry import UncertainFrame
        >>> from tanteo.io.poses.pose_text import write_pose
        >>> at = UncertainFrame(np.eye(4), np.diag([1e-8] * 3 + [1e-6] * 3))
        >>> write_pose("kuka", at).text
        '{X 0.000, Y 0.000, Z 0.000, A 0.00000, B 0.00000, C 0.00000}'
    """
    check_pose_name(name)
    if name in _MATRICES:
        rows = _matrix_rows(frame)
        text = _gtsam(rows, frame) if name == "gtsam" else "\n".join(" ".join(row) for row in rows)
        return WrittenPose(name, text, tuple(float(v) for row in rows for v in row), "m", True)
    brand = BRANDS[name]
    fields = brand_fields(name, frame)
    text = brand.syntax.format(*fields) if name != "ros" else _ros(fields, frame, parent, stamp)
    return WrittenPose(name, text, tuple(map(float, fields)), units_of(brand), brand.verified)


def units_of(brand: Brand) -> str:
    """Return the units of a brand's position and rotation, as ``mm deg``.

    Args:
        brand: pose convention.
    """
    turn = {"euler": "rad" if brand.radian == 1 else "deg", "rotation vector": "rad"}.get(brand.rule, "quaternion")
    return f"{'m' if brand.metre == 1 else 'mm'} {turn}"


def brand_fields(name: str, frame: UncertainFrame) -> list[str]:
    """Return the fields of a pose in a brand's convention, with the digits that its standard deviation justifies.

    Args:
        name: name of the brand.
        frame: pose in its parent frame, with covariance.
    """
    brand = BRANDS[name]
    values = pose_as_brand(name, frame.T)
    place, turn = _limits(frame)
    decimals = max(3 if brand.metre < 1 else 6, _decimals(place / brand.metre))
    for of_turn in range(5 if brand.rule == "euler" and brand.radian < 1 else 6, _MOST_DIGITS + 1):
        fields = [f"{v:.{decimals}f}" for v in values[:3]] + [f"{v:.{of_turn}f}" for v in values[3:]]
        if _turned(frame.T, pose_from_brand(name, np.array([float(v) for v in fields]))) <= turn:
            break
    return [_no_minus_zero(field) for field in fields]


def _limits(frame: UncertainFrame) -> tuple[float, float]:
    """Return the rounding tolerances of position [m] and rotation [rad]."""
    sds = (np.sqrt(max(np.linalg.eigvalsh(block)[0], 0.0)) for block in (frame.C[:3, :3], frame.C[3:, 3:]))
    place, turn = (float(np.clip(_SHARE * sd, _LEAST, _LARGEST)) for sd in sds)
    return place, turn


def _decimals(limit: float) -> int:
    """Return the number of decimals that keeps the joint rounding error of three coordinates below a limit."""
    return int(np.ceil(-np.log10(2 * limit / np.sqrt(3))))


def _turned(T: Transforms, other: Transforms) -> float:
    """Return the angle between two poses [rad]."""
    return float(np.linalg.norm(SO3.log(T[:3, :3].T @ other[:3, :3])))


def _no_minus_zero(field: str) -> str:
    return field[1:] if field.startswith("-") and not float(field) else field


def _matrix_rows(frame: UncertainFrame) -> list[list[str]]:
    place, turn = _limits(frame)
    of_turn = _decimals(turn) + 1
    of_place = max(6, _decimals(place))
    rows = [[f"{v:.{of_turn}f}" for v in row[:3]] + [f"{row[3]:.{of_place}f}"] for row in frame.T[:3]]
    return [[_no_minus_zero(v) for v in row] for row in rows] + [["0", "0", "0", "1"]]


def _numbers(values: FloatArray) -> str:
    return ", ".join(f"{v:.9g}" for v in values)


def _gtsam(rows: list[list[str]], frame: UncertainFrame) -> str:
    """Return Python code for GTSAM; the covariance is that of ``xi = (rx, ry, rz, x, y, z)``, right perturbation."""
    return "\n".join(_gtsam_lines(rows, as_gtsam_covariance(frame)))


def _gtsam_lines(rows: list[list[str]], covariance: FloatArray) -> Iterator[str]:
    yield "# metres and radians; covariance of xi = (rx, ry, rz, x, y, z), pose * Pose3.Expmap(xi)"
    yield "import gtsam"
    yield "import numpy as np"
    yield ""
    yield "pose = gtsam.Pose3(np.array(["
    yield from (f"    [{', '.join(row)}]," for row in rows)
    yield "]))"
    yield "covariance = np.array(["
    yield from (f"    [{_numbers(row)}]," for row in covariance)
    yield "])"
    yield "noise = gtsam.noiseModel.Gaussian.Covariance(covariance)"


def _ros(fields: list[str], frame: UncertainFrame, parent: str, stamp: float) -> str:
    """Return a ``geometry_msgs/PoseWithCovarianceStamped`` in YAML.

    Its covariance is along the axes of the header's frame.
    """
    x, y, z, qx, qy, qz, qw = fields
    C = as_ros_covariance(frame).reshape(6, 6)
    seconds, nanoseconds = divmod(0 if math.isnan(stamp) else round(1e9 * stamp), 1_000_000_000)
    return "\n".join(
        [
            "header:",
            f"  stamp: {{sec: {seconds}, nanosec: {nanoseconds}}}",
            f"  frame_id: {parent}",
            "pose:",
            "  pose:",
            f"    position: {{x: {x}, y: {y}, z: {z}}}",
            f"    orientation: {{x: {qx}, y: {qy}, z: {qz}, w: {qw}}}",
            "  covariance: [",
            *(f"    {', '.join(f'{v:.9e}' for v in row)}," for row in C[:-1]),
            f"    {', '.join(f'{v:.9e}' for v in C[-1])}]",
        ]
    )
