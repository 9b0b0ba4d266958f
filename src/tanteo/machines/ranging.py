"""A machine that carries a range sensor instead of a touch probe: it goes there, rests, and the sensor is read."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines.protocol import Facts, Machine, MachineStatus, RefusedError, Sensed, place_of

_ALONG = 1e-3
"""Angle to where the sensor looks at which a range may be asked for [rad]."""


class RangingMachine:
    """A driver, and what reads the sensor on it.

    The sensor looks along the tool's z, downwards where the tool does not turn, from the machine's place. Nothing stops
    a motion where something is met, so its ways need more clearance than those of a probe.

    Attributes:
        machine: the driver.
        facts: of it, without contact.

    Example:
        >>> import numpy as np
        >>> from tanteo.machines.direct import DirectMachine
        >>> from tanteo.machines.ranging import RangingMachine
        >>> from tanteo.machines.world import World
        >>> from tanteo.parts import Surface
        >>> there = Surface(np.eye(3), np.array([[0, 1, 2]]))
        >>> driver = DirectMachine(World(there, np.eye(4)), np.array([0.0, 0.0, 0.2]))
        >>> RangingMachine(driver, lambda: 0.05).sense(np.array([0.0, 0.0, -1.0]), 0.3, 0.01, 1.0).distance
        0.05
    """

    def __init__(self, machine: Machine, read: Callable[[], float]) -> None:
        """With ``read``, the range at rest [m]; infinite or NaN for no echo."""
        self.machine, self._read = machine, read
        self._looks = np.array([0.0, 0.0, -1.0])
        self.facts: Facts = replace(machine.facts, contact=False, guarded=False)

    def status(self) -> MachineStatus:
        """Of the driver."""
        return self.machine.status()

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there."""
        self.machine.back(T_world_probe, speed, seconds)
        self._looks = T_world_probe[:3, 2] if self.facts.turns else self._looks

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight there."""
        self.move(T_world_probe, speed, seconds)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """The range from here; nothing moves.

        Raises:
            RefusedError: the sensor looks elsewhere.
        """
        if np.linalg.norm(direction - self._looks) > _ALONG:
            raise RefusedError(
                f"{self.facts.name}: expected a range along ({', '.join(f'{v:.3f}' for v in self._looks)}), where its "
                "sensor looks, got another direction. Ask for that one."
            )
        begun, start = time.monotonic(), place_of(self.machine)
        met = float(self._read())
        distance = met if np.isfinite(met) and met <= reach else np.inf
        return Sensed(start, self._looks, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """Of the driver."""
        self.machine.abort()

    def write_frame(self, text: str, seconds: float) -> None:
        """By the driver."""
        self.machine.write_frame(text, seconds)

    def close(self) -> None:
        """Let go of the driver."""
        self.machine.close()
