"""Calibration files: cameras as OpenCV (YAML, JSON) and ROS (``camera_info`` YAML) write them (``docs/vision.md``)."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import msgspec
import numpy as np

from tanteo.errors import InputError, MissingExtraError
from tanteo.io.document import made, table
from tanteo.io.schema import Numbers, Place, Table, keys_of
from tanteo.typing import FloatArray
from tanteo.vision import DISTORTION_COUNTS, USUAL_EDGE_SD, Camera

_FISHEYE, _RECTIFY = re.compile("fisheye|equidistant|kannala"), "Rectify the image first."
_MODELS = ("plumb_bob", "rational_polynomial", "")
_ALIKE = 0.85
_OURS = ("T_world_camera", "edge_sd_px")


class CameraTable(Table, frozen=True, kw_only=True, eq=False):
    """What a camera needs of a calibration file, under the names that OpenCV and ROS give it."""

    camera_matrix: Annotated[FloatArray, Numbers("plain", ((9,),), others=("cameraMatrix", "K", "k", "M1"))] | None = (
        None
    )
    distortion_coefficients: Annotated[
        FloatArray, Numbers("plain", (), others=("distCoeffs", "dist_coeffs", "D", "d", "D1"))
    ] = np.zeros(0)
    distortion_model: str = ""
    image_width: Annotated[float, Numbers(others=("width", "imageWidth"))] | None = None
    image_height: Annotated[float, Numbers(others=("height", "imageHeight"))] | None = None
    image_size: Annotated[FloatArray, Numbers("plain", ((2,),))] | None = None
    T_world_camera: Annotated[FloatArray, Numbers("plain", ((16,),))] | None = None
    edge_sd_px: Annotated[float, Numbers()] = USUAL_EDGE_SD

    def camera(self) -> Camera:
        """The camera."""
        if self.camera_matrix is None:
            raise self.at.error("expected a key camera_matrix (OpenCV, ROS) or k, got none. Give a calibration file.")
        if self.distortion_model not in _MODELS:
            raise self.at.refused("distortion_model", "plumb_bob or rational_polynomial", _RECTIFY)
        size = (self.image_width, self.image_height)
        if self.image_width is None and self.image_size is not None:
            size = (float(self.image_size[0]), float(self.image_size[1]))
        if None in size:
            raise self.at.error(
                f"expected image_width and image_height in pixels, got {size[0]!r} and {size[1]!r}. Add them."
            )
        k, more = np.split(self.distortion_coefficients, [max(DISTORTION_COUNTS)])
        if more.any():
            raise self.at.error(f"expected no thin prism and no tilt (k9 to k14), got {more.tolist()}. {_RECTIFY}")
        pose = None if self.T_world_camera is None else self.T_world_camera.reshape(4, 4)
        values = {
            "K": self.camera_matrix.reshape(3, 3),
            "size": tuple(int(v) for v in size if v is not None),
            "T_world_camera": pose,
        }
        more_values = {"distortion": k if k.any() else np.zeros(0), "edge_sd": self.edge_sd_px}
        return made(Camera, values | more_values, str(self.at))


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
    return table(CameraTable, _known(document), Place(str(path))).camera()


def _known(document: Mapping[str, Any]) -> dict[str, Any]:
    """The keys that a camera needs, each once, with their numbers in one row."""
    known: dict[str, tuple[str, Any]] = {}
    for key, (name, _) in keys_of(CameraTable).items():
        if key in document and name not in known:
            value = document[key]
            value = value.get("data") if isinstance(value, Mapping) else value
            known[name] = key, np.array(value, dtype=object).ravel().tolist() if isinstance(value, list) else value
    return dict(known.values())


def _check_keys(document: Mapping[str, Any], path: Path) -> None:
    """Other programs' keys are theirs; one that is nearly ours was meant to be, and a fisheye's says so by its own."""
    for key, value in document.items():
        name = str(key)
        meant = next((k for k in _OURS if name != k and _near(name, k)), None)
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
            document = msgspec.json.decode(text)
        except msgspec.DecodeError as error:
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
