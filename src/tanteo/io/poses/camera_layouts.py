"""Parse calibration files (YAML, JSON, XML, INI), and convert their layouts to the keys of ROS and OpenCV.

Sources: Kalibr's wiki, "yaml formats" (``cam0``, ``intrinsics`` of a pinhole ``fu fv pu pv``, ``resolution``);
``sensor.yaml`` of EuRoC; OpenCV's FileStorage as XML; ROS ``camera_calibration_parsers`` for the Videre INI format;
``sensor_msgs/CameraInfo`` for binning and region of interest. :data:`DISTORTION` lists the programs whose names of the
distortion are known.
"""

from __future__ import annotations

import difflib
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any
from xml.etree import ElementTree

import msgspec
import numpy as np

from tanteo.errors import InputError, MissingExtraError, install_command
from tanteo.io.documents.schema import show

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
_SIMILAR = 0.85
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
        InputError: a coefficient is not a finite number, two names disagree, or a name resembles a
            distortion but is unknown.
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
        got = _statement_of(str(key), value)
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
    return difflib.SequenceMatcher(None, one, other).ratio() > _SIMILAR


def plain(key: Any) -> str:
    """Return a name in lower case without punctuation.

    Args:
        key: name of a key.
    """
    return re.sub("[^a-z0-9]", "", str(key).lower())


def flat(value: Any) -> Any:
    """Return the numbers of a matrix (OpenCV, ROS or nested lists) as one flat list; other values unchanged.

    Args:
        value: value of a key.
    """
    value = value.get("data") if isinstance(value, Mapping) else value
    return np.array(value, dtype=object).ravel().tolist() if isinstance(value, list) else value


def _statement_of(key: str, value: Any) -> str:
    """Return the usual meaning of a camera-pose name and what to write instead; empty for other names."""
    name = plain(key)
    numbers = flat(value)
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
    """Return whether a text is in the Videre INI format: it has sections and a line ``camera matrix``.

    Args:
        text: content of a file.
    """
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
    row = flat(value)
    return row if isinstance(row, list) else []


def _only_camera(document: Mapping[str, Any], path: Path) -> Mapping[str, Any]:
    """Return the table of the only camera of a Kalibr chain or of a nested file."""
    chain = {k: v for k, v in document.items() if re.fullmatch(r"cam(era)?_?\d+", str(k)) and isinstance(v, Mapping)}
    if len(chain) > 1:
        raise InputError(
            f"{path}: expected one camera, got {show(', '.join(chain))}. Keep the one that took the image."
        )
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


_MOST_ALIASES = 20
"""Largest number of YAML references (``*name``): nested references expand exponentially."""

_MOST_LEVELS = 50
"""Largest depth of nested YAML; calibration files have five levels, and Python's stack ends at about a thousand."""


def parse_document(text: str, path: Path) -> Mapping[str, Any]:
    """Return keys and values of a calibration file.

    Args:
        text: content of the file.
        path: file name for messages.

    Raises:
        InputError: the format is unknown, or the text has no keys and values.
        MissingExtraError: the text is YAML and PyYAML is not installed.
    """
    if is_ini(text):
        return read_ini(text, path)
    if text.lstrip("\ufeff \t\r\n").startswith("<"):
        return read_xml(text, path)
    if text.lstrip().startswith("{"):
        try:
            document = msgspec.json.decode(text)
        except msgspec.DecodeError as error:
            raise InputError(f"{path}: expected JSON, got: {error}. Correct the file.") from None
    else:
        # OpenCV writes a directive that is not valid YAML
        lines = [line for line in text.splitlines() if not line.startswith(("%YAML", "---"))]
        document = load_yaml("\n".join(lines), path)
    if not isinstance(document, Mapping):
        raise InputError(f"{path}: expected keys and values, got other text. Give a calibration file of OpenCV or ROS.")
    return document


def _yaml() -> ModuleType:
    try:
        import yaml
    except ImportError as error:
        raise MissingExtraError(
            f"camera: expected PyYAML to read YAML, got {error}. Run {install_command('vision')}, or give JSON."
        ) from error
    return yaml


def load_yaml(text: str, path: Path) -> Any:
    """Return the document of a YAML text.

    Args:
        text: content of the file.
        path: file, for messages.

    Raises:
        InputError: the text is not YAML, has many references, a key twice, or a value that contradicts its form or
            its tag.
        MissingExtraError: PyYAML is not installed.
    """
    yaml = _yaml()
    try:
        _check_events(yaml, text, path)
        return yaml.load(text, Loader=_loader(yaml))
    except yaml.YAMLError as error:
        got = show(" ".join(str(error).split()), 300)
        raise InputError(f"{path}: expected YAML, got: {got}. Correct the file.") from None
    except (InputError, RecursionError):
        raise
    except Exception as error:  # noqa: BLE001  PyYAML's constructors pass on the errors of int(), float() and date()
        got = show(str(error) or type(error).__name__, 300).rstrip(".")
        raise InputError(f"{path}: expected YAML with plain numbers and texts, got: {got}. Correct the file.") from None


def _check_events(yaml: Any, text: str, path: Path) -> None:
    """Refuse many references and deep nesting, before anything is constructed."""
    references = 0
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        references += isinstance(event, yaml.AliasEvent)
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if references > _MOST_ALIASES:
            raise InputError(
                f"{path}: expected YAML, got more than {_MOST_ALIASES} references (*name). Write them out."
            )
        if depth > _MOST_LEVELS:
            raise InputError(
                f"{path}: expected keys and values, got more than {_MOST_LEVELS} levels of them. Correct the file."
            )


def _loader(yaml: Any) -> Any:
    """Return PyYAML's safe loader, extended to read OpenCV's matrices as mappings and to refuse a key written twice."""

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            keys = [child.value for child, _ in getattr(node, "value", ()) if isinstance(child, yaml.ScalarNode)]
            if twice := next((key for key, count in Counter(keys).items() if count > 1), None):
                mark = node.start_mark
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key '{show(twice)}' twice in the table that starts here", mark
                )
            return super().construct_mapping(node, deep)

    Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", lambda loader, node: loader.construct_mapping(node, True))
    return Loader
