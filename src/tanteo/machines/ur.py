"""Drive Universal Robots: dashboard for the mode (29999), URScript for motions (30002), RTDE for the status (30004).

Each motion is one program (:mod:`tanteo.machines.ur_script`), whose result RTDE returns
(:mod:`tanteo.machines.rtde`). The TCP is the centre of the ball, its z along the stylus.
"""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines import ur_script
from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.protocol import (
    ContactError,
    Facts,
    LinkLostError,
    MachineState,
    MachineStatus,
    RefusedError,
    Sensed,
    in_mm,
    place_of,
)
from tanteo.machines.rtde import RtdeClient
from tanteo.machines.ur_dashboard import ready_version
from tanteo.machines.ur_script import (
    ARRIVED,
    BRAKE,
    CHANGED,
    HIT,
    NUMBER,
    PLACE,
    PUSHED,
    RESULT,
    START_NEAR,
    STOP,
    TCP_NEAR,
    TRIPPED,
    Way,
)

PORTS = 29999, 30002, 30004
"""Ports of the dashboard, of programs and of RTDE."""
_OUTPUTS = (
    "timestamp", "actual_TCP_pose", "tcp_offset", "actual_digital_input_bits", "runtime_state", "robot_mode",
    "safety_mode", f"output_int_register_{NUMBER}", f"output_int_register_{RESULT}",
    *(f"output_double_register_{PLACE + k}" for k in range(6)),
)  # fmt: skip
_FREQUENCY = 125.0
_RUNNING, _NORMAL, _STOPPED, _PLAYING = 7, (1, 2), 1, 2
"""``robot_mode`` and ``safety_mode`` in which the robot may move; ``runtime_state`` without and with a program."""
_STATES: dict[int, MachineState] = {0: "moving", 1: "idle", 2: "moving", 3: "moving", 4: "held", 5: "moving"}
"""States by ``runtime_state``: stopping, stopped, playing, pausing, paused, resuming."""
_FINISHES = 1.0
"""Largest time from a stop to the end of the program [s]."""
_STARTS = 3.0
"""Largest time until a program has started [s]."""
FORCE = 50.0
"""Increase of the force during a guarded motion at which it ends [N], in case the probe does not trip."""
_SAFETY = {
    3: "a protective stop", 4: "recovery mode", 5: "a safeguard stop", 6: "an emergency stop", 7: "an emergency stop",
    8: "a safety violation", 9: "a safety fault",
}  # fmt: skip


