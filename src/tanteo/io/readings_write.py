"""Writing readings files that :func:`tanteo.io.read_readings` reads back."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.io import units
from tanteo.io.columns import DIRECTION, HAND, NORMAL, POINT
from tanteo.lie import SO3
from tanteo.replaced import replaced
from tanteo.sensors import Readings
from tanteo.typing import FloatArray


def write_readings(readings: Readings, path: str | Path, *, unit: str = "mm", angle_unit: str = "deg") -> None:
    """Write a readings file with the columns that say something.

    Args:
        readings: What to write.
        path: The file; replaced if it exists.
        unit: Of all lengths: mm, m, um or in.
        angle_unit: Of the normals' deviations: deg or rad.

    Raises:
        UnitError: Not such a unit.
        OSError: The file cannot be written.
    """
    metres, radians = units.length_unit(unit, "unit"), units.angle_unit(angle_unit, "angle_unit")
    columns: dict[str, list[Any]] = {"id": list(readings.ids)}
    for group, vectors in (
        (POINT, readings.points / metres),
        (DIRECTION, readings.directions),
        (NORMAL, readings.normals),
    ):
        suffix = f"_{unit}" if group is POINT else ""
        columns |= {name + suffix: _cells(vectors[:, i]) for i, name in enumerate(group)}
    columns[f"normal_sd_{angle_unit}"] = _cells(readings.normal_sds / radians)
    radii = np.where(readings.radii > 0, readings.radii, np.nan)
    lengths = {"radius": radii, "sd": readings.sds, "across_sd": readings.across_sds}
    lengths |= {"range": readings.ranges, "max": readings.max_ranges}
    columns |= {f"{name}_{unit}": _cells(values / metres) for name, values in lengths.items()}
    hands = np.concatenate([readings.Ts_world_hand[:, :3, 3] / metres, _quaternions(readings)], axis=1)
    columns |= {name + (f"_{unit}" if i < 3 else ""): _cells(hands[:, i]) for i, name in enumerate(HAND)}
    columns |= {"feature": list(readings.features), "sensor": list(readings.sensors)}
    columns["kind"] = ["" if kind in ("point", "free") else kind for kind in readings.kinds]
    columns["status"] = ["none" if free else "" for free in readings.is_free]
    columns = {name: cells for name, cells in columns.items() if any(cell != "" for cell in cells)}
    # an id that starts with # would read as a comment, unless quoted
    marked = any(name.startswith("#") for name in readings.ids)
    with replaced(path) as file, file.open("w", encoding="utf-8", newline="") as text:
        writer = csv.writer(text, quoting=csv.QUOTE_ALL if marked else csv.QUOTE_MINIMAL, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))


def _cells(values: FloatArray) -> list[Any]:
    return [value if value == value else "" for value in values.tolist()]


def _quaternions(readings: Readings) -> FloatArray:
    q = np.full((len(readings), 4), np.nan)
    given = readings.has_hand
    q[given] = SO3.as_quaternion(readings.Ts_world_hand[given, :3, :3])
    return q
