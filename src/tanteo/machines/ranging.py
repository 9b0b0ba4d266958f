"""Combine a driver with a range sensor that is read at rest, in place of a touch probe."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines.protocol import Facts, Machine, MachineStatus, RefusedError, Sensed, place_of

_ALONG = 1e-3
"""Largest angle between the sensor's axis and the direction of a requested range [rad]."""


class RangingMachine:
    """Machine with a range sensor on its tool.

    The sensor's beam starts at the machine's position and points along the tool's z, or downwards if the tool cannot
    rotate. No motion stops at a contact, so paths need more clearance than those of a touch probe.

    Args:
        machine: driver of the machine.
        read: function that returns the range at rest [m]; infinite or NaN without an echo.

    Attributes:
        machine: driver of the machine.
        facts: properties of the driver, without contact.

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
        self.machine, self._read = machine, read
        self._axis = np.array([0.0, 0.0, -1.0])
        self.facts: Facts = replace(machine.facts, contact=False, guarded=False)

    def status(self) -> MachineStatus:
        """Return the status of the driver."""
        return self.machine.status()

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Move straight to a pose, without a stop at contacts.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        self.machine.back(T_world_probe, speed, seconds)
        self._axis = T_world_probe[:3, 2] if self.facts.turns else self._axis

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Retract straight to a pose.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        self.move(T_world_probe, speed, seconds)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Measure the range from the current position; the machine does not move.

        Args:
            direction: unit direction of the beam ``(3,)``.
            reach: largest range [m].
            speed: not used.
            seconds: not used.

        Raises:
            RefusedError: the sensor points along another direction.
        """
        if np.linalg.norm(direction - self._axis) > _ALONG:
            raise RefusedError(
                f"{self.facts.name}: expected a range along ({', '.join(f'{v:.3f}' for v in self._axis)}), the axis of "
                "its sensor, got another direction. Request that one."
            )
        begun, start = time.monotonic(), place_of(self.machine)
        echo = float(self._read())
        distance = echo if np.isfinite(echo) and echo <= reach else np.inf
        return Sensed(start, self._axis, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """Abort the driver."""
        self.machine.abort()

    def write_frame(self, text: str, seconds: float) -> None:
        """Send the lines that set a work frame.

        Args:
            text: lines that set a frame.
            seconds: largest duration [s].
        """
        self.machine.write_frame(text, seconds)

    def close(self) -> None:
        """Disconnect the driver."""
        self.machine.close()
