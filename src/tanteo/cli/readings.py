"""Read the file of readings of a command, with options for what the file does not state."""

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
    from tanteo.io.readings import Direction
    from tanteo.sensors import Readings, Rig
else:  # the parser resolves annotations; these names avoid slow imports
    Direction = Transforms = Any

MAX_POINTS = 1000
"""Default largest number of unlabelled readings; more points of a dense cloud add little information."""

_file = partial(option, rich_help_panel="File of readings")


def parse_radius(text: str) -> float:
    """Return the radius of a ball [m], or zero.

    Args:
        text: length with its unit.

    Raises:
        InputError: the text is not a length from 0 to 1 m.
    """
    value = io.readings.parse_length(text, "--radius")
    if not 0 <= value <= 1:
        raise InputError(f"--radius: expected a length of zero to 1 m, got '{text}'. Write it as 1.5mm.")
    return value


def _format(name: str) -> str:
    if name not in io.readings.format_names():
        known = ", ".join(io.readings.format_names())
        raise InputError(f"--format: expected one of {known}, got '{name}'. Drop --format to detect it.")
    return name


def parse_direction(text: str) -> Any:
    """Return the direction in which a tip moved.

    Args:
        text: value of ``--direction``.
    """
    return io.readings.parse_direction(text, "--direction")


def _normal_sd(text: str) -> float:
    return io.readings.parse_angle(text, "--normal-sd")


def parse_time(name: str, least: float, most: float, text: str) -> float:
    """Return a time [s] from a text such as ``5ms``.

    Args:
        name: name of the option, for messages.
        least: smallest accepted time [s].
        most: largest accepted time [s].
        text: number with its unit.

    Raises:
        InputError: the text is not a time in this interval.
    """
    number, unit = (text[:-2], 1e-3) if text.endswith("ms") else (text[:-1], 1.0)
    try:
        value = unit * float(number) if text.endswith("s") else float("nan")
    except ValueError:
        value = float("nan")
    if not least <= value <= most:
        raise InputError(f"{name}: expected a time from {least:g} to {most:g} s, got '{text}'. Write it as 5ms.")
    return value


def parse_latency(text: str) -> float:
    """Return the time by which readings are older than their stamps [s].

    Args:
        text: number with its unit.
    """
    return parse_time("--latency", -10, 10, text)


def _pose(name: str, attitude: bool, text: str) -> Any:
    return io.poses.parse_pose(text, name, attitude=attitude)


def _hand(text: str) -> Any:
    return Path(text) if Path(text).is_file() else _pose("--hand", True, text)


def _brand(name: str) -> str:
    try:
        found = io.brand(name)
    except InputError as error:
        raise InputError(str(error).replace("brand:", "--brand:", 1)) from None
    if not found.verified:
        complain("warning", f"--brand: the angle convention of {found.name} was not verified. Compare one pose first.")
    return found.name


