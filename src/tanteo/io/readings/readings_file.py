"""Read files of readings in any known format: recognize the format, parse it, and add the stated options."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from tanteo.errors import ReadingsError, check_kind
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.io.documents.ros_messages import RosOptions
from tanteo.io.logs.contents import Contents
from tanteo.io.logs.formats import FORMATS, format_named, read_log, recognise
from tanteo.io.logs.json_table import is_json_of_ranges
from tanteo.io.logs.log import LogFormat
from tanteo.io.logs.named import refuse_by_name
from tanteo.io.logs.value_words import stated_unit
from tanteo.io.poses.transforms import Track
from tanteo.io.readings.analog import parse_scale
from tanteo.io.readings.bags import is_bag, read_bag, shifted
from tanteo.io.readings.log_readings import readings_of
from tanteo.io.readings.range_codes import parse_special
from tanteo.io.readings.readings_csv import read_table, read_track
from tanteo.io.readings.ros_readings import BAG
from tanteo.io.readings.session_readings import is_session, session_readings
from tanteo.io.readings.stated import Direction, Stated, as_brand, as_direction, as_pose
from tanteo.io.readings.table import INVALID
from tanteo.plugins import guarded
from tanteo.sensors import Readings, Rig

_RECOGNISED = 2_000_000
"""Number of leading bytes used to recognize a format."""

_LARGEST_LOG = 2_000_000_000
"""Largest log that is read into memory [bytes]."""

_TITLES = 40
"""Number of lines in which a unit of the whole file is searched, as ``Units: mm``."""

_SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")


def read_readings(
    path: str | Path,
    progress: Callable[[int], None] | None = None,
    *,
    format: str | None = None,
    unit: str | None = None,
    radius: float | None = None,
    direction: str | Vectors | Direction | None = None,
    normal_sd: float | None = None,
    brand: str | None = None,
    tool: str | Transforms | Vectors | None = None,
    hand: str | Transforms | Path | None = None,
    rig: Rig | None = None,
    device: str | None = None,
    sensor: str | None = None,
    analog: str | None = None,
    no_target: str | Sequence[str] | None = None,
    invalid: str | Sequence[str] | None = None,
    max_points: int | None = None,
    topics: Sequence[str] | None = None,
    world: str | None = None,
    latency: float | None = None,
) -> Readings:
    """Read a file of readings in any known format (``docs/formats_logs.md``), recognized by its content.

    The readings' ``notes`` list assumptions and ignored content. If the file lacks a required value, the error names
    the command-line option: ``--radius`` is the argument ``radius``, and ``--units`` is ``unit``, as in
    :func:`tanteo.read_parts`.

    Args:
        path: file to read.
        progress: function called repeatedly with the number of rows read so far; None for none.
        format: name of the format, to override recognition; ``csv`` is a table with a header.
        unit: length unit of numbers without one: mm, m, um or in.
        radius: radius of the tip's ball [m], 0 for a sharp tip; the points are centres of the ball.
        direction: approach or viewing direction of all rows: a vector ``(3,)`` into the material, ``"down"``, ``"-z"``;
            ``"tool"`` for the z axis of the tip; ``"from:0,0,500mm"`` for a viewpoint; ``"ijk"`` or ``"-ijk"`` for the
            vectors of the file.
        normal_sd: standard deviation of the file's normals for each tilt component [rad].
        brand: robot brand of the ``hand_`` columns, where their names are ambiguous: a name of :data:`BRANDS`.
        tool: tip on the hand: offset ``(3,)`` [m], ``T_hand_tip`` ``(4, 4)`` [m], or a text such as ``"0,0,150mm"``.
        hand: ``T_world_hand`` ``(4, 4)`` [m] for a file without it, a text such as ``"400,200,300mm 180,0,0deg"``, or a
            table of its poses over time, which are interpolated at the times of the rows.
        rig: range sensors on the hand, whose names, zones and codes the file uses.
        device: name of the rig's device that measured a frame of zones, where the rig has several.
        sensor: name of the preset whose codes the ranges use, where the rig does not state one.
        analog: range of an analog output by two points, as ``"0V=160mm,10V=450mm"``, for a column such as ``range_v``.
        no_target: values in the range column that mean that nothing was in range, as ``"8190"`` or ``"OL"``.
        invalid: values in the range column that exclude their row: too near, or no valid measurement.
        max_points: largest number of readings to keep, drawn at random; None for all.
        topics: topics with readings in a ROS recording; None to choose them automatically, with a note.
        world: name of the world frame in a ROS recording; None for the root of the frames above the readings.
        latency: age of the readings at their stamps in a ROS recording [s].

    Raises:
        ReadingsError: the file cannot be read or has an invalid entry; the message names file, line and value, and the
            format unless it is tanteo's own.
        UnitError: a unit is missing, unknown or contradictory.
        InputError: an argument is invalid.

    Example:
        >>> readings = tanteo.read_readings("readings/bracket_left.csv")
        >>> len(readings)
        30
    """
    check_kind("path", path, (str, Path), "Name the file.")
    path = Path(path)
    stated = Stated(
        units=unit, radius=radius, direction=as_direction(direction), normal_sd=normal_sd, brand=as_brand(brand),
        tool=as_pose("tool", tool), hand=_hand(hand, unit, brand), rig=rig, device=device, sensor=sensor,
        analog=None if analog is None else parse_scale(analog),
        special=(*parse_special(no_target, "no_target", "none"), *parse_special(invalid, "invalid", INVALID)),
        max_points=max_points,
    )  # fmt: skip
    named = format_named(format) if format not in (None, BAG) else None
    of_bag = RosOptions(tuple(topics or ()), world, latency or 0.0)
    if format == BAG or (format is None and is_bag(path)):
        return read_bag(path, stated, of_bag)
    if of_bag != RosOptions():
        raise ReadingsError(f"{path}: expected a recording of ROS with topics, world or latency, got none. Drop these.")
    try:
        if str(path) == "-" or (path.exists() and not (path.is_file() or path.is_dir())):
            # error messages read the file again to find the line, which a pipe does not allow
            raise ReadingsError(f"{path}: expected a file, got a pipe or device. Save the readings to a file first.")
        start = _beginning(path)
        if format is None and is_session(start):
            return session_readings(path)
        contents = Contents(start, str(path))
        form = named if format is not None else None if is_json_of_ranges(contents.head) else recognise(contents)
        if form is None:
            if format is None:
                refuse_by_name(contents)
            return read_table(path, start, stated, progress)
        return _read_log(path, form, stated)
    except UnicodeDecodeError as error:
        raise ReadingsError(
            f"{path}: expected text, got byte {error.object[error.start]:#04x}. Save it again as UTF-8."
        ) from None
    except OSError as error:
        raise ReadingsError(
            f"{path}: expected a readings file, got: {error.strerror or error}. Check the path."
        ) from None


def read_shifted(
    path: str | Path, shifts: Sequence[float], *, latency: float | None = None, topics: Sequence[str] | None = None,
    world: str | None = None, radius: float | None = None, direction: str | Vectors | Direction | None = None,
    max_points: int | None = None,
) -> tuple[Readings, ...]:  # fmt: skip
    """Read the same readings of a ROS recording once for each additional latency.

    Args:
        path: file or folder of the recording.
        shifts: latencies added to ``latency`` [s].
        latency: age of the readings at their stamps [s], see :func:`read_readings`.
        topics: topics with readings.
        world: name of the world frame.
        radius: radius of the tip's ball [m].
        direction: approach or viewing direction of all rows.
        max_points: largest number of readings to keep.

    Returns:
        One set of readings for each shift, all of the same messages; empty if the file is not a recording, or holds the
        readings of a session.

    Raises:
        ReadingsError: the file cannot be read, see :func:`read_readings`.
    """
    path = Path(path)
    if not is_bag(path):
        return ()
    stated = Stated(radius=radius, direction=as_direction(direction), max_points=max_points)
    return shifted(path, stated, RosOptions(tuple(topics or ()), world, latency or 0.0), shifts)


def _hand(hand: str | Transforms | Path | None, units: str | None, brand: str | None) -> Transforms | Track | None:
    """Return the stated pose of the hand, or its poses over time from a file."""
    if isinstance(hand, Path) or (isinstance(hand, str) and Path(hand).is_file()):
        try:
            return read_track(Path(hand), units=units, brand=as_brand(brand))
        except OSError as error:
            raise ReadingsError(f"{hand}: expected a table of hand poses, got: {error.strerror}.") from None
    return as_pose("hand", hand)


def _beginning(path: Path) -> bytes:
    with path.open("rb") as binary:
        start = binary.read(_RECOGNISED)
    if start.startswith(_SPREADSHEETS):
        raise ReadingsError(f"{path}: expected a table as text, got a spreadsheet or archive. Save the sheet as CSV.")
    return start


def _read_log(path: Path, form: LogFormat, stated: Stated) -> Readings:
    if path.stat().st_size > _LARGEST_LOG:
        raise ReadingsError(
            f"{path}: expected a log of up to {_LARGEST_LOG:.0e} bytes, got {path.stat().st_size:.2g}. Split it."
        )
    contents = Contents(path.read_bytes(), f"{path} ({form.words})")
    log = read_log(form, contents)
    if log.unit is None and contents.encoding is not None:
        log = replace(log, unit=stated_unit(contents.head.splitlines()[:_TITLES]))
    with guarded(FORMATS.origin(form.name), f"arrays of {path} that fit each other"):
        return readings_of(log, stated, form, str(path))


def format_names() -> tuple[str, ...]:
    """Return the names of all formats of readings files."""
    return ("csv", *FORMATS.names(), BAG)
