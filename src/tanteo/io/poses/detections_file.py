"""Poses of detectors: read them as JSON, or read and write ``vision_msgs/Detection3DArray`` as JSON (or YAML).

The JSON of this project is a list, or an object with a list ``detections``, of objects with ``part``, ``score``, a pose
(``matrix`` of 4 x 4, or ``position_m`` and ``quaternion_wxyz``) and, if known, ``sd_m`` and ``sd_rad`` about each axis.
Each detection of a ``Detection3DArray`` has one hypothesis or more, whose ``class_id`` is the name of the part.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3, UncertainFrame, as_ros_covariance, from_ros_covariance
from tanteo.geometry.typing import Transforms
from tanteo.io.poses.camera_layouts import load_yaml
from tanteo.parts import read_whole
from tanteo.posterior import Answer, Hypothesis
from tanteo.posterior.detections import Detection
from tanteo.replaced import replaced

_MOST_BYTES = 2_000_000
"""Largest accepted file [bytes]."""


def read_detections(path: str | Path) -> tuple[Detection, ...]:
    """Return the poses of a detector in a file.

    Args:
        path: JSON or YAML file.

    Raises:
        InputError: the file cannot be read, has no detection, or one has no part, score or pose.
        MissingExtraError: the file is YAML and PyYAML is not installed.
    """
    file = Path(path)
    try:
        text = read_whole(file, "detections", _MOST_BYTES).decode()
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected detections as text, got: {error}. Save the file as UTF-8.") from None
    document = load_yaml(text.split("\n---")[0], file)
    rows = document.get("detections") if isinstance(document, Mapping) else document
    if not isinstance(rows, list) or not rows:
        raise InputError(f"{path}: expected a list of detections, got none. Write part, score and pose for each.")
    out = []
    for number, row in enumerate(rows, 1):
        where = f"{path}, detection {number}"
        if not isinstance(row, Mapping):
            raise InputError(f"{where}: expected part, score and pose by name, got {type(row).__name__}.")
        out += list(_of_message(row, where) if "results" in row else _of_row(row, where))
    return tuple(out)


def write_detections(path: str | Path, answers: Sequence[Answer], frame: str) -> None:
    """Write answers as a ``vision_msgs/Detection3DArray`` in JSON, which :func:`read_detections` reads.

    Each object is a detection; its results are the hypotheses, most probable first, with their probabilities as scores.
    The poses are those of the CAD frames, with covariance. The stamp is zero, and the boxes are omitted.

    Args:
        path: file to write.
        answers: one answer for each object.
        frame: name of the frame of the poses (``frame_id``).

    Raises:
        OSError: the file cannot be written.
    """
    header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}
    detections = [
        {"header": header, "results": [_result(h) for h in answer.hypotheses], "id": ""} for answer in answers
    ]
    text = json.dumps({"header": header, "detections": detections}, indent=1) + "\n"
    with replaced(path) as file:
        file.write_text(text, encoding="utf-8")


def _result(h: Hypothesis) -> dict[str, Any]:
    """Return a hypothesis as ``vision_msgs/ObjectHypothesisWithPose``."""
    T = h.T_world_part
    position = dict(zip("xyz", map(float, T[:3, 3]), strict=True))
    orientation = dict(zip("wxyz", map(float, SO3.as_quaternion(T[:3, :3])), strict=True))
    covariance = as_ros_covariance(UncertainFrame(T, h.covariance)).tolist()
    return {
        "hypothesis": {"class_id": h.part, "score": float(h.probability)},
        "pose": {"pose": {"position": position, "orientation": orientation}, "covariance": covariance},
    }


def _of_row(row: Mapping[str, Any], where: str) -> Iterator[Detection]:
    missing = [name for name in ("part", "score") if name not in row]
    if missing:
        raise InputError(f"{where}: expected keys part and score, got {', '.join(map(str, row))}. Add {missing[0]}.")
    covariance = None
    if "sd_m" in row or "sd_rad" in row:
        sds = _numbers([row.get("sd_m"), row.get("sd_rad")], 2, f"{where}, sd_m and sd_rad")
        covariance = np.diag(np.repeat(np.square(sds), 3))
    if "matrix" in row:
        T = _numbers(np.array(row["matrix"], dtype=object).ravel().tolist(), 16, f"{where}, matrix").reshape(4, 4)
    else:
        position = _numbers(row.get("position_m"), 3, f"{where}, position_m")
        T = _pose(position, _numbers(row.get("quaternion_wxyz"), 4, f"{where}, quaternion_wxyz"), where)
    yield Detection(str(row["part"]), _score(row["score"], where), T, covariance)


def _of_message(row: Mapping[str, Any], where: str) -> Iterator[Detection]:
    for one in row["results"] or ():
        try:
            guess = one.get("hypothesis", one)
            name, score = guess.get("class_id", guess.get("id")), guess["score"]
            body = one["pose"]
            pose = body.get("pose", body)
            position = [pose["position"][axis] for axis in "xyz"]
            turn = [pose["orientation"][axis] for axis in "wxyz"]
        except (KeyError, TypeError, AttributeError):
            raise InputError(
                f"{where}: expected results with hypothesis (class_id, score) and pose, as vision_msgs has them, got "
                f"{str(one)[:80]}. Correct it."
            ) from None
        T = _pose(_numbers(position, 3, where), _numbers(turn, 4, where), where)
        numbers = _numbers(list(body.get("covariance", np.zeros(36))), 36, f"{where}, covariance")
        covariance = from_ros_covariance(T, numbers).C if numbers.any() else None
        yield Detection(str(name), _score(score, where), T, covariance)


def _score(value: Any, where: str) -> float:
    return float(_numbers([value], 1, f"{where}, score")[0])


def _pose(position: Any, q: Any, where: str) -> Transforms:
    if abs(float(np.linalg.norm(q)) - 1) > 1e-3:
        raise InputError(f"{where}: expected a quaternion of length 1, got length {np.linalg.norm(q):.4g}. Correct it.")
    return SE3.from_parts(SO3.from_quaternion(q), position)


def _numbers(values: Any, count: int, where: str) -> Any:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise InputError(f"{where}: expected {count} finite numbers, got {str(values)[:60]}. Correct it.")
    return array
