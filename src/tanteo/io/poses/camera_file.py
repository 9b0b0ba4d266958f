"""Read calibration files of OpenCV (YAML, XML, JSON), ROS (``camera_info`` YAML, INI) and Kalibr.

``docs/vision.md`` describes them; ``camera_layouts`` converts all layouts to one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray, Transforms
from tanteo.io.documents.document import made, table
from tanteo.io.documents.schema import Numbers, Place, Table, keys_of, show
from tanteo.io.poses.camera_layouts import (
    INVERSES,
    POSES,
    WRITE_IT,
    check_place,
    distortion,
    flat,
    near,
    one_layout,
    parse_document,
    plain,
    region,
)
from tanteo.parts import read_whole
from tanteo.vision import Camera
from tanteo.vision.camera import DISTORTION_COUNTS, USUAL_EDGE_SD, rigid

_FISHEYE = re.compile(r"fisheye|equidistant|kannala|\bomni|\bmei\b|\beucm\b|\bds\b|\bunified\b|\bfov\b")
_RECTIFY = "Undistort the image first, and read it with the projection matrix of that (--rectified)."
_MODELS = ("plumbbob", "rationalpolynomial", "radtan", "radialtangential", "opencv", "brown", "none", "pinhole", "")
_MOST_SKEW = 1.0
"""Largest displacement by skew at the border of the image that is accepted as noise [px]."""
_MOST_BYTES = 2_000_000
"""Largest accepted calibration file [bytes], including the points of all images; larger YAML takes seconds to parse."""

_EDGE, _MATRIX = "edge_sd_px", ("cameraMatrix", "mtx", "K", "k", "M1", "intrinsic_matrix", "camera_intrinsic")
_OF_RECTIFIED = ("projection_matrix", "rectification_matrix")


class CameraTable(Table, frozen=True, kw_only=True, eq=False):
    """Camera entries of a calibration file, under the names that OpenCV and ROS give them."""

    camera_matrix: Annotated[FloatArray, Numbers("plain", ((9,),), others=_MATRIX)] | None = None
    distortion_coefficients: Annotated[FloatArray, Numbers("plain", ())] | None = None
    distortion_model: str = ""
    projection_matrix: Annotated[FloatArray, Numbers("plain", ((12,), (9,)), others=("P", "p"))] | None = None
    rectification_matrix: Annotated[FloatArray, Numbers("plain", ((9,),), others=("R", "r"))] | None = None
    image_width: Annotated[float, Numbers(others=("width", "imageWidth"))] | None = None
    image_height: Annotated[float, Numbers(others=("height", "imageHeight"))] | None = None
    image_size: Annotated[FloatArray, Numbers("plain", ((2,),))] | None = None
    T_world_camera: Annotated[FloatArray, Numbers("plain", ((16,),), others=POSES[1:])] | None = None
    T_camera_world: Annotated[FloatArray, Numbers("plain", ((16,),), others=INVERSES[1:])] | None = None
    edge_sd_px: Annotated[float, Numbers()] = USUAL_EDGE_SD

    def camera(self, document: Mapping[str, Any], rectified: bool, shape: tuple[int, ...] | None) -> Camera:
        """Return the camera of the raw or the rectified image.

        Args:
            document: all keys of the file, for binning and region of interest.
            rectified: whether the image is rectified.
            shape: rows and columns of the image, used if the file has no size.

        Raises:
            InputError: a key is missing or invalid.
        """
        notes: list[str] = []
        size = self._size(shape, notes)
        K = self._matrix(rectified, notes)
        bins, offset, part = region(document)
        size = part or size
        K[:2, 2] -= offset
        K[:2] /= np.array(bins)[:, None]
        skew = K[0, 1] * size[1] / (bins[1] * K[1, 1]) if K[1, 1] > 0 else 0.0
        if abs(skew) > 2 * _MOST_SKEW:
            raise self.at.error(
                f"camera_matrix: expected a skew that moves nothing by more than {_MOST_SKEW:g} px, got {K[0, 1]:g}, "
                f"which moves the rim by {abs(skew) / 2:.2g} px. Calibrate without skew, or undistort the image and "
                "say --rectified."
            )
        edge_sd = self.edge_sd_px
        if skew:
            edge_sd = float(np.hypot(edge_sd, abs(skew) / np.sqrt(12)))
            K[0, 1] = 0.0
            notes.append(
                f"the skew of the camera matrix is ignored: it displaces no pixel by more than {abs(skew) / 2:.2g} px, "
                f"which is added to the noise of edges (edge_sd_px {edge_sd:.2g})."
            )
        values = {
            "K": K,
            "size": tuple(int(v / b) for v, b in zip(size, bins, strict=True)),
            "T_world_camera": self._rectified_place() if rectified else self._place(),
        }
        more = {"distortion": self._lens(rectified), "edge_sd": edge_sd, "notes": tuple(notes)}
        return made(Camera, values | more, str(self.at))

    def _size(self, shape: tuple[int, ...] | None, notes: list[str]) -> tuple[float, float]:
        """Return width and height of the image [px]."""
        width = self.image_width
        height = self.image_height
        if width is None and self.image_size is not None:
            return float(self.image_size[0]), float(self.image_size[1])
        if width is not None and height is not None:
            return width, height
        if shape is None or (width, height) != (None, None):
            raise self.at.error(
                f"expected image_width and image_height in pixels, got {show(width)} and {show(height)}. Add them."
            )
        notes.append(
            f"the camera file has no image size: it is taken as of {shape[1]} x {shape[0]} pixels, as the image."
        )
        return float(shape[1]), float(shape[0])

    def _matrix(self, rectified: bool, notes: list[str]) -> FloatArray:
        """Return the camera matrix ``K`` ``(3, 3)`` of the image."""
        if rectified and self.projection_matrix is not None and self.projection_matrix.any():
            return self.projection_matrix.reshape(3, -1)[:, :3].copy()
        if self.camera_matrix is None:
            raise self.at.error(
                "expected a key camera_matrix (OpenCV, ROS), k, or intrinsics (Kalibr; fx, fy, cx, cy), got none. Give "
                "a calibration file."
            )
        if rectified:
            notes.append(
                "the camera file has no projection_matrix: camera_matrix is taken as that of the rectified image."
            )
        return self.camera_matrix.reshape(3, 3).copy()

    def _lens(self, rectified: bool) -> FloatArray:
        """Return the distortion coefficients of the image."""
        if rectified:
            return np.zeros(0)
        model = plain(self.distortion_model)
        k = self.distortion_coefficients
        if model not in _MODELS:
            raise self.at.refused("distortion_model", "plumb_bob, rational_polynomial, radtan or none", _RECTIFY)
        if model == "none" and (k is None or not k.any()):
            return np.zeros(0)
        if model == "none":
            raise self.at.error("expected no distortion of the model 'none', got some. Say plumb_bob, or write zeros.")
        if k is None:
            raise self.at.error(
                f"expected the distortion of the lens, got none. Write {WRITE_IT}; [0, 0, 0, 0, 0] if the image is "
                "rectified, or say --rectified."
            )
        k, more = np.split(k, [max(DISTORTION_COUNTS)])
        if more.any():
            raise self.at.error(
                f"expected no thin prism and no tilt (k9 to k14), got {show(more.tolist())}. {_RECTIFY}"
            )
        return k if k.any() else np.zeros(0)

    def _rectified_place(self) -> Transforms | None:
        """Return the pose of the rectified camera, whose axes are rotated by ``rectification_matrix``."""
        T = self._place()
        R = self.rectification_matrix
        if T is None or R is None or not R.any():
            return T
        turn = SE3.from_parts(R.reshape(3, 3).T, np.zeros(3))
        return np.asarray(T @ turn)

    def _place(self) -> Transforms | None:
        """Return the camera's pose in the world, from the pose or from its inverse."""
        if self.T_camera_world is None:
            return None if self.T_world_camera is None else self.T_world_camera.reshape(4, 4)
        values = {"name": self.at.written["T_camera_world"], "T": self.T_camera_world.reshape(4, 4)}
        return SE3.inverse(made(rigid, values, str(self.at)))