class UrMachine:
    """Driver of a Universal Robot with a touch probe on a digital input.

    Attributes:
        facts: constant properties of the machine.

    Raises:
        StoppedError: the robot is not running, or not in remote control; the driver does not change that.
        LinkLostError: no controller answers.
    """

    def __init__(
        self, dashboard: Link, script: Link, data: Link, digital_input: int = 0, force: float = FORCE,
        seconds: float = 5.0,
    ) -> None:  # fmt: skip
        self._dashboard, self._script, self._data = dashboard, script, data
        self._input, self._force, self._number, self._closed = digital_input, force, 0, False
        self._moving, self._tcp = False, np.full(6, np.nan)
        self._rest: Vectors | None = None
        self._rtde: RtdeClient | None = None
        self._latch = Latch("Universal Robot", "Clear it at the pendant", self.abort)
        self.facts = Facts("Universal Robot", turns=True, deceleration=BRAKE)
        self._listener: threading.Thread | None = None
        try:
            self._begin(time.monotonic() + seconds)
        except BaseException:
            self.close()
            raise

    def status(self) -> MachineStatus:
        """Return the most recent status from RTDE."""
        rtde = self._rtde
        if rtde is None or not rtde.values:
            return MachineStatus(self._latch.state("stopped"))
        values, age = rtde.values, time.monotonic() - rtde.at
        words = f"robot_mode {values['robot_mode']}, safety_mode {values['safety_mode']}"
        tripped = bool(values["actual_digital_input_bits"] >> self._input & 1)
        pose = np.array(values["actual_TCP_pose"])
        return MachineStatus(self._state(), pose[:3], tripped, age, words, SO3.exp(pose[3:]))

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Move straight to a pose by ``movel``, and stop at a contact.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].

        Raises:
            ContactError: the probe touched something, was in contact at the start, or felt a force.
            StoppedError: the robot has stopped.
        """
        if self._guarded(T_world_probe, speed, seconds)[0]:
            raise self._latch.contact_error(place_of(self))

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Retract straight to a pose by ``movel``.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        self._run(ur_script.plain(self._way(T_world_probe, speed)), seconds)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Move along a direction until contact, with constant orientation.

        Args:
            direction: unit direction ``(3,)``.
            reach: largest distance [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        begun, start = time.monotonic(), place_of(self)
        T = np.eye(4)
        T[:3, :3] = SO3.exp(np.array(self._values["actual_TCP_pose"][3:]))
        T[:3, 3] = start + reach * direction
        hit, reported = self._guarded(T, speed, seconds)
        distance = float((reported - start) @ direction) if hit else np.inf
        return Sensed(start, direction, distance, reach, time.monotonic() - begun, reported)

    def abort(self) -> None:
        """Replace the running program by one that stops, and stop that by the dashboard; never raises."""
        self._latch.stop("a stop was commanded")
        for link, text in ((self._script, STOP), (self._dashboard, "stop\n")):
            self._latch.send(link, text.encode("ascii"))

    def write_frame(self, text: str, seconds: float) -> None:
        """Refuse, because no interface can set a feature of the installation.

        Args:
            text: lines that set a frame.
            seconds: not used.

        Raises:
            RefusedError: always.
        """
        raise RefusedError(
            f"{self.facts.name}: expected a controller with frames that can be set remotely, got one whose features "
            "are set at the pendant. Copy the lines of --wcs ur:NAME there."
        )

    def close(self) -> None:
        """Stop a running motion, wait until its program has ended, and disconnect; never raises."""
        if self._moving or self.status().state == "moving":
            self.abort()
        self._finish_stop()
        self._closed = True
        if self._listener is not None:
            self._listener.join(0.5)
        for link in (self._dashboard, self._script, self._data):
            link.close()

    def _finish_stop(self) -> None:
        """Wait, for a bounded time, until the program of a robot that was stopped has ended."""
        end = time.monotonic() + _FINISHES
        while self._latch.stopped and self._values and self._latch.lost is None and time.monotonic() < end:
            if self._at > end - _FINISHES and self._values["runtime_state"] == _STOPPED:
                return
            time.sleep(0.005)

    def _state(self) -> MachineState:
        state = _STATES.get(self._values["runtime_state"], "stopped")
        return self._latch.state("stopped" if self._unsafe() else state)

    def _unsafe(self) -> str:
        """Return why the robot must not move according to its status; empty if it may."""
        mode, safety = self._values["robot_mode"], self._values["safety_mode"]
        if safety not in _NORMAL:
            return _SAFETY.get(safety, f"safety_mode {safety}")
        return "" if mode == _RUNNING else f"robot_mode {mode}, which is not running"

    def _begin(self, deadline: float) -> None:
        self.facts = replace(self.facts, name=f"Universal Robot, PolyScope {ready_version(self._dashboard, deadline)}")
        self._latch.name = self.facts.name
        self._rtde = RtdeClient(self._data, _OUTPUTS, _FREQUENCY, deadline)
        self._listener = threading.Thread(target=self._listen, daemon=True, name="rtde")
        self._listener.start()
        while not self._values:
            self._check()
            if not time.monotonic() <= deadline:
                raise LinkLostError(f"{self._data.name}: expected data of RTDE, got none. Check the connection.")
            time.sleep(0.002)
        self._tcp = np.array(self._values["tcp_offset"])

    @property
    def _values(self) -> dict[str, Any]:
        return {} if self._rtde is None else self._rtde.values

    @property
    def _at(self) -> float:
        return -np.inf if self._rtde is None else self._rtde.at

    def _listen(self) -> None:
        """Read RTDE in a thread, and discard the output of the program port."""
        while not self._closed and self._latch.lost is None and self._rtde is not None:
            try:
                self._rtde.listen(0.05)
                self._script.read(0.001)
            except LinkLostError as error:
                self._latch.lose(error)
                self.abort()

    def _way(self, T: Transforms, speed: float) -> Way:
        """Return a motion from the current pose, after a check that nothing but this driver has moved the robot."""
        self._check()
        values = self._values
        if (state := values["runtime_state"]) != _STOPPED:
            raise self._latch.changed(f"runtime_state {state} in place of {_STOPPED}: another program runs")
        has = np.array(values["tcp_offset"])
        if not (np.abs(has - self._tcp) <= TCP_NEAR).all():
            raise self._latch.changed(f"the TCP {has.tolist()} in place of {self._tcp.tolist()}")
        pose = values["actual_TCP_pose"]
        if self._rest is not None and not np.linalg.norm(np.array(pose[:3]) - self._rest) <= START_NEAR:
            raise self._latch.changed(f"the position {in_mm(np.array(pose[:3]))} in place of {in_mm(self._rest)}")
        return Way(self._next(), pose, T, speed, self._tcp.tolist())

    def _next(self) -> int:
        """Return the number of the next program."""
        self._number += 1
        return self._number

    def _guarded(self, T: Transforms, speed: float, seconds: float) -> tuple[bool, Vectors]:
        """Make a guarded motion; return whether there was a contact, and where the TCP was at the end ``(3,)`` [m]."""
        self._check()
        if self.status().tripped:
            raise self._latch.in_contact()
        result = self._run(ur_script.guarded(self._way(T, speed), self._input, self._force), seconds)
        if result == TRIPPED:
            raise self._latch.in_contact()
        if result == PUSHED:
            raise ContactError(
                f"{self.facts.name}: expected a probe that trips, got a force of more than {self._force:g} N without a "
                "contact. The robot has stopped: check the stylus and its cable."
            )
        return result == HIT, self._reported()

    def _reported(self) -> Vectors:
        return np.array([self._values[f"output_double_register_{PLACE + k}"] for k in range(3)])

    def _run(self, program: str, seconds: float) -> int:
        """Run one program, and return its result."""
        self._check()
        self._moving, self._rest = True, None
        deadline = time.monotonic() + seconds
        try:
            self._script.write(program.encode("ascii"))
        except LinkLostError as error:
            self._latch.lose(error)
            raise
        self._started(time.monotonic() + min(_STARTS, seconds))
        while True:
            self._check()
            values = self._values
            result = int(values[f"output_int_register_{RESULT}"])
            if result and values["runtime_state"] != _PLAYING:
                self._next_package(deadline)  # the position in this package may be older than the result
                place = self._reported()
                self._next_package(deadline)
                return self._accepted(result, place)
            if not result and values["runtime_state"] == _STOPPED and self._is_over():
                raise self._latch.failed("a program that ended before its motion did")
            self._latch.late(deadline, "the motion's end")
            time.sleep(0.001)

    def _accepted(self, result: int, place: Vectors) -> int:
        """Return the result of a program if it is known, and still the same in a later package."""
        after, there = int(self._values[f"output_int_register_{RESULT}"]), self._reported()
        if result not in (ARRIVED, HIT, TRIPPED, PUSHED, CHANGED):
            raise self._latch.bent(f"result {result}", "a result of its program")
        if after != result or not np.array_equal(place, there):
            first, second = f"{result} at {in_mm(place)}", f"{after} at {in_mm(there)}"
            raise self._latch.bent(f"{first}; {second}", "one result of its program")
        if int(self._values[f"output_int_register_{NUMBER}"]) != self._number:
            raise self._latch.changed("the number of another program")
        self._moving = False
        if result == CHANGED:
            raise self._latch.changed("another TCP or start when its program began")
        self._rest = place_of(self)
        return result

    def _next_package(self, deadline: float) -> None:
        """Wait for a package that arrives from now on."""
        seen = time.monotonic()
        while self._at <= seen:
            self._check()
            self._latch.late(deadline, "its position after a motion")
            time.sleep(0.001)

    def _is_over(self) -> bool:
        """Return whether the program has ended without a result, also after a few more packages.

        Result and state may arrive in different packages.
        """
        seen = self._at
        while self._at < seen + 4 / _FREQUENCY and self._latch.lost is None and time.monotonic() < seen + 1.0:
            time.sleep(0.002)
        values = self._values
        return not values[f"output_int_register_{RESULT}"] and values["runtime_state"] == _STOPPED

    def _started(self, deadline: float) -> None:
        while int(self._values[f"output_int_register_{NUMBER}"]) != self._number:
            self._check()
            self._latch.late(deadline, "the program's start: is it in remote control?")
            time.sleep(0.001)

    def _check(self) -> None:
        if self._latch.lost is None and self._values and (why := self._unsafe()):
            self._latch.stop(why)
        self._latch.check()
