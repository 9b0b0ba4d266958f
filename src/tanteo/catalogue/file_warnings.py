"""Warn about unexpected properties of the files that were read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from tanteo.parts import Part
from tanteo.parts.faces import FLOAT32
from tanteo.parts.readers import readable_suffixes, unit_name

_SINGLE = (".stl", ".glb")
"""Formats that usually have coordinates in single precision."""

_BLUR = 4e-6
"""Rounding error of coordinates above which a warning is given [m]."""


def cad_files(paths: Iterable[str | Path]) -> list[Path]:
    """Return the CAD files in those paths that are readable folders.

    Args:
        paths: files and folders.
    """
    readable = readable_suffixes()
    return [file for path in paths for file in _inside(path) if file.suffix.lower() in readable]


def skipped_folders(paths: Iterable[str | Path]) -> list[str]:
    """Return a warning for each subfolder with CAD files, which are read only if the subfolder is named.

    Args:
        paths: files and folders that were named.
    """
    paths = list(paths)
    named = {os.path.realpath(path) for path in paths}
    warnings = []
    for folder in (f for path in paths for f in _inside(path)):
        if os.path.realpath(folder) not in named and (count := len(cad_files([folder]))):
            files = "1 CAD file in it is" if count == 1 else f"{count} CAD files in it are"
            warnings.append(f"{folder}: {files} not read, because subfolders are not searched. Name it, too.")
    return warnings


def coarse_meshes(parts: Iterable[Part]) -> Iterator[str]:
    """Yield a warning for each mesh so far from its origin that single precision distorts it.

    Args:
        parts: parts that were read.
    """
    for part in parts:
        far = float(abs(part.box).max())
        if Path(part.source).suffix.lower() in _SINGLE and far * FLOAT32 > _BLUR:
            yield (
                f"{part.source}: it lies {far:.3g} m from its origin, where single precision resolves "
                f"{1e6 * far * FLOAT32:.2g} um, so that faces may break up. Export it near the origin, or as STEP."
            )


def unused_unit(parts: Iterable[Part], unit: str | None) -> list[str]:
    """Return a warning if the stated unit does not apply to files that state their own; empty otherwise.

    Args:
        parts: parts that were read.
        unit: unit that the user stated; None if not stated.
    """
    if unit is None:
        return []
    other = [part for part in parts if part.unit != unit_name(unit)]
    listed = ", ".join(f"{part.source} in {part.unit}" for part in other[:5]) + (", ..." if len(other) > 5 else "")
    return [f"--units {unit} applies to files without a unit. Others keep their own: {listed}."] if other else []


def repaired(parts: Iterable[Part]) -> Iterator[str]:
    """Yield the repairs of each part whose surface differs from the file's content.

    Args:
        parts: parts that were read.
    """
    for part in parts:
        if any(not any(word in repair for word in _HARMLESS) for repair in part.repairs):
            yield f"{part.source}: {' '.join(part.repairs)}"


_HARMLESS = (
    "no area", "corners coincide", "duplicate", "winding of the triangles", "no point moved", "Made a solid",
    "Made solids", "Meshed a solid",
)  # fmt: skip
"""Phrases of repairs that change no surface; ``tanteo part show`` lists those as well."""


def _inside(path: str | Path) -> list[Path]:
    """Return the content of a folder in order; empty if it is not a readable folder."""
    try:
        return sorted(Path(path).iterdir()) if Path(path).is_dir() else []
    except OSError:
        return []
