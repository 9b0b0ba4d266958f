"""Replay a log as a machine: it accepts every motion, and answers a touch with the nearest recorded one."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from tanteo import io
from tanteo.errors import InputError, ReadingsError
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines.protocol import Facts, MachineStatus, RefusedError, Sensed, StoppedError
from tanteo.sensors import Readings

_AHEAD, _BEFORE = 0.5, 0.02
"""Smallest cosine of the angle between recorded and requested directions, and default length of a touch [m]."""
_INSTEAD = "Replay a record (tanteo probe --record); tanteo next names the next touch after any log."


class ReplayMachine:
    """Machine that returns each reading of a log once.

    Attributes:
        facts: constant properties of the machine.
        left: indices of the readings that it has not returned yet.

    Raises:
        InputError: the log has no touch with a direction.
    """

    def __init__(self, readings: Readings, name: str) -> None:
        known = readings.directions.given & readings.points.given
        if not known.any():
            raise InputError(f"{name}: expected touches with directions, got none. {_INSTEAD}")
        self._readings = readings.take(np.flatnonzero(known))
        self.left = list(range(len(self._readings)))
        self._ranges = self._readings.ranges.filled(_BEFORE)
        self._place = self._readings.points[0] - self._ranges[0] * self._readings.directions[0]
        self._stopped = False
        self.facts = Facts(f"log {name}", guarded=False, recorded=True)

    @classmethod
    def of_file(cls, path: str | Path) -> ReplayMachine:
        """Return the machine that replays a session record, or a readings file in any supported format.

        Args:
            path: file of the record or the readings.

        Raises:
            InputError: the file is neither, or lacks what a session needs.
        """
        try:
            return cls(io.read_readings(path), str(path))
        except ReadingsError as error:
            if "expected --" not in str(error):
                raise
            raise InputError(
                f"{path}: expected the record of a session, or a table that states direction and radius of each touch, "
                f"got a log without. {_INSTEAD}"
            ) from None

    def status(self) -> MachineStatus:
        """Return the current status, whose age is always zero."""
        return MachineStatus("stopped" if self._stopped else "idle", self._place, None, 0.0, f"{len(self.left)} left")

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Move to a pose without delay.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: not used.
            seconds: not used.
        """
        self._check()
        self._place = np.array(T_world_probe[:3, 3])

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Retract to a pose without delay.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: not used.
            seconds: not used.
        """
        self.move(T_world_probe, speed, seconds)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Return the recorded touch nearest to the line of motion, with its own start and direction.

        Args:
            direction: unit direction ``(3,)``.
            reach: largest distance [m].
            speed: not used.
            seconds: not used.

        Raises:
            RefusedError: no remaining touch has approximately this direction.
        """
        self._check()
        begun, start, all_ = time.monotonic(), self._place, self._readings
        ahead = [k for k in self.left if all_.directions[k] @ direction > _AHEAD]
        if not ahead:
            raise RefusedError(
                f"{self.facts.name}: expected a touch in approximately this direction, got none among the remaining "
                f"{len(self.left)}. Use a log with more touches."
            )
        off = np.cross(all_.points[ahead] - start, direction)
        k = ahead[int(np.argmin(np.linalg.norm(off, axis=1)))]
        self.left.remove(k)
        way, spent = all_.directions[k], time.monotonic() - begun
        if all_.is_free[k]:
            self._place = np.array(all_.points[k])
            return Sensed(self._place, way, np.inf, reach, spent)
        distance = min(float(self._ranges[k]), reach)
        self._place = np.array(all_.points[k])
        return Sensed(self._place - distance * way, way, distance, reach, spent)

    def abort(self) -> None:
        """Stop permanently."""
        self._stopped = True

    def write_frame(self, text: str, seconds: float) -> None:
        """Refuse, because a log has no controller.

        Args:
            text: lines that set a frame.
            seconds: not used.

        Raises:
            RefusedError: always.
        """
        raise RefusedError(f"{self.facts.name}: expected a controller, got a log. Nothing was written.")

    def close(self) -> None:
        """Stop permanently; there is nothing to disconnect."""
        self._stopped = True

    def _check(self) -> None:
        if self._stopped:
            raise StoppedError(
                f"{self.facts.name}: expected a machine that can move, got a stopped one. Open it again."
            )
