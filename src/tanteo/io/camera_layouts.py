"""Convert the layouts of calibration files to one: keys and values as ROS and OpenCV name them.

Sources: Kalibr's wiki, "yaml formats" (``cam0``, ``intrinsics`` of a pinhole ``fu fv pu pv``, ``resolution``);
``sensor.yaml`` of EuRoC; OpenCV's FileStorage as XML; ROS ``camera_calibration_parsers`` for the Videre INI format;
``sensor_msgs/CameraInfo`` for binning and region of interest.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from tanteo.errors import InputError
from tanteo.io.camera_keys import flat as flat_numbers
from tanteo.io.camera_keys import plain

_SECTION = re.compile(r"^\s*\[([^\]]*)\]\s*$")
_NUMBERS = re.compile(r"^[-+.\deE\s,]+$")
_INI = {"cameramatrix": "camera_matrix", "distortion": "distortion_coefficients", "projection": "projection_matrix",
        "rectification": "rectification_matrix", "width": "image_width", "height": "image_height"}  # fmt: skip
_FOCAL = (
    ("fx", "fu", "focallengthx"),
    ("fy", "fv", "focallengthy"),
    ("cx", "pu", "ppx", "u0"),
    ("cy", "pv", "ppy", "v0"),
)
_SINGLE = ("image_width", "image_height")


def is_ini(text: str) -> bool:
    """Return whether a text is in the Videre INI format: it has sections and a line ``camera matrix``."""
    lines = text.splitlines()
    return any(map(_SECTION.match, lines)) and any(plain(line) == "cameramatrix" for line in lines)


def read_ini(text: str, path: Path) -> dict[str, Any]:
    """Return keys and values of a Videre INI file, where each name stands on its own line above its numbers.

    Args:
        text: content of the file.
        path: file name for messages.

    Raises:
        InputError: the file describes two cameras.
    """
    found: dict[str, list[Any]] = {}
    name = ""
    for line in (line.split("#")[0].strip() for line in text.splitlines()):
        if _SECTION.match(line):
            name = ""
        elif line and _NUMBERS.match(line):
            found.setdefault(name, []).extend(_number(word) for word in line.replace(",", " ").split())
        elif line:
            name = _INI.get(plain(line), "")
            if name in found:
                raise InputError(f"{path}: expected one camera, got '{line}' twice. Keep the lines of one.")
    return {key: values[0] if key in _SINGLE else values for key, values in found.items() if key}


def read_xml(text: str, path: Path) -> dict[str, Any]:
    """Return keys and values of an OpenCV XML file.

    Args:
        text: content of the file.
        path: file name for messages.

    Raises:
        InputError: the text is not XML, declares a document type, or has another root element.
    """
    if "<!" in re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL):
        raise InputError(f"{path}: expected the XML of OpenCV, got a document type of its own. Leave it out.")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: expected XML, got: {error}. Correct the file.") from None
    if root.tag != "opencv_storage":
        raise InputError(f"{path}: expected <opencv_storage> of OpenCV, got <{root.tag}>. Give such a file, or YAML.")
    return {child.tag: _xml_value(child) for child in root}


def _xml_value(node: ElementTree.Element) -> Any:
    data = node.find("data")
    if data is not None:
        return [_number(word) for word in (data.text or "").split()]
    if len(node):
        return {child.tag: _xml_value(child) for child in node}
    words = (node.text or "").split()
    return _number(words[0]) if len(words) == 1 else [_number(word) for word in words] or ""


def _number(word: str) -> Any:
    try:
        return float(word)
    except ValueError:
        return word.strip('"')


def one_layout(document: Mapping[str, Any], path: Path, names: Iterable[str]) -> dict[str, Any]:
    """Return a document with the camera's keys at the top level, unpacked from ``cam0`` and from ``intrinsics``.

    Args:
        document: keys and values of the file.
        path: file name for messages.
        names: names of a camera matrix; if one is present, ``intrinsics`` are ignored.

    Raises:
        InputError: the file has several cameras, or a Kalibr camera that is not a pinhole.
    """
    flat = dict(_only_camera(document, path))
    if "resolution" in flat and isinstance(flat["resolution"], list):
        flat.setdefault("image_size", flat.pop("resolution"))
    for old, new in (
        ("Camera_Matrix", "camera_matrix"),
        ("image_Width", "image_width"),
        ("image_Height", "image_height"),
    ):
        if old in flat:
            flat.setdefault(new, flat.pop(old))
    if len(_in_a_row(flat.get("intrinsics"))) == 9:
        flat.setdefault("camera_matrix", flat.pop("intrinsics"))
    if not any(name in flat for name in names):
        four = _four(flat, path)
        if four is not None:
            fx, fy, cx, cy = four
            flat["camera_matrix"] = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    return flat


def _in_a_row(value: Any) -> list[Any]:
    row = flat_numbers(value)
    return row if isinstance(row, list) else []


def _only_camera(document: Mapping[str, Any], path: Path) -> Mapping[str, Any]:
    """Return the table of the only camera of a Kalibr chain or of a nested file."""
    chain = {k: v for k, v in document.items() if re.fullmatch(r"cam(era)?_?\d+", str(k)) and isinstance(v, Mapping)}
    if len(chain) > 1:
        raise InputError(f"{path}: expected one camera, got {', '.join(chain)}. Keep the one that took the image.")
    if chain:
        return next(iter(chain.values()))
    tables = [v for v in document.values() if isinstance(v, Mapping) and "data" not in v]
    inside = [v for v in tables if any(plain(key) in ("cameramatrix", "intrinsics") for key in v)]
    return {**document, **inside[0]} if len(inside) == 1 else document


def _four(flat: dict[str, Any], path: Path) -> list[Any] | None:
    """Return focal lengths and principal point from ``intrinsics`` or single keys."""
    given = flat.get("intrinsics")
    if isinstance(given, list) and all(isinstance(v, int | float) for v in given):
        model = str(flat.get("camera_model", "pinhole"))
        if len(given) != 4 or model != "pinhole":
            raise InputError(
                f"{path}, intrinsics: expected fx, fy, cx, cy of camera_model pinhole, got {len(given)} numbers of "
                f"'{model}'. Undistort the image first."
            )
        return list(given)
    source = given if isinstance(given, Mapping) else flat
    by_name = {plain(key): value for key, value in source.items()}
    found = [next((by_name[name] for name in names if name in by_name), None) for names in _FOCAL]
    if isinstance(given, Mapping):
        flat |= {str(k): v for k, v in given.items() if plain(k) not in {n for names in _FOCAL for n in names}}
    return None if None in found else found


def region(document: Mapping[str, Any]) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float] | None]:
    """Return binning, offset and size of the region of interest of a ``CameraInfo`` message.

    Args:
        document: keys and values of the message.

    Returns:
        Binning (x, y), offset [px], and size [px], which is None for the whole image.
    """
    bins = tuple(max(float(_whole(document.get(f"binning_{axis}"))), 1.0) for axis in "xy")
    roi = document.get("roi")
    table = roi if isinstance(roi, Mapping) else {}
    offset, size = (tuple(float(_whole(table.get(key))) for key in keys) for keys in _ROI)
    return (bins[0], bins[1]), (offset[0], offset[1]), (size[0], size[1]) if min(size) > 0 else None


_ROI = ("x_offset", "y_offset"), ("width", "height")


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) and value >= 0 else 0
