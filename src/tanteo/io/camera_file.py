"""Calibration files: cameras as OpenCV (YAML, JSON) and ROS (``camera_info`` YAML) write them (``docs/vision.md``)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import msgspec
import numpy as np

from tanteo.errors import InputError, MissingExtraError
from tanteo.io.camera_keys import INVERSES, POSES, WRITE_IT, check_place, distortion, flat, near
from tanteo.io.document import made, table
from tanteo.io.schema import Numbers, Place, Table, keys_of
from tanteo.lie import SE3
from tanteo.typing import FloatArray, Transforms
from tanteo.vision import DISTORTION_COUNTS, USUAL_EDGE_SD, Camera, rigid

_FISHEYE, _RECTIFY = re.compile("fisheye|equidistant|kannala"), "Rectify the image first."
_MODELS = ("plumb_bob", "rational_polynomial", "")
_EDGE, _MATRIX = "edge_sd_px", ("cameraMatrix", "mtx", "K", "k", "M1")


class CameraTable(Table, frozen=True, kw_only=True, eq=False):
    """What a camera needs of a calibration file, under the names that OpenCV and ROS give it."""

    camera_matrix: Annotated[FloatArray, Numbers("plain", ((9,),), others=_MATRIX)] | None = None
    distortion_coefficients: Annotated[FloatArray, Numbers("plain", ())] | None = None
    distortion_model: str = ""
    image_width: Annotated[float, Numbers(others=("width", "imageWidth"))] | None = None
    image_height: Annotated[float, Numbers(others=("height", "imageHeight"))] | None = None
    image_size: Annotated[FloatArray, Numbers("plain", ((2,),))] | None = None
    T_world_camera: Annotated[FloatArray, Numbers("plain", ((16,),), others=POSES[1:])] | None = None
    T_camera_world: Annotated[FloatArray, Numbers("plain", ((16,),), others=INVERSES[1:])] | None = None
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
        if self.distortion_coefficients is None:
            raise self.at.error(
                f"expected the distortion of the lens, got none. Write {WRITE_IT}; [0, 0, 0, 0, 0] if the image is "
                "rectified."
            )
        k, more = np.split(self.distortion_coefficients, [max(DISTORTION_COUNTS)])
        if more.any():
            raise self.at.error(f"expected no thin prism and no tilt (k9 to k14), got {more.tolist()}. {_RECTIFY}")
        values = {
            "K": self.camera_matrix.reshape(3, 3),
            "size": tuple(int(v) for v in size if v is not None),
            "T_world_camera": self._place(),
        }
        more_values = {"distortion": k if k.any() else np.zeros(0), "edge_sd": self.edge_sd_px}
        return made(Camera, values | more_values, str(self.at))

    def _place(self) -> Transforms | None:
        """Where the camera stands, by its pose or by the inverse of it."""
        if self.T_camera_world is None:
            return None if self.T_world_camera is None else self.T_world_camera.reshape(4, 4)
        values = {"name": self.at.written["T_camera_world"], "T": self.T_camera_world.reshape(4, 4)}
        return SE3.inverse(made(rigid, values, str(self.at)))


def read_camera(path: str | Path) -> Camera:
    """Read a calibration file.

    Known are the files of OpenCV's calibration programs (``camera_matrix``, ``distortion_coefficients``), ROS
    ``camera_info`` (the file of ``camera_calibration``, or one message as text), other names of the distortion
    (``docs/vision.md``), and besides theirs two keys: ``T_world_camera``, where the camera stands, 4 x 4, metres, or
    its inverse ``T_camera_world``, and ``edge_sd_px``, by how much lens and calibration move a whole edge in the
    image.

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
    return table(CameraTable, _known(document, path), Place(str(path))).camera()


def _known(document: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """The keys that a camera needs, each once, with their numbers in one row."""
    known: dict[str, tuple[str, Any]] = {}
    for key, (name, _) in keys_of(CameraTable).items():
        if key in document and name not in known:
            known[name] = key, flat(document[key])
    lens = distortion(document, path, keys_of(CameraTable))
    return dict(known.values()) | ({} if lens is None else {"distortion_coefficients": lens})


def _check_keys(document: Mapping[str, Any], path: Path) -> None:
    """Other programs' keys are theirs; one that is nearly ours was meant to be, and a fisheye's says so by its own."""
    for key, value in document.items():
        name = str(key)
        if name != _EDGE and near(name, _EDGE):
            raise InputError(f"{path}: expected a key {_EDGE}, got '{name}'. Correct its name.")
        kind = f"{name} {value}".lower() if "model" in name.lower() else ""
        if _FISHEYE.search(kind) and value not in (0, False, None):
            raise InputError(f"{path}, {name}: expected a lens that is no fisheye, got {value!r}. {_RECTIFY}")
    check_place(document, path)


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
