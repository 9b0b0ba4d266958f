"""Store each reading of a run on disk before the session uses it, in a journal beside the session record."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.machines.programs.job import tool_axes
from tanteo.machines.protocol import Sensed
from tanteo.parts import RECORD, read_whole
from tanteo.planning import Action, Session
from tanteo.sensors import Readings

SUFFIX = ".journal"
"""Suffix of the journal's file name, after the name of the record."""


class Journal:
    """File to which readings are only appended.

    If the power failed while the last line was written, that line is incomplete; no session used it, and it is ignored.
    """

    def __init__(self, record: str | Path) -> None:
        self.path = Path(f"{record}{SUFFIX}")

    def keep(self, action: Action, sensed: Sensed) -> None:
        """Append one reading, and flush it to the disk.

        Args:
            action: question that the reading answers.
            sensed: reading.

        Raises:
            InputError: the file cannot be written.
        """
        row = {
            "question": action.number, "start_m": list(sensed.start), "direction": list(sensed.direction),
            "distance_m": sensed.distance if sensed.hit else None, "reach_m": sensed.reach, "radius_m": action.radius,
        }  # fmt: skip
        try:
            with self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise InputError(
                f"{self.path}: expected a file that can be written, got: {error.strerror}. Free the disk, then resume."
            ) from None

    def rows(self) -> list[tuple[int, Sensed]]:
        """Return the stored readings, each with the number of its question.

        Raises:
            InputError: a line before the last one is not a reading.
        """
        if not self.path.exists():
            return []
        content = read_whole(self.path, "a journal of readings", RECORD)
        lines = content.decode("utf-8", errors="replace").split("\n")
        found = list[tuple[int, Sensed]]()
        for k, line in enumerate(lines):
            if not line.strip():
                continue
            try:
                found.append(_row(json.loads(line)))
            except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
                if k < len(lines) - 1:
                    raise InputError(
                        f"{self.path}, line {k + 1}: expected a reading, got '{line[:40]}'. Restore the file."
                    ) from None
        return found

    def forget(self) -> None:
        """Delete the file, once the session record contains all its readings."""
        self.path.unlink(missing_ok=True)


def _row(raw: dict[str, Any]) -> tuple[int, Sensed]:
    distance = np.inf if raw["distance_m"] is None else float(raw["distance_m"])
    start, direction = (np.array(raw[key], dtype=np.float64) for key in ("start_m", "direction"))
    reach = float(raw["reach_m"])
    if start.shape != (3,) or direction.shape != (3,):
        raise ValueError
    if not np.isfinite([*start, *direction, reach]).all() or np.isnan(distance) or distance < 0:
        raise ValueError
    return int(raw["question"]), Sensed(start, direction, distance, reach)


def reading_of(action: Action, sensed: Sensed, session: Session) -> Readings:
    """Return the reading that answers a question, along the motion that was made rather than the requested one.

    Args:
        action: question.
        sensed: result of the motion.
        session: session of the question; if its tip has an error, the reading has the pose of the tool.
    """
    made = replace(action, origin=sensed.start, direction=sensed.direction, max_range=sensed.reach)
    if session.sensing.tip_sd is None:
        return made.read(sensed.distance)
    way = sensed.distance if sensed.hit else sensed.reach
    axes = tool_axes(-session.probe.holders(sensed.direction[None])[0])
    return made.read(sensed.distance, T_world_hand=SE3.from_parts(axes, sensed.start + way * sensed.direction))


def take_up_rows(session: Session, rows: Sequence[tuple[int, Sensed]]) -> int:
    """Pass the stored readings that the session does not have yet to the session; return their number.

    Args:
        session: session, restored from its record.
        rows: stored readings, each with the number of its question.
    """
    question, before = session.pending, {s.action.number for s in session.steps if s.action is not None}
    count = 0
    for number, sensed in rows:
        if number in before or question is None or number != question.number:
            continue
        session.tell(reading_of(question, sensed, session), question)
        count += 1
    return count
