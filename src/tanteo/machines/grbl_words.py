"""Parse the messages of GRBL: status reports, offsets, probe reports and alarms.

Source: GRBL 1.1, ``doc/markdown/interface.md`` (grbl/grbl). A status report has ``MPos``, or ``WPos`` with ``WCO``.
``[PRB:...]`` is in machine coordinates, in inches if ``$13=1``.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.protocol import MachineState

STATES: dict[str, MachineState] = {"Idle": "idle", "Run": "moving", "Jog": "moving", "Hold": "held", "Home": "moving"}
ALARMS = {
    "1": "a limit switch", "2": "a soft limit", "3": "a reset during a motion", "4": "the probe was in contact before",
    "5": "the probe made no contact", "6": "homing was reset", "8": "homing failed", "9": "homing failed",
}  # fmt: skip
_PROBE = re.compile(r"\[PRB:([-\d.,]+):([01])\]")


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """Status report, in the controller's unit.

    Attributes:
        state: word of the state, such as ``Idle`` or ``Hold:0``.
        machine: position in machine coordinates ``(3,)``.
        tripped: whether the probe's pin reports a contact.
        at: time of arrival, by the monotonic clock [s].
    """

    state: str
    machine: Vectors
    tripped: bool
    at: float


def report_of(row: str, offset: Vectors) -> Report | None:
    """Return the report in a row such as ``<Idle|MPos:0.000,0.000,0.000|FS:0,0|Pn:P>``; None if it is incomplete.

    Args:
        row: row as received.
        offset: offset of the work coordinates ``(3,)``, for reports that do not contain it.
    """
    if not row.endswith(">"):
        return None
    state, *fields = row[1:-1].split("|")
    values = dict(field.partition(":")[::2] for field in fields)
    try:
        if "MPos" in values:
            machine = _values(values["MPos"])
        elif "WPos" in values:
            machine = _values(values["WPos"]) + (_values(values["WCO"]) if "WCO" in values else offset)
        else:
            return None
    except ValueError:
        return None
    return Report(state, machine, "P" in values.get("Pn", ""), time.monotonic())


def probed(rows: Iterable[str]) -> tuple[Vectors, bool] | None:
    """Return position ``(3,)`` and contact flag of the last probe report; None without a report.

    Args:
        rows: rows as received.
    """
    found = [m for m in map(_PROBE.search, rows) if m]
    return (_values(found[-1].group(1)), found[-1].group(2) == "1") if found else None


def offsets_of(rows: Iterable[str]) -> dict[str, Vectors]:
    """Return the offsets in rows such as ``[G54:1.000,2.000,3.000]``, by name; ``[TLO:1.000]`` is along z.

    Args:
        rows: rows as received.
    """
    found = dict[str, Vectors]()
    for row in rows:
        name, colon, numbers = row.strip("[]").partition(":")
        if colon and (re.fullmatch(r"G5[4-9]|G92|TLO", name)):
            values = [float(v) for v in numbers.split(",")[:3]]
            found[name] = np.array(values if len(values) == 3 else [0.0, 0.0, values[0]])
    return found


def _values(text: str) -> Vectors:
    values = np.array([float(v) for v in text.split(",")[:3]])
    if values.shape != (3,):
        raise ValueError
    return values
