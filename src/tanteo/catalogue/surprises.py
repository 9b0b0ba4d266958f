"""What a person may not expect of the files that were read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from tanteo.parts import FLOAT32, Part, readable_suffixes, unit_name

_SINGLE = (".stl", ".glb")
"""Formats whose coordinates are of single precision, as a rule."""

_BLUR = 4e-6
"""How much of rounding is worth a warning [m]."""


def cad_files(paths: Iterable[str | Path]) -> list[Path]:
    """The CAD files in those of the paths that are folders; a folder that may not be read has none."""
    readable = readable_suffixes()
    return [file for path in paths for file in _inside(path) if file.suffix.lower() in readable]


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
    """That a stated unit is not that of files which say their own, as others need it; nothing if it is."""
    if unit is None:
        return []
    other = [part for part in parts if part.unit != unit_name(unit)]
    said = ", ".join(f"{part.source} in {part.unit}" for part in other[:5]) + (", ..." if len(other) > 5 else "")
    return [f"--units {unit} is of the files that say no unit; others are as they say: {said}."] if other else []


def repaired(parts: Iterable[Part]) -> Iterator[str]:
    """What was repaired, left out or taken otherwise, for each part whose surface is not just what its file says."""
    for part in parts:
        if any(not any(word in said for word in _HARMLESS) for said in part.repairs):
            yield f"{part.source}: {' '.join(part.repairs)}"


_HARMLESS = (
    "no area", "corners coincide", "duplicate", "winding of the triangles", "no point moved", "Made a solid",
    "Made solids", "Meshed a solid",
)  # fmt: skip
"""In sentences about what changes no surface; ``tanteo part show`` says those, too."""


def _inside(path: str | Path) -> list[Path]:
    """What is in a folder, in order; nothing where that is none, or one that may not be read."""
    try:
        return sorted(Path(path).iterdir()) if Path(path).is_dir() else []
    except OSError:
        return []
