"""The CAD files of a command: read, with a warning for everything that a person may not expect of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tanteo.cli.options import MisuseError
from tanteo.cli.printing import complain, progress
from tanteo.cli.targets import inside
from tanteo.errors import PartError, UnitError

if TYPE_CHECKING:
    from tanteo.parts import Part

_SINGLE = (".stl", ".glb")
"""Formats whose coordinates are of single precision, as a rule."""

_BLUR = 4e-6
"""How much of rounding is worth a warning [m]."""


def read_all_parts(paths: Sequence[str], units: str | None, *, quiet: bool) -> Sequence[Part]:
    """The parts; files of a folder that cannot be read are warnings as long as one can."""
    from tanteo.catalogue import read_parts

    try:
        with progress("reading parts", quiet=quiet) as tick:
            parts = read_parts(paths, unit=units, progress=tick)
    except UnitError as error:
        raise MisuseError(f"{error} Here that is --units.") from None
    reasons = [f"{f.reason} Here that is --units." if "unit=" in f.reason else f.reason for f in parts.failures]
    below = list(_below(paths))
    if len(reasons) == 1 and not parts.parts and not below:
        raise PartError(reasons[0])
    named = {Path(path) for path in paths if not Path(path).is_dir()}
    lost = [r for r, failure in zip(reasons, parts.failures, strict=True) if Path(failure.path) in named]
    odd = [*below, *_unused_unit(parts.parts, units), *_coarse(parts.parts)]
    for reason in [r for r in reasons if r not in lost[:1]] + odd:
        complain("warning", reason)
    if lost:  # an answer would say nothing of a part that was asked for by name
        raise PartError(lost[0])
    if not parts.parts:
        raise PartError("--parts: expected at least one part that can be read, got none. See the warnings.")
    return parts.parts


def _below(paths: Sequence[str]) -> Iterator[str]:
    """What to say of folders in the folders that hold CAD files, which are not read unless they are named as well."""
    from tanteo.parts import READABLE

    named = {Path(path).resolve() for path in paths}
    for folder in (f for path in paths for f in inside(path)):
        if folder.resolve() in named:
            continue
        if count := sum(f.suffix.lower() in READABLE for f in inside(folder)):
            files = "1 CAD file in it is" if count == 1 else f"{count} CAD files in it are"
            yield f"{folder}: {files} not read, as folders in a folder are not looked into. Name it, too."


def _coarse(parts: Sequence[Part]) -> Iterator[str]:
    """What to say of meshes so far from their origin that single precision blurs them."""
    from tanteo.parts import FLOAT32

    for part in parts:
        far = float(abs(part.box).max())
        if Path(part.source).suffix.lower() in _SINGLE and far * FLOAT32 > _BLUR:
            yield (
                f"{part.source}: it lies {far:.3g} m from its origin, where single precision resolves "
                f"{1e6 * far * FLOAT32:.2g} um, so that faces may break up. Export it near the origin, or as STEP."
            )


def _unused_unit(parts: Sequence[Part], units: str | None) -> list[str]:
    """That the unit that was typed is not that of the files, which all say their own; nothing if it is."""
    from tanteo.parts import UNITLESS

    own = sorted({part.unit for part in parts})
    if units is None or not own or own == [units] or any(Path(p.source).suffix.lower() in UNITLESS for p in parts):
        return []
    says = "the file says itself that it is" if len(parts) == 1 else "the files say themselves that they are"
    return [f"--units {units} was not used: {says} in {', '.join(own)}."]
