"""The file of readings of a command: options for what it does not say, and how it is read with them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tanteo import io
from tanteo.cli.arguments import option
from tanteo.cli.printing import complain
from tanteo.cli.typed import Words, at_least
from tanteo.errors import InputError, ReadingsError, UnitError

if TYPE_CHECKING:
    from tanteo.geometry.typing import Transforms
    from tanteo.io import Direction
    from tanteo.sensors import Readings, Rig
else:  # the parser resolves annotations, and has to load nothing for that
    Direction = Transforms = Any

MAX_POINTS = 1000
"""Readings without labels beyond this are drawn from: more of a dense cloud say little more, and take longer."""

_file = partial(option, rich_help_panel="File of readings")


def parse_radius(text: str) -> float:
    """Of a ball [m], or zero."""
    value = io.parse_length(text, "--radius")
    if not 0 <= value <= 1:
        raise InputError(f"--radius: expected a length of zero to 1 m, got '{text}'. Write it as 1.5mm.")
    return value


def _format(name: str) -> str:
    if name not in io.format_names():
        known = ", ".join(io.format_names())
        raise InputError(f"--format: expected one of {known}, got '{name}'. Leave it out to have it recognised.")
    return name


def parse_direction(text: str) -> Any:
    """Where a tip moved."""
    return io.parse_direction(text, "--direction")


def _normal_sd(text: str) -> float:
    return io.parse_angle(text, "--normal-sd")


def parse_time(name: str, least: float, most: float, text: str) -> float:
    """A time [s]."""
    number, unit = (text[:-2], 1e-3) if text.endswith("ms") else (text[:-1], 1.0)
    try:
        value = unit * float(number) if text.endswith("s") else float("nan")
    except ValueError:
        value = float("nan")
    if not least <= value <= most:
        raise InputError(f"{name}: expected a time from {least:g} to {most:g} s, got '{text}'. Write it as 5ms.")
    return value


def parse_latency(text: str) -> float:
    """How much older readings are than their stamps [s]."""
    return parse_time("--latency", -10, 10, text)


def _pose(name: str, attitude: bool, text: str) -> Any:
    return io.parse_pose(text, name, attitude=attitude)


def _brand(name: str) -> str:
    try:
        found = io.brand(name)
    except InputError as error:
        raise InputError(str(error).replace("brand:", "--brand:", 1)) from None
    if not found.verified:
        complain("warning", f"--brand: the angle convention of {found.name} was not checked. Compare one pose first.")
    return found.name


def _formats(incomplete: str) -> list[str]:
    return [name for name in io.format_names() if name.startswith(incomplete)]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileOptions:
    """What a file of readings does not say itself."""

    format: Annotated[
        str | None,
        _file("--format", "NAME", "Format of READINGS, as grbl; recognised if not given.", autocompletion=_formats),
        Words(_format),
    ] = None
    radius: Annotated[
        float | None,
        _file("--radius", "LENGTH", "Radius of the tip's ball where points are its centres, as 1.5mm."),
        Words(parse_radius),
    ] = None
    direction: Annotated[
        Direction | None,
        _file(
            "--direction", "DIRECTION", "Which way the tip moved: down, -z, 0,0,-1, ijk, -ijk, tool, from:0,0,500mm."
        ),
        Words(parse_direction),
    ] = None
    normal_sd: Annotated[
        float | None,
        _file("--normal-sd", "ANGLE", "Standard deviation of the normals in the file, as 10deg."),
        Words(_normal_sd),
    ] = None
    brand: Annotated[
        str | None, _file("--brand", "NAME", "Controller whose angles the hand_ columns have, as kuka."), Words(_brand)
    ] = None
    tool: Annotated[
        Transforms | None,
        _file("--tool", "POSE", "Where the tip is on the hand, as 0,0,150mm."),
        Words(partial(_pose, "--tool", False)),
    ] = None
    hand: Annotated[
        Transforms | None,
        _file("--hand", "POSE", "Pose of the hand, if the file has none, as '400,200,300mm 180,0,0deg'."),
        Words(partial(_pose, "--hand", True)),
    ] = None
    topics: Annotated[
        list[str] | None,
        _file(
            "--topic", "NAME", "In a recording of ROS: topic of the readings; may be repeated. Guessed if not given."
        ),
    ] = None
    world: Annotated[str | None, _file("--world", "FRAME", "In a recording of ROS: frame of the answer.")] = None
    latency: Annotated[
        float | None,
        _file("--latency", "TIME", "In a recording of ROS: how much older readings are than their stamps, as 5ms."),
        Words(parse_latency),
    ] = None
    max_points: Annotated[
        int,
        _file("--max-points", None, "Use this many readings without labels at most."),
        Words(partial(at_least, "--max-points", 1, f"Use {MAX_POINTS}"), int),
    ] = MAX_POINTS


def read_file(path: str, options: FileOptions, units: str | None, rig: Rig | None) -> tuple[Readings, bool]:
    """The readings, with warnings of what was left out or taken as something, and whether ``--units`` was for them.

    Raises:
        ReadingsError: The file cannot be read, or lacks what an option has to say.
    """
    _refuse_cad(path, options)
    said: dict[str, Any] = {name: getattr(options, name) for name in FileOptions.__slots__}
    read = partial(io.read_readings, path, device=_device(rig), **said)
    readings, used = None, False
    try:
        readings = read()
    except UnitError:
        if units is None:
            raise
    if units is not None and (readings is None or any("--units" in note for note in readings.notes)):
        readings, used = read(units=units), True
    assert readings is not None
    for note in readings.notes:
        complain("warning", note)
    return readings, used


def _device(rig: Rig | None) -> str | None:
    """The multi-zone sensor of a rig; None if it has none, or several."""
    devices = [] if rig is None else [s.unit for s in rig.sensors if s.unit]
    return devices[0] if len(set(devices)) == 1 else None


def _refuse_cad(path: str, options: FileOptions) -> None:
    """A CAD file is no file of readings, but for a PLY file without faces."""
    from tanteo.parts import readable_suffixes

    suffix = Path(path).suffix.lower()
    if suffix not in readable_suffixes() or options.format is not None:
        return
    if suffix == ".ply":
        try:
            with open(path, "rb") as file:
                if b"element face" not in file.read(4096):
                    return
        except OSError:
            return
    raise ReadingsError(
        f"READINGS: expected a file of readings, got the CAD file '{path}'. Readings come first, CAD files "
        "behind --parts or --part. Say --format ply if it is a cloud."
    )


def units_of_parts(paths: list[str], units: str | None, used: bool) -> str | None:
    """The unit of the parts: not that of the readings, where all parts have their own."""
    if not used:
        return units
    from tanteo.catalogue import cad_files
    from tanteo.parts import is_unitless

    files = [*paths, *map(str, cad_files(paths))]
    return units if any(is_unitless(Path(file).suffix) for file in files) else None
