"""Calibration files: cameras as OpenCV (YAML, JSON) and ROS (``camera_info`` YAML) write them (``docs/vision.md``)."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tanteo.errors import InputError, MissingExtraError
from tanteo.typing import FloatArray
from tanteo.vision import COEFFICIENTS, USUAL, Camera

_MATRIX = ("camera_matrix", "cameraMatrix", "K", "k", "M1")
_DISTORTION = ("distortion_coefficients", "distCoeffs", "dist_coeffs", "D", "d", "D1")
_WIDTH, _HEIGHT = ("image_width", "width", "imageWidth"), ("image_height", "height", "imageHeight")
_MODELS = ("plumb_bob", "rational_polynomial", "")
_FISHEYE, _RECTIFY = re.compile("fisheye|equidistant|kannala"), "Rectify the image first."
_ALIKE = 0.85
_POSE, _EXACT = "T_world_camera", "edge_sd_px"


def read_camera(path: str | Path) -> Camera:
    """Read a calibration file.

    Known are the files of OpenCV's calibration programs (``camera_matrix``, ``distortion_coefficients``), ROS
    ``camera_info`` (the file of ``camera_calibration``, or one message as text), and besides theirs two keys:
    ``T_world_camera``, where the camera stands, 4 x 4, metres, and ``edge_sd_px``, by how much lens and calibration
    move a whole edge in the image.

    Args:
        path: The file, YAML or JSON.

    Raises:
        InputError: The file cannot be read, or lacks what a camera needs; the message names file and key.
        MissingExtraError: A YAML file without PyYAML.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> bool(camera.K[0, 0] > 100)
        True
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(f"{path}: expected a calibration file, got: {why}. Check the path.") from None
    document = _parse(text, path)
    _check_keys(document, path)
    K = _array(document, _MATRIX, path, 9)
    if K is None:
        raise InputError(f"{path}: expected a key camera_matrix (OpenCV, ROS) or k, got none. Give a calibration file.")
    distortion = _distortion(document, path)
    pose = _array(document, (_POSE,), path, 16)
    T = None if pose is None else pose.reshape(4, 4)
    said, size = _array(document, (_EXACT,), path, 1), _size(document, path)
    try:
        return Camera(K.reshape(3, 3), size, distortion, T, edge_sd=USUAL if said is None else float(said[0]))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _check_keys(document: Mapping[str, Any], path: Path) -> None:
    """Other programs' keys are theirs; one that is nearly ours was meant to be, and a fisheye's says so by its own."""
    for key, value in document.items():
        name = str(key)
        meant = next((k for k in (_POSE, _EXACT) if name != k and _near(name, k)), None)
        if meant is not None:
            raise InputError(f"{path}: expected a key {meant}, got '{name}'. Correct its name.")
        kind = f"{name} {value}".lower() if "model" in name.lower() else ""
        if _FISHEYE.search(kind) and value not in (0, False, None):
            raise InputError(f"{path}, {name}: expected a lens that is no fisheye, got {value!r}. {_RECTIFY}")


def _near(name: str, key: str) -> bool:
    """Whether a name has the same words in another order, other letters, or another unit."""
    words = (sorted(re.findall("[a-z0-9]+", text.lower())) for text in (name, key))
    one, other = (" ".join(w for w in some if w not in ("px", "mm", "m", "pixels")) for some in words)
    return difflib.SequenceMatcher(None, one, other).ratio() > _ALIKE


def _parse(text: str, path: Path) -> Mapping[str, Any]:
    if text.lstrip().startswith("{"):
        try:
            document = json.loads(text)
        except json.JSONDecodeError as error:
            raise InputError(f"{path}: expected JSON, got: {error}. Correct the file.") from None
    else:
        yaml = _yaml()
        # OpenCV writes a directive that YAML does not know
        lines = [line for line in text.splitlines() if not line.startswith(("%YAML", "---"))]
        try:
            document = yaml.load("\n".join(lines), Loader=_loader(yaml))
        except yaml.YAMLError as error:
            raise InputError(f"{path}: expected YAML, got: {' '.join(str(error).split())}. Correct the file.") from None
    if not isinstance(document, Mapping):
        raise InputError(f"{path}: expected keys and values, got other text. Give a calibration file of OpenCV or ROS.")
    return document


def _yaml() -> ModuleType:
    try:
        import yaml
    except ImportError as error:
        raise MissingExtraError(
            f"camera: expected PyYAML to read YAML, got {error}. Run pip install 'tanteo[vision]', or give JSON."
        ) from error
    return yaml


def _loader(yaml: Any) -> Any:
    """The safe loader, taking OpenCV's matrices for the mappings that they are."""

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        pass

    Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", lambda loader, node: loader.construct_mapping(node, True))
    return Loader


def _array(document: Mapping[str, Any], names: tuple[str, ...], path: Path, size: int | None) -> FloatArray | None:
    """Numbers under the first of the names that is there, flat; None without."""
    name = next((n for n in names if n in document), None)
    if name is None:
        return None
    value = document[name]
    if isinstance(value, Mapping):
        value = value.get("data")
    try:
        out = np.array(value, dtype=np.float64).ravel()
    except (TypeError, ValueError):
        raise InputError(f"{path}, {name}: expected numbers, got {value!r}. Correct the file.") from None
    if size is not None and len(out) != size:
        raise InputError(f"{path}, {name}: expected {size} numbers, got {len(out)}. Correct the file.")
    if not np.all(np.isfinite(out)):
        raise InputError(f"{path}, {name}: expected finite numbers, got {out.tolist()}. Correct the file.")
    return out


def _distortion(document: Mapping[str, Any], path: Path) -> FloatArray:
    model = str(document.get("distortion_model", ""))
    if model not in _MODELS:
        raise InputError(
            f"{path}, distortion_model: expected plumb_bob or rational_polynomial, got {model!r}. {_RECTIFY}"
        )
    found = _array(document, _DISTORTION, path, None)
    k = np.zeros(0) if found is None else found
    k, more = k[: max(COEFFICIENTS)], k[max(COEFFICIENTS) :]
    if more.any():
        raise InputError(f"{path}: expected no thin prism and no tilt (k9 to k14), got {more.tolist()}. {_RECTIFY}")
    return k if k.any() else np.zeros(0)


def _size(document: Mapping[str, Any], path: Path) -> tuple[int, int]:
    width = next((document[n] for n in _WIDTH if n in document), None)
    height = next((document[n] for n in _HEIGHT if n in document), None)
    if width is None and "image_size" in document:
        both = _array(document, ("image_size",), path, 2)
        assert both is not None
        width, height = both
    try:
        return int(width), int(height)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(
            f"{path}: expected image_width and image_height in pixels, got {width!r} and {height!r}. Add them."
        ) from None
