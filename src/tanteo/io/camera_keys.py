"""Recognize the names that programs use for lens distortion and camera poses, and which of them mean the inverse."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.io.schema import show

DISTORTION: Mapping[str, str] = MappingProxyType(
    {
        "distortioncoefficients": "OpenCV's calibration sample (C++); ROS camera_calibration",
        "distortioncoefficient": "the same in the singular",
        "distcoeffs": "the argument of OpenCV: distCoeffs, dist_coeffs, DistCoeffs",
        "distcoeff": "scripts after OpenCV's Python tutorial: dist_coeff beside camera_matrix",
        "distcoefs": "OpenCV's samples/python/calibrate.py: dist_coefs",
        "distcoef": "the same in the singular",
        "dist": "OpenCV's Python tutorial: mtx, dist",
        "distortion": "scripts after it",
        "distortions": "caliscope, aniposelib",
        "distortioncoeffs": "Kalibr",
        "distortioncoeff": "the same in the singular",
        "distortioncoefs": "scripts after OpenCV's samples",
        "distortioncoef": "the same in the singular",
        "distortionparameters": "camodocal, VINS-Mono: a table of k1, k2, p1, p2",
        "distortionparams": "the same, shortened",
        "d": "ROS camera_info: D (1), d (2)",
        "d1": "OpenCV's stereo sample: M1, D1",
    }
)
"""Known names of the distortion, in lower case without punctuation, and the programs that write them."""

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "taux", "tauy")
"""Names of single distortion coefficients, in OpenCV's order."""

WRITE_IT = "distortion_coefficients: [k1, k2, p1, p2, k3], in this order (OpenCV's)"
"""Correct form of a distortion entry, for messages."""

POSES = ("T_world_camera", "T_world_cam")
INVERSES = ("T_camera_world", "T_cam_world")

_COUNTS = (4, 5, 8, 14)
_STRANGE = re.compile("(?<!un)dist(?!anc|rib)")
_ALIKE = 0.85
_VECTORS = ("rvec", "tvec", "rotationvector", "translationvector")
_WORLD_TO_CAMERA = ("worldtocamera", "worldtocam", "world2camera", "world2cam", "w2c", "tcw", "viewmatrix")
_CAMERA_TO_WORLD = ("cameratoworld", "camtoworld", "camera2world", "cam2world", "c2w", "twc")
_EXTRINSICS = ("extrinsic", "extrinsics", "extrinsicmatrix", "extrinsicsmatrix", "cameraextrinsics")


def distortion(document: Mapping[str, Any], path: Path, known: Mapping[str, Any]) -> list[float] | None:
    """Return the distortion coefficients in OpenCV's order, from any known name; None if the file has none.

    Args:
        document: keys and values of the file.
        path: file name for messages.
        known: keys that are reserved for other entries.

    Raises:
        InputError: a coefficient is not a finite number, two names disagree, or a name looks like an unknown
            distortion.
    """
    given: dict[str, list[float]] = {}
    for key, value in document.items():
        if plain(key) in DISTORTION:
            given[str(key)] = _coefficients(str(key), value, path)
        elif _STRANGE.search(str(key).lower()) and key not in known and _has_numbers(value):
            raise InputError(
                f"{path}, {show(key)}: expected the distortion under a known name, got '{show(key)}'. "
                f"Write {WRITE_IT}; if it is no distortion, leave it out."
            )
    loose = {str(key): value for key, value in document.items() if plain(key) in COEFFICIENTS and _is_number(value)}
    if any(plain(key) == "k1" for key in loose):
        given[", ".join(loose)] = _named(loose)
    for (one, first), (other, second) in pairwise(given.items()):
        n = max(len(first), len(second))
        if first + [0.0] * (n - len(first)) != second + [0.0] * (n - len(second)):
            raise InputError(f"{path}: expected one distortion, got {one} and {other} with other numbers. Keep one.")
    return max(given.values(), key=len) if given else None


