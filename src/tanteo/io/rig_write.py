"""Writing rig files that :func:`tanteo.io.read_rig` reads back."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np

from tanteo.lie import SO3
from tanteo.replaced import replaced
from tanteo.sensors import Rig, RigSensor
from tanteo.typing import FloatArray

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def write_rig(rig: Rig, path: str | Path, *, comment: str = "") -> None:
    """Write a rig file, lengths in millimetres and angles in degrees.

    Args:
        rig: What to write.
        path: The file; replaced if it exists.
        comment: Lines for its beginning.

    Raises:
        OSError: The file cannot be written.
    """
    text = rig_text(rig, comment=comment)
    with replaced(path) as file:
        file.write_text(text, encoding="utf-8")


def rig_text(rig: Rig, *, comment: str = "") -> str:
    """The text of a rig file."""
    head = [f"# {line}".rstrip() for line in comment.splitlines()]
    tables = ["\n".join(_table(sensor)) for sensor in rig.sensors]
    return "\n\n".join([*(["\n".join(head)] if head else []), *tables]) + "\n"


def _table(sensor: RigSensor) -> list[str]:
    name = sensor.name if _BARE.fullmatch(sensor.name) else json.dumps(sensor.name, ensure_ascii=False)
    T = sensor.T_hand_sensor
    lines = [f"[sensors.{name}]"]
    if sensor.preset is not None:
        lines.append(f'preset = "{sensor.preset.name}"')
    lines += [
        f"position_mm = {_list(1e3 * T[:3, 3], 10)}",
        f"quaternion_wxyz = {_list(SO3.as_quaternion(T[:3, :3]), 12)}",
    ]
    if sensor.unit:
        lines += [
            f"unit = {json.dumps(sensor.unit, ensure_ascii=False)}",
            f"unit_position_mm = {_list(1e3 * sensor.T_hand_unit[:3, 3], 10)}",
            f"unit_quaternion_wxyz = {_list(SO3.as_quaternion(sensor.T_hand_unit[:3, :3]), 12)}",
        ]
    if sensor.sd > 0:
        lines += [f"sd_mm = {1e3 * sensor.sd:.6g}", f"sd_per_range = {sensor.sd_prop:.6g}"]
    if sensor.axis_cosine < 1:
        lines.append(f"axis = {_list(_axis(sensor))}")
    lines.append(f"beam_half_angle_deg = {math.degrees(sensor.beam_half_angle):.6g}")
    if not math.isnan(sensor.max_range):
        lines.append(f"max_mm = {1e3 * sensor.max_range:.6g}")
    lines.append(f"bias_sd_mm = {1e3 * sensor.bias_sd:.6g}")
    if sensor.bias:
        lines.append(f"bias_mm = {1e3 * sensor.bias:.6g}")
    if sensor.scale:
        lines.append(f"scale = {sensor.scale:.6g}")
    if not math.isnan(sensor.scale_sd):
        lines.append(f"scale_sd = {sensor.scale_sd:.6g}")
    return lines + _covariances(sensor)


def _covariances(sensor: RigSensor) -> list[str]:
    lines = []
    if sensor.cov_mount.any():
        rows = ",\n".join(f"  {_list(row)}" for row in sensor.cov_mount)
        lines.append(f"mount_covariance_m_rad = [\n{rows},\n]")
    if sensor.cov_scale.any():
        lines.append(f"scale_covariance_m_rad = {_list(sensor.cov_scale)}")
    return lines


def _axis(sensor: RigSensor) -> FloatArray:
    """An optical axis at the right angle to the beam; on which side does not matter."""
    c = sensor.axis_cosine
    R = sensor.T_hand_sensor[:3, :3]
    return np.asarray(c * R[:, 2] + math.sqrt(1 - c * c) * R[:, 0])


def _list(values: FloatArray, digits: int = 17) -> str:
    # 17 digits: a covariance must stay positive semidefinite
    return "[" + ", ".join(f"{v:.{digits}g}" if v else "0" for v in np.asarray(values).tolist()) + "]"
