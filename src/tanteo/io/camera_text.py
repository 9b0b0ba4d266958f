"""Parse the text of a calibration file (YAML, JSON, XML or INI) into one document."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec

from tanteo.errors import InputError, MissingExtraError
from tanteo.io.camera_layouts import is_ini, read_ini, read_xml

_ALIAS, _MOST_ALIASES = re.compile(r"(?:^|[\s\[,:])\*\w", re.MULTILINE), 20
"""Pattern of YAML references, and their largest number: nested references expand exponentially."""


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
        yaml = _yaml()
        if len(_ALIAS.findall(text)) > _MOST_ALIASES:
            raise InputError(
                f"{path}: expected YAML, got more than {_MOST_ALIASES} references (*name). Write them out."
            )
        # OpenCV writes a directive that is not valid YAML
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
    """Return PyYAML's safe loader, extended to read OpenCV's matrices as mappings."""

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        pass

    Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", lambda loader, node: loader.construct_mapping(node, True))
    return Loader