def check_place(document: Mapping[str, Any], path: Path) -> None:
    """Refuse entries that may be a camera pose or its inverse under an ambiguous name.

    Args:
        document: keys and values of the file.
        path: file name for messages.

    Raises:
        InputError: such a key exists; the message states its usual meaning and the key to write.
    """
    given = [key for key in (*POSES, *INVERSES) if key in document]
    if len(given) > 1:
        raise InputError(f"{path}: expected the camera's place once, got {' and '.join(given)}. Keep one.")
    if given:
        return
    for key, value in document.items():
        got = _said_of(str(key), value)
        if got:
            raise InputError(
                f"{path}, {key}: expected a key T_world_camera (4 x 4, metres: the camera's pose, which takes points "
                f"of the camera to the world) or T_camera_world (its inverse), got '{key}'{got}."
            )


def near(name: str, key: str) -> bool:
    """Return whether a name is nearly a key: the same words in another order, other spelling, or another unit.

    Args:
        name: name found in a file.
        key: correct key.
    """
    words = (sorted(re.findall("[a-z0-9]+", text.lower())) for text in (name, key))
    one, other = (" ".join(w for w in some if w not in ("px", "mm", "m", "pixels")) for some in words)
    return difflib.SequenceMatcher(None, one, other).ratio() > _ALIKE


def plain(key: Any) -> str:
    """Return a name in lower case without punctuation."""
    return re.sub("[^a-z0-9]", "", str(key).lower())


def flat(value: Any) -> Any:
    """Return the numbers of a matrix (OpenCV, ROS or nested lists) as one flat list; other values unchanged."""
    value = value.get("data") if isinstance(value, Mapping) else value
    return np.array(value, dtype=object).ravel().tolist() if isinstance(value, list) else value


def _said_of(key: str, value: Any) -> str:
    """Return the usual meaning of a camera-pose name and what to write instead; empty for other names."""
    name, numbers = plain(key), flat(value)
    bare = name[1:] if name.startswith("t") and name[1:] in (*_WORLD_TO_CAMERA, *_CAMERA_TO_WORLD) else name
    if name in _VECTORS and isinstance(numbers, list) and len(numbers) == 3:
        return (
            " as of solvePnP, which is the inverse: it takes points of the world to the camera. Write T_camera_world: "
            "the rotation of rvec (cv2.Rodrigues) beside tvec in metres, 0 0 0 1 below; or leave it out"
        )
    if bare in _WORLD_TO_CAMERA and _has_numbers(value):
        return ", the inverse: it takes points of the world to the camera. Name it T_camera_world, or leave it out"
    if bare in _CAMERA_TO_WORLD and _has_numbers(value):
        return ", which takes points of the camera to the world. Name it T_world_camera, or leave it out"
    if name in _EXTRINSICS and _has_numbers(value):
        return (
            ", mostly the inverse: it takes points of the world to the camera. If so, name it T_camera_world; if it is "
            "the camera's pose, T_world_camera; or leave it out"
        )
    both = "world" in name and "cam" in name and isinstance(numbers, list) and len(numbers) in (12, 16)
    return ", which may be either. Name it as what it is, or leave it out" if both or near(key, POSES[0]) else ""


def _coefficients(key: str, value: Any, path: Path) -> list[float]:
    if isinstance(value, Mapping) and "data" not in value:
        strange = [str(k) for k, v in value.items() if plain(k) not in COEFFICIENTS or not _is_number(v)]
        if strange or not value:
            got = f"'{show(strange[0])}'" if strange else "an empty table"
            raise InputError(f"{path}, {key}: expected coefficients k1, k2, p1, p2, k3, got {got}. Write {WRITE_IT}.")
        return _named(value)
    numbers = flat(value)
    if not isinstance(numbers, list) or not all(map(_is_number, numbers)):
        raise InputError(f"{path}, {key}: expected finite numbers in a row, got {show(value)}. Write {WRITE_IT}.")
    return [float(number) for number in numbers]


def _named(values: Mapping[Any, float]) -> list[float]:
    """Return coefficients given by name as a list in OpenCV's order, with zeros where one is missing."""
    by_name = {plain(key): float(value) for key, value in values.items()}
    last = max(COEFFICIENTS.index(name) for name in by_name)
    return [by_name.get(name, 0.0) for name in COEFFICIENTS[: next(n for n in _COUNTS if n > last)]]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _has_numbers(value: Any) -> bool:
    return _is_number(value) or (isinstance(value, list | Mapping) and len(value) > 0)