def read_camera(path: str | Path, *, rectified: bool = False, shape: tuple[int, ...] | None = None) -> Camera:
    """Read a camera calibration file.

    Supported are the files of OpenCV's calibration programs (``camera_matrix``, ``distortion_coefficients``; YAML, XML
    and JSON), ROS ``camera_info`` (the file of ``camera_calibration``, YAML or INI, or one message as text, with
    binning and region of interest), Kalibr's ``camchain.yaml`` of one pinhole camera, and ``intrinsics`` with ``fx fy
    cx cy``. ``docs/vision.md`` lists other names of the distortion. Two keys are added to theirs: ``T_world_camera``,
    the camera's pose (4 x 4, metres), or its inverse ``T_camera_world``; and ``edge_sd_px``, the standard deviation of
    a whole edge in the image from lens and calibration errors.

    Args:
        path: calibration file, YAML, XML, JSON or INI.
        rectified: whether the image is rectified. Then ``projection_matrix`` is used without distortion, or
            ``camera_matrix`` if the file has none.
        shape: rows and columns of the image, for a file without size; the camera's ``notes`` report its use.

    Raises:
        InputError: the file cannot be read, or lacks a required key; the message names file and key.
        MissingExtraError: the file is YAML and PyYAML is not installed.

    Example:
        >>> camera = tanteo.read_camera("images/camera.yaml")
        >>> bool(camera.K[0, 0] > 100)
        True
    """
    path = Path(path)
    try:
        parsed = parse_document(read_whole(path, "a calibration file", _MOST_BYTES).decode(), path)
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a calibration file, got: {error}. Save it as UTF-8.") from None
    except RecursionError:
        raise InputError(
            f"{path}: expected keys and values, got a thousand levels of them. Correct the file."
        ) from None
    document = one_layout(parsed, path, ("camera_matrix", *_MATRIX))
    if not rectified:
        _check_keys(document, path)
    check_place(document, path)
    return table(CameraTable, _known(document, path, rectified), Place(str(path))).camera(document, rectified, shape)


def _known(document: Mapping[str, Any], path: Path, rectified: bool) -> dict[str, Any]:
    """Return the camera keys, each once, with matrices flattened to lists."""
    known: dict[str, tuple[str, Any]] = {}
    for key, (name, _) in keys_of(CameraTable).items():
        if key in document and name not in known and (rectified or name not in _OF_RECTIFIED):
            known[name] = key, flat(document[key])
    lens = None if rectified else distortion(document, path, keys_of(CameraTable))
    return dict(known.values()) | ({} if lens is None else {"distortion_coefficients": lens})


def _check_keys(document: Mapping[str, Any], path: Path) -> None:
    """Refuse fisheye models and misspelt keys of this project; ignore the keys of other programs."""
    for key, value in document.items():
        name = str(key)
        if name != _EDGE and near(name, _EDGE):
            raise InputError(f"{path}: expected a key {_EDGE}, got '{name}'. Correct its name.")
        kind = f"{name} {value}".lower() if "model" in name.lower() else ""
        if _FISHEYE.search(kind) and value not in (0, False, None):
            raise InputError(f"{path}, {name}: expected a pinhole lens, got the fisheye model {value!r}. {_RECTIFY}")
