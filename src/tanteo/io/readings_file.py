"""The one front for files of readings: recognise the format, read it, complete it by what was stated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from tanteo.errors import ReadingsError, check_kind
from tanteo.io.bags import is_bag, read_bag, shifted
from tanteo.io.log_readings import readings_of
from tanteo.io.readings_csv import read_table
from tanteo.io.ros_messages import RosOptions
from tanteo.io.ros_readings import BAG
from tanteo.io.stated import Direction, Stated, as_brand, as_direction, as_pose
from tanteo.logs import FORMATS, Contents, LogFormat, format_named, read_log, recognise
from tanteo.plugins import guarded
from tanteo.sensors import Readings
from tanteo.typing import Transforms, Vectors

_RECOGNISED = 2_000_000
"""Bytes by which a format is recognised."""

_LARGEST_LOG = 2_000_000_000
"""Bytes of a log that are read at once."""

_SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")


def read_readings(
    path: str | Path,
    progress: Callable[[int], None] | None = None,
    *,
    format: str | None = None,
    units: str | None = None,
    radius: float | None = None,
    direction: str | Vectors | Direction | None = None,
    normal_sd: float | None = None,
    brand: str | None = None,
    tool: str | Transforms | Vectors | None = None,
    hand: str | Transforms | None = None,
    device: str | None = None,
    max_points: int | None = None,
    topics: Sequence[str] | None = None,
    world: str | None = None,
    latency: float | None = None,
) -> Readings:
    """Read a file of readings in any format that is known (``docs/formats.md``), recognised by its content.

    What was left out or taken as something is in ``notes`` of the readings. What a file does not say is asked for, in
    the words of the command line: ``--radius`` is ``radius``.

    Args:
        path: The file.
        progress: Called with the number of rows read so far, every so often.
        format: Name of the format, where it is not recognised or not rightly; ``csv`` is a table with a header.
        units: Length unit of numbers that have none: mm, m, um or in.
        radius: Of the tip's ball [m], 0 for a sharp tip: the points are its centres.
        direction: Where the tip moved or the sensor looked in all rows: a vector ``(3,)`` into the material,
            ``"down"``, ``"-z"``; ``"tool"`` for the z axis of the tip; ``"from:0,0,500mm"`` for a viewpoint; ``"ijk"``
            or ``"-ijk"`` for the vectors of the file.
        normal_sd: Standard deviation of the file's normals about each tilt [rad].
        brand: Whose pose the ``hand_`` columns are, where their names leave it open: a name of :data:`BRANDS`.
        tool: The tip on the hand: its offset ``(3,)`` [m], ``T_hand_tip`` ``(4, 4)``, or as typed: ``"0,0,150mm"``.
        hand: ``T_world_hand`` ``(4, 4)`` [m] of a file that has none, or as typed: ``"400,200,300mm 180,0,0deg"``.
        device: Of the rig, that a frame of zones is of.
        max_points: Readings that are kept, drawn at random; all if None.
        topics: Of a recording of ROS, those with the readings; guessed, and said, if None.
        world: Of the same, the name of the world's frame; the root of the frames above the readings if None.
        latency: Of the same, how much older the readings are than their stamps [s].

    Raises:
        ReadingsError: The file cannot be read or says something that readings cannot say; the message names file, line
            and value, and the format if it is another than ours.
        UnitError: A unit is missing, unknown or contradictory.
        InputError: An argument is none.

    Example:
        >>> readings = tanteo.read_readings("readings/bracket_left.csv")
        >>> len(readings)
        30
    """
    check_kind("path", path, (str, Path), "Name the file.")
    path = Path(path)
    stated = Stated(
        units=units, radius=radius, direction=as_direction(direction), normal_sd=normal_sd, brand=as_brand(brand),
        tool=as_pose("tool", tool), hand=as_pose("hand", hand), device=device, max_points=max_points,
    )  # fmt: skip
    named = format_named(format) if format not in (None, BAG) else None
    of_bag = RosOptions(tuple(topics or ()), world, latency or 0.0)
    if format == BAG or (format is None and is_bag(path)):
        return read_bag(path, stated, of_bag)
    if of_bag != RosOptions():
        raise ReadingsError(f"{path}: expected a recording of ROS with topics, world or latency, got none. Drop these.")
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            # complaints read the file again to find their line, which a pipe cannot
            raise ReadingsError(f"{path}: expected a file, got a pipe or device. Save the readings to a file first.")
        start = _beginning(path)
        form = named if format is not None else recognise(Contents(start, str(path)))
        if form is None:
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
    """The same readings of a recording of ROS, as they would be if they were older by several times.

    Args:
        path: The file.
        shifts: Times [s].
        latency: As of :func:`read_readings`, and so are the others.
        topics: Of the readings.
        world: Frame of the answer.
        radius: Of the tip's ball [m].
        direction: Where the tip moved.
        max_points: Readings that are kept.

    Returns:
        One of each shift, all of the same readings; none where the file is no recording, or the readings of a session.

    Raises:
        ReadingsError: As of :func:`read_readings`.
    """
    path = Path(path)
    if not is_bag(path):
        return ()
    stated = Stated(radius=radius, direction=as_direction(direction), max_points=max_points)
    return shifted(path, stated, RosOptions(tuple(topics or ()), world, latency or 0.0), shifts)


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
    with guarded(FORMATS.origin(form.name), f"arrays of {path} that fit each other"):
        return readings_of(log, stated, form, str(path))


def format_names() -> tuple[str, ...]:
    """Names that ``format`` may have."""
    return ("csv", *FORMATS.names(), BAG)
