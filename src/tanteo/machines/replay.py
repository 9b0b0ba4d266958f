"""A log as a machine: it goes wherever it is sent, and a touch is answered by the one of the log that is nearest."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from tanteo import io
from tanteo.errors import InputError
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines.protocol import Facts, MachineStatus, RefusedError, Sensed, StoppedError
from tanteo.sensors import Readings, concatenate

_AHEAD, _BEFORE = 0.5, 0.02
"""Cosine to the direction that is asked, of a touch that may answer; how long it was, if the log has it not [m]."""


class ReplayMachine:
    """Readings of a log, each given once.

    Attributes:
        facts: what does not change.
        left: which readings of the log were not given yet.

    Raises:
        InputError: the log has no touch with a direction.
    """

    def __init__(self, readings: Readings, name: str) -> None:
        known = readings.directions.given & readings.points.given
        if not known.any():
            raise InputError(f"{name}: expected touches with directions, got none. Say --direction when it is read.")
        self._readings = readings.take(np.flatnonzero(known))
        self.left = list(range(len(self._readings)))
        self._ranges = self._readings.ranges.filled(_BEFORE)
        self._place = self._readings.points[0] - self._ranges[0] * self._readings.directions[0]
        self._stopped = False
        self.facts = Facts(f"log {name}", guarded=False)

    @classmethod
    def of_file(cls, path: str | Path) -> ReplayMachine:
        """A record of a session, or a file of readings in any format that is known.

        Raises:
            InputError: it is neither.
        """
        if Path(path).suffix.lower() != ".json":
            return cls(io.read_readings(path), str(path))
        record = io.load_record(path)
        told = [one.observation().readings for one in record.observations]
        made = [readings for readings in told if readings is not None]
        if not made:
            raise InputError(f"{path}: expected a session with readings, got none. Take another record.")
        return cls(concatenate(made), str(path))

    def status(self) -> MachineStatus:
        """Always fresh: nothing moves."""
        return MachineStatus("stopped" if self._stopped else "idle", self._place, None, 0.0, f"{len(self.left)} left")

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """At once."""
        self._check()
        self._place = np.array(T_world_probe[:3, 3])

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """At once."""
        self.move(T_world_probe, speed, seconds)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """The touch of the log that is nearest to this line, along its own: what it says is what was touched then.

        Raises:
            RefusedError: none that is left goes in about this direction.
        """
        self._check()
        begun, start, all_ = time.monotonic(), self._place, self._readings
        ahead = [k for k in self.left if all_.directions[k] @ direction > _AHEAD]
        if not ahead:
            raise RefusedError(
                f"{self.facts.name}: expected a touch in about this direction, got none among the {len(self.left)} "
                "that are left. Take a log of more touches."
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
        """For good."""
        self._stopped = True

    def write_frame(self, text: str, seconds: float) -> None:
        """A log takes none."""
        raise RefusedError(f"{self.facts.name}: expected a controller, got a log. Nothing was written.")

    def close(self) -> None:
        """Nothing is held."""
        self._stopped = True

    def _check(self) -> None:
        if self._stopped:
            raise StoppedError(
                f"{self.facts.name}: expected one that may move, got one that has stopped. Open it anew."
            )