def _formats(incomplete: str) -> list[str]:
    return [name for name in io.readings.format_names() if name.startswith(incomplete)]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileOptions:
    """Options for what a file of readings does not state."""

    format: Annotated[
        str | None,
        _file("--format", "NAME", "Format of READINGS, as grbl; detected if not given.", autocompletion=_formats),
        Words(_format),
    ] = None
    radius: Annotated[
        float | None,
        _file("--radius", "LENGTH", "Radius of the tip's ball if the points are its centres, as 1.5mm."),
        Words(parse_radius),
    ] = None
    direction: Annotated[
        Direction | None,
        _file(
            "--direction",
            "DIRECTION",
            "Direction of the tip's motion: down, -z, 0,0,-1, ijk, -ijk, tool, from:0,0,500mm.",
        ),
        Words(parse_direction),
    ] = None
    normal_sd: Annotated[
        float | None,
        _file("--normal-sd", "ANGLE", "Standard deviation of the normals in the file, as 10deg."),
        Words(_normal_sd),
    ] = None
    brand: Annotated[
        str | None,
        _file("--brand", "NAME", "Controller whose angle convention the hand_ columns use, as kuka."),
        Words(_brand),
    ] = None
    tool: Annotated[
        Transforms | None,
        _file("--tool", "POSE", "Pose of the tip on the hand, as 0,0,150mm."),
        Words(partial(_pose, "--tool", False)),
    ] = None
    hand: Annotated[
        Transforms | None,
        _file(
            "--hand",
            "POSE",
            "Pose of the hand, if the file has none, as '400,200,300mm 180,0,0deg', or a table of its poses over time.",
        ),
        Words(_hand),
    ] = None
    device: Annotated[
        str | None, _file("--device", "NAME", "Device of the rig that wrote READINGS, if the rig has several.")
    ] = None
    analog: Annotated[
        str | None,
        _file("--analog", "SCALE", "Range of an analog output in READINGS, as 0V=160mm,10V=450mm."),
    ] = None
    no_target: Annotated[
        list[str] | None,
        _file("--no-target", "VALUES", "Values in the ranges that mean that nothing was in range, as 8190 or OL."),
    ] = None
    invalid: Annotated[
        list[str] | None,
        _file("--invalid", "VALUES", "Values in the ranges that exclude their row, as 0 or 65535: too near, errors."),
    ] = None
    topics: Annotated[
        list[str] | None,
        _file("--topic", "NAME", "For a ROS recording: topic of the readings; may be repeated. Detected if not given."),
    ] = None
    world: Annotated[str | None, _file("--world", "FRAME", "For a ROS recording: frame of the answer.")] = None
    latency: Annotated[
        float | None,
        _file("--latency", "TIME", "For a ROS recording: time by which readings are older than their stamps, as 5ms."),
        Words(parse_latency),
    ] = None
    max_points: Annotated[
        int,
        _file("--max-points", None, "Largest number of unlabelled readings."),
        Words(partial(at_least, "--max-points", 1, f"Use {MAX_POINTS}"), int),
    ] = MAX_POINTS


def read_file(
    path: str, options: FileOptions, units: str | None, rig: Rig | None, sensor: str | None = None
) -> tuple[Readings, bool]:
    """Read a file of readings, and print warnings about ignored content and assumptions.

    Args:
        path: file of the readings.
        options: options for what the file does not state.
        units: value of ``--units``; None if not given.
        rig: range sensors on the hand; None if not given.
        sensor: name of the preset of ``--sensor``; None if not given.

    Returns:
        Readings, and whether ``--units`` was used for them.

    Raises:
        ReadingsError: the file cannot be read, or an option is missing.
        UnitError: the file states no unit and ``units`` is None.
    """
    _refuse_cad(path, options)
    stated: dict[str, Any] = {name: getattr(options, name) for name in FileOptions.__slots__}
    read = partial(io.read_readings, path, rig=rig, sensor=sensor, **stated)
    readings, used = None, False
    try:
        readings = read()
    except UnitError:
        if units is None:
            raise
    if units is not None and (readings is None or any("--units" in note for note in readings.notes)):
        readings, used = read(unit=units), True
    assert readings is not None
    for note in readings.notes:
        complain("warning", note)
    return readings, used


def _refuse_cad(path: str, options: FileOptions) -> None:
    """Refuse a CAD file, except a PLY file without faces."""
    from tanteo.parts.readers import readable_suffixes

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
        f"READINGS: expected a file of readings, got the CAD file '{path}'. Name the readings first and CAD "
        "files after --parts or --part. Use --format ply for a cloud."
    )


def units_of_parts(paths: list[str], units: str | None, used: bool) -> str | None:
    """Return the unit for the parts; None if ``--units`` was used for the readings and all parts state their unit.

    Args:
        paths: files and folders of the parts.
        units: value of ``--units``; None if not given.
        used: whether ``--units`` was used for the readings.
    """
    if not used:
        return units
    from tanteo.catalogue.file_warnings import cad_files
    from tanteo.parts.readers import is_unitless

    files = [*paths, *map(str, cad_files(paths))]
    return units if any(is_unitless(Path(file).suffix) for file in files) else None
