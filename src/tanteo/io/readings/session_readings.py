"""Readings of a recorded session."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from tanteo.errors import ReadingsError
from tanteo.sensors import Column, Readings, concatenate

_HEAD = re.compile(rb'\A\s*\{\s*"schema"\s*:\s*"tanteo\.session/')


def is_session(start: bytes) -> bool:
    """Return whether a file is the record of a session as JSON.

    Args:
        start: first bytes of the file.
    """
    return _HEAD.match(start.removeprefix(b"\xef\xbb\xbf")) is not None


def session_readings(path: Path) -> Readings:
    """Return all readings of a session record, with the standard deviation of the session where they have none.

    Args:
        path: record, JSON or MCAP.

    Raises:
        ReadingsError: the session has no readings.
        InputError: the file is no complete record.
    """
    from tanteo.io.documents.session_record import load_record

    record = load_record(path)
    made = [one.readings for one in (o.observation() for o in record.observations) if one.readings]
    if not made:
        raise ReadingsError(f"{path}: expected a session with readings, got one without. Record one.")
    readings = concatenate(made)
    sd, hit = record.sensing.sd, ~readings.is_free
    if sd is not None:
        readings = replace(readings, sds=readings.sds.coalesce(Column.from_rows(np.full(len(readings), sd)).only(hit)))
    note = "The readings are those of the recorded session. tanteo replay computes the session's own answer."
    return replace(readings, source=str(path), notes=(note,))
