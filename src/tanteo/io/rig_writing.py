"""Write a rig file that :func:`read_rig` reads."""

from __future__ import annotations

import json
import re
from pathlib import Path

from tanteo.io.rig_file import SensorTable
from tanteo.io.schema import toml_lines
from tanteo.replaced import replaced
from tanteo.sensors import Rig

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def write_rig(rig: Rig, path: str | Path, *, comment: str = "") -> None:
    """Write a rig file with lengths in millimetres and angles in degrees.

    Args:
        rig: rig to write.
        path: file to write; replaced if it exists.
        comment: comment lines for the start of the file.

    Raises:
        OSError: the file cannot be written.
    """
    text = rig_text(rig, comment=comment)
    with replaced(path) as file:
        file.write_text(text, encoding="utf-8")


def rig_text(rig: Rig, *, comment: str = "") -> str:
    """Return the text of a rig file.

    Args:
        rig: rig to write.
        comment: comment lines for the start of the file.
    """
    blocks = ["\n".join(f"# {line}".rstrip() for line in comment.splitlines())] if comment else []
    for sensor in rig.sensors:
        name = sensor.name if _BARE.fullmatch(sensor.name) else json.dumps(sensor.name, ensure_ascii=False)
        blocks.append("\n".join([f"[sensors.{name}]", *toml_lines(SensorTable.of(sensor))]))
    return "\n\n".join(blocks) + "\n"
