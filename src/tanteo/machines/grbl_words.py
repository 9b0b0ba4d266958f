"""What GRBL says, in numbers: status reports, offsets, probe reports, alarms.

Read for it: GRBL 1.1 ``doc/markdown/interface.md`` (grbl/grbl): a status may say ``MPos``, or ``WPos`` with ``WCO``;
``[PRB:...]`` is in machine coordinates, in inches where ``$13=1``.
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
    "5": "the probe met nothing", "6": "homing was reset", "8": "homing failed", "9": "homing failed",
}  # fmt: skip
_PROBE = re.compile(r"\[PRB:([-\d.,]+):([01])\]")


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """A status report, in the controller's unit.

    Attributes:
        state: its word.
        machine: position in machine coordinates ``(3,)``.
        tripped: the probe's pin.
        at: when it was heard.
    """

    state: str
    machine: Vectors
    tripped: bool
    at: float


def report_of(row: str, offset: Vectors) -> Report | None:
    """``<Idle|MPos:0.000,0.000,0.000|FS:0,0|Pn:P>``; None where it is not whole.

    Args:
        row: as heard.
        offset: of work coordinates ``(3,)``, where the report does not say it.
    """
    if not row.endswith(">"):
        return None
    state, *fields = row[1:-1].split("|")
    said = dict(field.partition(":")[::2] for field in fields)
    try:
        if "MPos" in said:
            machine = _values(said["MPos"])
        elif "WPos" in said:
            machine = _values(said["WPos"]) + (_values(said["WCO"]) if "WCO" in said else offset)
        else:
            return None
    except ValueError:
        return None
    return Report(state, machine, "P" in said.get("Pn", ""), time.monotonic())


def probed(rows: Iterable[str]) -> tuple[Vectors, bool] | None:
    """Of the last probe report: where ``(3,)``, and whether something was met; None without a report."""
    found = [m for m in map(_PROBE.search, rows) if m]
    return (_values(found[-1].group(1)), found[-1].group(2) == "1") if found else None


def offsets_of(rows: Iterable[str]) -> dict[str, Vectors]:
    """``[G54:1.000,2.000,3.000]`` and the like by name; ``[TLO:1.000]`` is along z."""
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
