"""What a person may not expect of the files that were read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from tanteo.parts import FLOAT32, READABLE, UNITLESS, Part

_SINGLE = (".stl", ".glb")
"""Formats whose coordinates are of single precision, as a rule."""

_BLUR = 4e-6
"""How much of rounding is worth a warning [m]."""


def cad_files(paths: Iterable[str | Path]) -> list[Path]:
    """The CAD files in those of the paths that are folders; a folder that may not be read has none."""
    return [file for path in paths for file in _inside(path) if file.suffix.lower() in READABLE]


def skipped_folders(paths: Iterable[str | Path]) -> list[str]:
    """A sentence for each folder in the folders that holds CAD files, which are not read unless it is named, too."""
    paths = list(paths)
    named = {os.path.realpath(path) for path in paths}
    said = []
    for folder in (f for path in paths for f in _inside(path)):
        if os.path.realpath(folder) not in named and (count := len(cad_files([folder]))):
            files = "1 CAD file in it is" if count == 1 else f"{count} CAD files in it are"
            said.append(f"{folder}: {files} not read, as folders in a folder are not looked into. Name it, too.")
    return said


def coarse_meshes(parts: Iterable[Part]) -> Iterator[str]:
    """A sentence for each mesh that is so far from its origin that single precision blurs it."""
    for part in parts:
        far = float(abs(part.box).max())
        if Path(part.source).suffix.lower() in _SINGLE and far * FLOAT32 > _BLUR:
            yield (
                f"{part.source}: it lies {far:.3g} m from its origin, where single precision resolves "
                f"{1e6 * far * FLOAT32:.2g} um, so that faces may break up. Export it near the origin, or as STEP."
            )


def unused_unit(parts: Iterable[Part], unit: str | None) -> list[str]:
    """That the unit that was stated is not that of the files, which all say their own; nothing if it is."""
    parts = list(parts)
    own = sorted({part.unit for part in parts})
    if unit is None or not own or own == [unit] or any(Path(p.source).suffix.lower() in UNITLESS for p in parts):
        return []
    says = "the file says itself that it is" if len(parts) == 1 else "the files say themselves that they are"
    return [f"--units {unit} was not used: {says} in {', '.join(own)}."]


def _inside(path: str | Path) -> list[Path]:
    """What is in a folder, in order; nothing where that is none, or one that may not be read."""
    try:
        return sorted(Path(path).iterdir()) if Path(path).is_dir() else []
    except OSError:
        return []
