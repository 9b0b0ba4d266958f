"""A log as a machine: it goes wherever it is sent, and a touch is answered if the log has one along that line."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from tanteo import io
from tanteo.errors import InputError
from tanteo.machines.protocol import Facts, MachineStatus, RefusedError, Sensed, StoppedError
from tanteo.sensors import Readings, concatenate
from tanteo.typing import Transforms, Vectors

_BESIDE, _TURNED = 2e-4, 0.02
"""A touch of the log is of a line that passes so near to it [m], at so small an angle [rad]."""


class ReplayMachine:
    """Readings of a log, each given once.

    Attributes:
        facts: what does not change.
        left: which readings of the log were not given yet.

    Raises:
        InputError: the log has no touch with a direction.
    """

    def __init__(self, readings: Readings, name: str) -> None:
        known = ~np.isnan(readings.directions).any(axis=1) & ~np.isnan(readings.points).any(axis=1)
        if not known.any():
            raise InputError(f"{name}: expected touches with directions, got none. Say --direction when it is read.")
        self._readings = readings.take(np.flatnonzero(known))
        self.left = list(range(len(self._readings)))
        away = np.nan_to_num(self._readings.ranges[0], nan=0.02)
        self._place = self._readings.points[0] - away * self._readings.directions[0]
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
        """The first touch of the log along this line.

        Raises:
            RefusedError: the log has none.
        """
        self._check()
        begun, start, all_ = time.monotonic(), self._place, self._readings
        for k in self.left:
            turned = float(np.linalg.norm(all_.directions[k] - direction))
            if all_.is_free[k]:
                met, off = False, float(np.linalg.norm(all_.points[k] - start))
            else:
                along = float((all_.points[k] - start) @ direction)
                met, off = 0 < along <= reach, float(np.linalg.norm(all_.points[k] - start - along * direction))
            if turned < _TURNED and off < _BESIDE and (met or all_.is_free[k]):
                self.left.remove(k)
                distance = along if met else np.inf
                self._place = start + (distance if met else reach) * direction
                return Sensed(start, direction, distance, reach, time.monotonic() - begun)
        raise RefusedError(
            f"{self.facts.name}: expected a touch along this line, got none among the {len(self.left)} that are left. "
            "Ask as the session of the log did."
        )

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
