"""Convert a machine's log to readings: units to SI, poses from the brand's convention, sensor zones to sensor names."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tanteo.errors import ReadingsError, UnitError
from tanteo.io.logs.log import Log, LogFormat, counted, last_of_each_search
from tanteo.io.poses.poses import pose_from_brand
from tanteo.io.readings.assembling import assemble, rows_of, step_of
from tanteo.io.readings.brands import BRANDS
from tanteo.io.readings.frames import zones_of
from tanteo.io.readings.range_codes import decode, note_on_codes, refuse_strange
from tanteo.io.readings.stated import Stated
from tanteo.io.readings.table import INVALID
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
    log, stated = _of_device(log, stated, form, source)
    metre = _metre(log, stated, form, source)
    notes = [*log.notes] if stated.units or not log.unit_note else [log.unit_note, *log.notes]
    touched = log.points is not None and not all(reading_kind(kind).centre for kind in log.kinds or ("point",))
    if touched and not log.centres and stated.radius is None:
        notes.append("The points are taken as points of the surface; use --radius if they are centres of a ball.")
    if log.normals is not None and stated.normal_sd is None:
        notes.append(
            "The standard deviation of the normals is unknown, so they are ignored; use --normal-sd 10deg to use them."
        )
    columns, n = _columns(log, stated, metre, source), len(log)
    if log.ranges is not None:
        columns, n = _without_codes(columns, log, stated, metre, source, notes)
    if log.moves:
        columns, n = _without_searches(columns, n, notes)
    places = log.points if log.points is not None else None if log.poses is None else log.poses[:, :3]
    step = 0.0 if places is None else step_of(places, metre)
    return assemble(columns, n, stated, source, notes, outward=log.outward, step=step)


def _without_searches(columns: dict[str, Any], n: int, notes: list[str]) -> tuple[dict[str, Any], int]:
    """Return the columns with the last touch of each search, and their number of rows; a note counts the others."""
    kept = np.flatnonzero(last_of_each_search(columns["points"])).tolist()
    if len(kept) == n:
        return columns, n
    notes.append(
        f"{counted(n - len(kept), 'touch', 'touches')} of searches in several steps excluded: of two or three touches "
        "in a row at one place, the last and slowest counts."
    )
    columns = {name: rows_of(values, kept) for name, values in columns.items()}
    columns["ids"] = columns["ids"] or [str(k + 1) for k in kept]
    return columns, len(kept)


def _metre(log: Log, stated: Stated, form: LogFormat, source: str) -> float:
    """Return the metres per length unit of the log; report all missing options in one message."""
    missing = []
    if log.unit is None and stated.units is None:
        missing.append("--units")
    if log.centres and log.radii is None and stated.radius is None:
        missing.append("--radius")
    if log.ranges is not None:
        missing += [name for name, value in (("--rig", stated.rig), ("--hand", stated.hand)) if value is None]
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
        poses = np.array(log.poses)
        poses[:, :3] *= metre / BRANDS[log.brand].metre
        try:
            columns["Ts_world_hand"] = pose_from_brand(log.brand, poses)
        except ValueError as error:
            raise ReadingsError(f"{source}: {error}") from None
    if log.ranges is not None:
        columns["ranges"], columns["is_free"] = log.ranges * metre, log.free
        columns["sensors"] = (
            [str(stated.device)] * len(log)
            if log.cells is None
            else [f"{stated.device}.{row}.{column}" for row, column in np.asarray(log.cells).tolist()]
        )
    return columns


def _without_codes(
    columns: dict[str, Any], log: Log, stated: Stated, metre: float, source: str, notes: list[str]
) -> tuple[dict[str, Any], int]:
    """Return the columns with codes of the device as free-space rays or excluded, and the number of rows."""
    assert log.ranges is not None
    assert log.free is not None
    cells = [
        "" if free else f"{value:.12g}" for value, free in zip(log.ranges.tolist(), log.free.tolist(), strict=True)
    ]
    found = decode(cells, columns["sensors"], metre, stated)
    refuse_strange(source, found)
    marks = np.array(found.marks)
    if words := note_on_codes(found.words, found.marks):
        notes.append(words)
    columns["is_free"] = log.free | (marks == "none")
    columns["ranges"] = np.where(marks == "", columns["ranges"], np.nan)
    kept = np.flatnonzero(marks != INVALID)
    if not len(kept):
        raise ReadingsError(f"{source}: expected at least one measurement, got codes only. Check the sensor.")
    return {name: rows_of(values, kept.tolist()) for name, values in columns.items()}, len(kept)


def _of_device(log: Log, stated: Stated, form: LogFormat, source: str) -> tuple[Log, Stated]:
    """Return the reading of the log that fits the rig's device, and the options with the name of that device."""
    if log.ranges is None or stated.rig is None:
        return log, stated
    readings = (log, *log.alternatives)
    devices: dict[str, tuple[int, int] | None] = {**zones_of(stated.rig)}
    devices |= {s.name: None for s in stated.rig.sensors if not s.unit}
    fitting = [(one, name) for one in readings for name, zones in devices.items() if zones == one.zones]
    if stated.device is not None:
        fitting = [(one, name) for one, name in fitting if name == stated.device]
    if len({name for _, name in fitting}) != 1:
        wanted = " or ".join(_shape(one.zones) for one in readings)
        have = ", ".join(f"'{name}' ({_shape(zones)})" for name, zones in devices.items())
        advice = "Name it with --device." if fitting and stated.device is None else "Correct zones in the rig."
        raise ReadingsError(f"{source}: expected one device of the rig with {wanted}, got {have}. {advice}")
    return fitting[0][0], replace(stated, device=fitting[0][1])


def _shape(zones: tuple[int, int] | None) -> str:
    return "a single beam" if zones is None else f"{zones[0]} x {zones[1]} zones"
