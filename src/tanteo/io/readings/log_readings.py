"""Convert a machine's log to readings: units to SI, poses from the brand's convention, sensor zones to sensor names."""

from __future__ import annotations

from typing import Any

import numpy as np

from tanteo.errors import ReadingsError, UnitError
from tanteo.io.logs.log import Log, LogFormat
from tanteo.io.poses.poses import pose_from_brand
from tanteo.io.readings.assembling import assemble
from tanteo.io.readings.stated import Stated
from tanteo.io.readings.units import length_unit
from tanteo.sensors import Readings, reading_kind
from tanteo.sensors.kinds import SIZES

_EXAMPLES = {
    "--units": "--units mm",
    "--radius": "--radius 1.5mm (of the tip's ball; 0mm of a sharp tip)",
    "--hand": "--hand '400,200,300mm 180,0,0deg' (pose of the hand)",
    "--rig": "--rig FILE (where the sensor sits on the hand)",
}


def readings_of(log: Log, stated: Stated, form: LogFormat, source: str) -> Readings:
    """Return the readings of a log, completed by the user's stated options.

    Args:
        log: parsed log.
        stated: options for what the log does not contain.
        form: format of the log.
        source: file name for messages.

    Raises:
        ReadingsError: a required option is missing (the message names it), or an option contradicts the file.
        UnitError: the unit is missing, or the stated unit contradicts the file.
    """
    metre = _metre(log, stated, form, source)
    notes = [*log.notes]
    touched = log.points is not None and not all(reading_kind(kind).centre for kind in log.kinds or ("point",))
    if touched and not log.centres and stated.radius is None:
        notes.append("The points are taken as points of the surface; use --radius if they are centres of a ball.")
    if log.normals is not None and stated.normal_sd is None:
        notes.append(
            "The standard deviation of the normals is unknown, so they are ignored; use --normal-sd 10deg to use them."
        )
    n = len(log)
    return assemble(_columns(log, stated, metre, source), n, stated, source, notes, outward=log.outward)


def _metre(log: Log, stated: Stated, form: LogFormat, source: str) -> float:
    """Return the metres per length unit of the log; report all missing options in one message."""
    missing = []
    if log.unit is None and stated.units is None:
        missing.append("--units")
    if log.centres and log.radii is None and stated.radius is None:
        missing.append("--radius")
    if log.ranges is not None:
        missing += [name for name, value in (("--rig", stated.device), ("--hand", stated.hand)) if value is None]
    if missing:
        error = UnitError if missing == ["--units"] else ReadingsError
        listed = " and ".join(_EXAMPLES[name] for name in missing)
        raise error(f"{source}: expected {' and '.join(missing)} with {form.words}, got none. Use {listed}.")
    if log.unit is not None and not log.assumed and stated.units not in (None, log.unit) and log.ranges is None:
        raise UnitError(
            f"{source}: expected lengths in {log.unit}, as the file states, got --units {stated.units}. Drop --units."
        )
    unit = log.unit if log.unit is not None and not (log.assumed and stated.units) else stated.units
    return length_unit(str(unit), "units")


def _columns(log: Log, stated: Stated, metre: float, source: str) -> dict[str, Any]:
    columns: dict[str, Any] = {
        "points": None if log.points is None else log.points * metre,
        "ids": log.ids, "directions": log.directions, "normals": log.normals, "normal_sds": None, "sds": None,
        "radii": None if log.radii is None else log.radii * metre, "features": None, "kinds": None,
        "Ts_world_hand": None, "ranges": None, "is_free": None,
    }  # fmt: skip
    if log.kinds is not None:
        kinds = [reading_kind(kind) for kind in log.kinds]
        columns["kinds"], columns["material_sides"] = [kind.centre or kind.name for kind in kinds], log.sides
        for column, unit in zip(SIZES.values(), (metre, 1.0), strict=True):
            own = np.array([kind.size == column for kind in kinds])
            columns[column] = None if log.sizes is None else np.where(own, log.sizes * unit, np.nan)
    if log.sds is not None:
        columns["sds"] = log.sds * metre
    if log.poses is not None:
        try:
            columns["Ts_world_hand"] = pose_from_brand(log.brand, log.poses)
        except ValueError as error:
            raise ReadingsError(f"{source}: {error}") from None
    if log.ranges is not None and log.cells is not None:
        columns["ranges"], columns["is_free"] = log.ranges * metre, log.free
        columns["sensors"] = [f"{stated.device}.{row}.{column}" for row, column in np.asarray(log.cells).tolist()]
    return columns
