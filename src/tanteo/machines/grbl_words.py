"""Parse the messages of GRBL: status reports, modes, settings, offsets, probe reports and alarms.

Source: GRBL 1.1, ``doc/markdown/interface.md`` and ``grbl/report.c`` (gnea/grbl). A status report has ``MPos``, or
``WPos`` with ``WCO``. ``[PRB:...]`` is in machine coordinates, in inches if ``$13=1``. A reply with another form raises
ValueError with the expected form and the reply.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.protocol import MachineState
from tanteo.machines.replies import NUMBER, numbers_of

STATES: dict[str, MachineState] = {"Idle": "idle", "Run": "moving", "Jog": "moving", "Hold": "held", "Home": "moving"}
ALARMS = {
    "1": "a limit switch", "2": "a soft limit", "3": "a reset during a motion", "4": "the probe was in contact before",
    "5": "the probe made no contact", "6": "homing was reset", "8": "homing failed", "9": "homing failed",
}  # fmt: skip
_PROBE = re.compile(r"\[PRB:([^:\]]*):([01])\]")
_INCHES = re.compile(r"\$(?:13|Report/Inches)=(.*)", re.IGNORECASE)
_ON_OFF = {"0": False, "off": False, "false": False, "1": True, "on": True, "true": True}
_ACCELERATION = re.compile(r"\$12[012]=(.*)")
_ACTING = ("G54", "G92", "TLO")
"""Offsets of ``$#`` that act on a program in ``G54``."""
MODES = ("G54", "G21", "G90", "G94")
"""Modes that the lines of the driver set: work frame, millimetres, absolute coordinates, feed a minute."""


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """Status report, in the controller's unit.

    Attributes:
        state: word of the state, such as ``Idle`` or ``Hold:0``.
        machine: position in machine coordinates ``(3,)``.
        tripped: whether the probe's pin reports a contact.
        at: time of arrival, by the monotonic clock [s].
        offset: sum of all work offsets ``(3,)``; None if the report does not contain it.
    """

    state: str
    machine: Vectors
    tripped: bool
    at: float
    offset: Vectors | None = None


def report_of(row: str, offset: Vectors) -> Report:
    """Return the report in a row such as ``<Idle|MPos:0.000,0.000,0.000|FS:0,0|Pn:P>``.

    Args:
        row: row as received.
        offset: offset of the work coordinates ``(3,)``, for reports that do not contain it.

    Raises:
        ValueError: the row is not a report with a position.
    """
    expected = "a status such as <Idle|MPos:0.000,0.000,0.000|FS:0,0>"
    if not row.endswith(">") or "<" in row[1:]:
        raise ValueError(expected, row)
    state, *fields = row[1:-1].split("|")
    values = dict(field.partition(":")[::2] for field in fields)
    if len(values) < len(fields) or not re.fullmatch(r"[A-Za-z]+(:\d+)?", state):
        raise ValueError(expected, row)
    pins = values.get("Pn", "")
    if ("MPos" in values) == ("WPos" in values) or not re.fullmatch(r"[A-Za-z]*", pins):
        raise ValueError(expected, row)
    sum_ = _values(values["WCO"], expected, row) if "WCO" in values else None
    if "MPos" in values:
        machine = _values(values["MPos"], expected, row)
    else:
        machine = _values(values["WPos"], expected, row) + (offset if sum_ is None else sum_)
    return Report(state, machine, "P" in pins, time.monotonic(), sum_)


def probed(rows: Iterable[str]) -> tuple[Vectors, bool]:
    """Return position ``(3,)`` and contact flag of the probe report.

    Args:
        rows: rows as received.

    Raises:
        ValueError: there is no report, more than one, or one with another form.
    """
    found = [row for row in rows if row.startswith("[PRB")]
    expected = "one report such as [PRB:0.000,0.000,0.000:1]"
    match = _PROBE.fullmatch(found[0]) if len(found) == 1 else None
    if match is None:
        raise ValueError(expected, "; ".join(found))
    return _values(match[1], expected, found[0]), match[2] == "1"


def offsets_of(rows: Iterable[str]) -> dict[str, Vectors]:
    """Return the offsets in rows such as ``[G54:1.000,2.000,3.000]``, by name; ``[TLO:1.000]`` is along z.

    Args:
        rows: rows as received.

    Raises:
        ValueError: an offset has another form, is stated twice, or one that acts in ``G54`` is missing.
    """
    found = dict[str, Vectors]()
    for row in rows:
        name = row[1:].partition(":")[0]
        if not re.fullmatch(r"G5[4-9]|G92|TLO", name):
            continue
        expected = f"one row such as [{name}:0.000,0.000,0.000]"
        if name in found or not row.endswith("]"):
            raise ValueError(expected, row)
        numbers = row[1:-1].partition(":")[2]
        short = name == "TLO" and "," not in numbers
        found[name] = _values(f"0,0,{numbers}" if short else numbers, expected, row)
    for name in _ACTING:
        if name not in found:
            raise ValueError(f"a row [{name}:...] among the offsets", "; ".join(found))
    return found


def acting(found: Mapping[str, Vectors]) -> Vectors:
    """Return the sum of the offsets that act on a program in ``G54`` ``(3,)``, in the controller's unit.

    Args:
        found: offsets by name.
    """
    return np.asarray(sum((found[name] for name in _ACTING), np.zeros(3)))


def in_inches(rows: Iterable[str]) -> bool:
    """Return whether the controller reports inches, from its settings (``$13``).

    Args:
        rows: settings as received.

    Raises:
        ValueError: the setting is missing, stated twice, or has another value.
    """
    found = [match for match in map(_INCHES.fullmatch, rows) if match]
    if len(found) != 1 or found[0][1].lower() not in _ON_OFF:
        shown = "; ".join(match[0] for match in found)
        raise ValueError("one setting $13=0 or $13=1, the unit of its reports", shown)
    return _ON_OFF[found[0][1].lower()]


def deceleration_of(rows: Iterable[str]) -> float | None:
    """Return the smallest acceleration of the first three axes [m/s^2] (``$120`` to ``$122``); None if it is not set.

    Args:
        rows: settings as received.
    """
    found = [match[1] for match in map(_ACCELERATION.fullmatch, rows) if match]
    values = [1e-3 * float(text) for text in found if NUMBER.fullmatch(text)]
    return min(values) if len(values) == 3 and min(values) > 0 else None


def modes_of(rows: Iterable[str]) -> tuple[str, ...]:
    """Return the words of the modal state, from a row such as ``[GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]``.

    Args:
        rows: rows as received.

    Raises:
        ValueError: there is no such row, or more than one.
    """
    found = [row for row in rows if row.startswith("[GC")]
    if len(found) != 1 or not re.fullmatch(r"\[GC:[A-Z0-9. ]+\]", found[0]):
        raise ValueError("one row such as [GC:G0 G54 G17 G21 G90 G94 M5 M9 T0 F0 S0]", "; ".join(found))
    return tuple(found[0][4:-1].split())


def _values(text: str, expected: str, row: str) -> Vectors:
    """Return the first three of three to nine numbers; raise ValueError with ``expected`` and ``row`` else."""
    return numbers_of(text.split(","), expected, row)[:3]
