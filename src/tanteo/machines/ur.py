"""Universal Robots: the dashboard for its mode (29999), URScript for motions (30002), RTDE for what it says (30004).

One program a motion. It watches a digital input while a thread moves, as the probing programs of
:mod:`tanteo.programs` do, and writes what came of it to output registers that RTDE carries back. The TCP is the centre
of the ball, its z along the stylus. Read for it: Universal Robots' Script Manual (``movel``, threads,
``write_output_integer_register``) and their RTDE client (see :mod:`tanteo.machines.rtde`).
"""

from __future__ import annotations

import struct
import threading
import time
from typing import Any

import numpy as np

from tanteo.lie import SO3
from tanteo.machines import rtde
from tanteo.machines.link import Link
from tanteo.machines.protocol import (
    ContactError,
    Facts,
    LateError,
    LinkLostError,
    MachineError,
    MachineState,
    MachineStatus,
    RefusedError,
    Sensed,
    StoppedError,
    place_of,
)
from tanteo.typing import Transforms, Vectors

PORTS = 29999, 30002, 30004
"""Of the dashboard, of programs, of RTDE."""
NUMBER, RESULT, PLACE = 24, 25, 24
"""Output registers: a program's number and result (whole numbers), the TCP's pose from here on (six numbers)."""
ARRIVED, MET, TRIPPED = 1, 2, 3
"""Results of a program."""
_OUTPUTS = (
    "timestamp", "actual_TCP_pose", "actual_digital_input_bits", "runtime_state", "robot_mode", "safety_mode",
    f"output_int_register_{NUMBER}", f"output_int_register_{RESULT}",
    *(f"output_double_register_{PLACE + k}" for k in range(6)),
)  # fmt: skip
_FREQUENCY = 125.0
_RUNNING, _NORMAL, _STOPPED, _PLAYING = 7, (1, 2), 1, 2
"""``robot_mode`` and ``safety_mode`` in which it may move; ``runtime_state`` without and with a program."""
_STARTS = 3.0
"""Within which a program must have started [s]."""
_STILL = 1e-6
_SAFETY = {
    3: "a protective stop", 4: "recovery mode", 5: "a safeguard stop", 6: "an emergency stop", 7: "an emergency stop",
    8: "a safety violation", 9: "a safety fault",
}  # fmt: skip

_GUARDED = """def tanteo_{number}():
  global arrived = False
  thread search():
    movel({goal}, a={acceleration:.4f}, v={speed:.6f})
    arrived = True
    while True:
      sync()
    end
  end
  write_output_integer_register({RESULT}, 0)
  write_output_integer_register({NUMBER}, {number})
  if get_standard_digital_in({input}):
    write_output_integer_register({RESULT}, {TRIPPED})
    halt
  end
  handle = run search()
  while not get_standard_digital_in({input}) and not arrived:
    sync()
  end
  here = get_actual_tcp_pose()
  met = get_standard_digital_in({input})
  kill handle
  stopl({brake:.2f})
{places}
  if met:
    write_output_integer_register({RESULT}, {MET})
  else:
    write_output_integer_register({RESULT}, {ARRIVED})
  end
end
"""
_PLAIN = """def tanteo_{number}():
  write_output_integer_register({RESULT}, 0)
  write_output_integer_register({NUMBER}, {number})
  movel({goal}, a={acceleration:.4f}, v={speed:.6f})
  write_output_integer_register({RESULT}, {ARRIVED})
end
"""
STOP = "def tanteo_stop():\n  stopl(5.0)\nend\n"
"""A program that replaces the one that runs."""


class UrMachine:
    """A Universal Robot with a touch probe on a digital input.

    Attributes:
        facts: what does not change.

    Raises:
        StoppedError: it is not running, or not in remote control; neither is changed from here.
        LinkLostError: nobody answers.
    """

    def __init__(self, dashboard: Link, script: Link, data: Link, digital_input: int = 0, seconds: float = 5.0) -> None:
        self._dashboard, self._script, self._data = dashboard, script, data
        self._input, self._number = digital_input, 0
        self._values: dict[str, Any] = {}
        self._at, self._stopped, self._closed = -np.inf, "", False
        self._lost: LinkLostError | None = None
        self._types: list[str] = []
        self.facts = Facts("Universal Robot", turns=True)
        self._listener: threading.Thread | None = None
        try:
            self._begin(time.monotonic() + seconds)
        except MachineError:
            self.close()
            raise

    def status(self) -> MachineStatus:
        """What RTDE said last."""
        values, age = self._values, time.monotonic() - self._at
        if not values:
            return MachineStatus("lost" if self._lost else "stopped")
        words = f"robot_mode {values['robot_mode']}, safety_mode {values['safety_mode']}"
        tripped = bool(values["actual_digital_input_bits"] >> self._input & 1)
        return MachineStatus(self._state(), np.array(values["actual_TCP_pose"][:3]), tripped, age, words)

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """``movel`` beside a watch on the input."""
        if self._guarded(T_world_probe, speed, seconds) is not None:
            where = ", ".join(f"{1e3 * v:.3f}" for v in place_of(self))
            raise ContactError(
                f"{self.facts.name}: expected a free way, met something at ({where}) mm. Give the part more clearance."
            )

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """``movel``."""
        self._run(_PLAIN, T_world_probe, speed, seconds)

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Along the direction, held as it is."""
        begun, start = time.monotonic(), place_of(self)
        T = np.eye(4)
        T[:3, :3] = SO3.exp(np.array(self._values["actual_TCP_pose"][3:]))
        T[:3, 3] = start + reach * direction
        met = self._guarded(T, speed, seconds)
        distance = np.inf if met is None else float((met - start) @ direction)
        return Sensed(start, direction, distance, reach, time.monotonic() - begun)

    def abort(self) -> None:
        """A program that stops replaces the one that runs, and the dashboard stops that; never raises."""
        self._stopped = self._stopped or "it was told to stop"
        for link, text in ((self._script, STOP), (self._dashboard, "stop\n")):
            try:
                link.write(text.encode("ascii"))
            except LinkLostError as error:
                self._lost = self._lost or error

    def write_frame(self, text: str, seconds: float) -> None:
        """No variable of an installation can be set over the wire."""
        raise RefusedError(
            f"{self.facts.name}: expected a controller that takes a frame over the wire, got one whose features are "
            "set at the pendant. Copy the lines of --wcs ur:NAME there."
        )

    def close(self) -> None:
        """Stop what moves, and let go; never raises."""
        if self.status().state == "moving":
            self.abort()
        self._closed = True
        if self._listener is not None:
            self._listener.join(0.5)
        for link in (self._dashboard, self._script, self._data):
            link.close()

    def _state(self) -> MachineState:
        if self._lost is not None:
            return "lost"
        if self._stopped or self._unsafe():
            return "stopped"
        return "moving" if self._values["runtime_state"] == _PLAYING else "idle"

    def _unsafe(self) -> str:
        """Why it may not move by its own word; empty if it may."""
        mode, safety = self._values["robot_mode"], self._values["safety_mode"]
        if safety not in _NORMAL:
            return _SAFETY.get(safety, f"safety_mode {safety}")
        return "" if mode == _RUNNING else f"robot_mode {mode}, which is not running"

    def _begin(self, deadline: float) -> None:
        self._line(deadline)  # its greeting
        version = self._asked("PolyscopeVersion", deadline)
        for question, good, advice in (
            ("robotmode", "RUNNING", "Start it at the pendant"),
            ("safetystatus", "NORMAL", "Clear the stop at the pendant"),
            ("is in remote control", "true", "Switch it to remote control at the pendant"),
        ):
            said = self._asked(question, deadline)
            if good.lower() not in said.lower():
                raise StoppedError(f"{self._dashboard.name}: expected {question}: {good}, got '{said}'. {advice}.")
        self.facts = Facts(
            f"Universal Robot, PolyScope {version.split(' ')[-1] if ' ' in version else version}", turns=True
        )
        self._set_up(deadline)
        self._listener = threading.Thread(target=self._listen, daemon=True, name="rtde")
        self._listener.start()
        while not self._values:
            self._check()
            if time.monotonic() > deadline:
                raise LinkLostError(f"{self._data.name}: expected data of RTDE, got none. Check the connection.")
            time.sleep(0.002)

    def _asked(self, question: str, deadline: float) -> str:
        self._dashboard.write(f"{question}\n".encode("ascii"))
        return self._line(deadline)

    def _line(self, deadline: float) -> str:
        row = b""
        while not row.endswith(b"\n"):
            if time.monotonic() > deadline:
                raise LinkLostError(f"{self._dashboard.name}: expected an answer of the dashboard, got none. Check it.")
            row += self._dashboard.read(0.1)
        return row.decode("utf-8", "replace").strip()

    def _set_up(self, deadline: float) -> None:
        """Protocol, outputs, start."""
        buffer = bytearray()

        def answer(letter: bytes, payload: bytes) -> bytes:
            self._data.write(rtde.package(letter, payload))
            while time.monotonic() < deadline:
                for got, body in rtde.packages(buffer):
                    if got == letter:
                        return body
                buffer.extend(self._data.read(0.1))
            raise LinkLostError(f"{self._data.name}: expected an answer of RTDE, got none. Check the connection.")

        if answer(rtde.REQUEST_VERSION, struct.pack(">H", 2)) != b"\1":
            raise LinkLostError(f"{self._data.name}: expected RTDE protocol 2, got none. Update the controller.")
        recipe = answer(rtde.SETUP_OUTPUTS, struct.pack(">d", _FREQUENCY) + ",".join(_OUTPUTS).encode("ascii"))
        self._types = recipe[1:].decode("ascii").split(",")
        if "NOT_FOUND" in self._types:
            lacks = _OUTPUTS[self._types.index("NOT_FOUND")]
            raise LinkLostError(f"{self._data.name}: expected the output '{lacks}', got none. Update the controller.")
        if answer(rtde.START, b"") != b"\1":
            raise LinkLostError(f"{self._data.name}: expected RTDE to start, got a refusal. Restart the controller.")
        self._rest = buffer

    def _listen(self) -> None:
        """The thread that reads RTDE, and what the program port says, which is dropped."""
        buffer = self._rest
        while not self._closed and self._lost is None:
            try:
                buffer.extend(self._data.read(0.05))
                self._script.read(0.001)
                for letter, payload in rtde.packages(buffer):
                    if letter == rtde.DATA:
                        self._values = dict(zip(_OUTPUTS, rtde.unpack(self._types, payload), strict=True))
                        self._at = time.monotonic()
            except LinkLostError as error:
                self._lost = self._lost or error
            except (ValueError, struct.error) as error:
                self._lost = LinkLostError(f"{self._data.name}: expected packages of RTDE, got {error}. Reconnect.")

    def _guarded(self, T: Transforms, speed: float, seconds: float) -> Vectors | None:
        """A motion that ends at a contact: where the TCP was then ``(3,)``; None without."""
        self._check()
        if self.status().tripped:
            raise ContactError(
                f"{self.facts.name}: expected a probe that is free, got one in contact before it moved. Look at the "
                "stylus and its cable."
            )
        result = self._run(_GUARDED, T, speed, seconds)
        if result == TRIPPED:
            raise ContactError(f"{self.facts.name}: expected a probe that is free, got one in contact. Move it back.")
        if result != MET:
            return None
        return np.array([self._values[f"output_double_register_{PLACE + k}"] for k in range(3)])

    def _run(self, template: str, T: Transforms, speed: float, seconds: float) -> int:
        """One program: its result."""
        self._check()
        deadline, self._number = time.monotonic() + seconds, self._number + 1
        pose = [*T[:3, 3], *SO3.log(T[:3, :3])]
        places = [f"  write_output_float_register({PLACE + k}, here[{k}])" for k in range(6)]
        text = template.format(
            number=self._number, goal="p[" + ", ".join(f"{v + 0.0:.7f}" for v in pose) + "]", speed=speed,
            acceleration=max(0.1, 4 * speed), brake=2.0, input=self._input, places="\n".join(places),
            NUMBER=NUMBER, RESULT=RESULT, ARRIVED=ARRIVED, MET=MET, TRIPPED=TRIPPED,
        )  # fmt: skip
        self._send(text)
        self._started(time.monotonic() + min(_STARTS, seconds))
        while True:
            self._check()
            values = self._values
            result = int(values[f"output_int_register_{RESULT}"])
            if result and values["runtime_state"] != _PLAYING:
                self._next_package(deadline)  # the position in this one may be of before
                return result
            if not result and values["runtime_state"] == _STOPPED and self._is_over():
                raise self._stop("a program that ended before its motion did")
            self._late(deadline, "the motion's end")
            time.sleep(0.001)

    def _next_package(self, deadline: float) -> None:
        """Wait for what is said from now on."""
        seen = time.monotonic()
        while self._at <= seen:
            self._check()
            self._late(deadline, "its position after a motion")
            time.sleep(0.001)

    def _is_over(self) -> bool:
        """Whether it is still so after a few packages: result and state may come in two."""
        seen = self._at
        while self._at < seen + 4 / _FREQUENCY and self._lost is None and time.monotonic() < seen + 1.0:
            time.sleep(0.002)
        values = self._values
        return not values[f"output_int_register_{RESULT}"] and values["runtime_state"] == _STOPPED

    def _started(self, deadline: float) -> None:
        while int(self._values[f"output_int_register_{NUMBER}"]) != self._number:
            self._check()
            self._late(deadline, "the program's start: is it in remote control?")
            time.sleep(0.001)

    def _late(self, deadline: float, what: str) -> None:
        if time.monotonic() > deadline:
            self.abort()
            raise LateError(f"{self.facts.name}: expected {what} in time, got none. It was told to stop: look at it.")

    def _send(self, text: str) -> None:
        try:
            self._script.write(text.encode("ascii"))
        except LinkLostError as error:
            self._lost = self._lost or error
            raise

    def _check(self) -> None:
        if self._lost is not None:
            raise self._lost
        why = self._stopped or (self._unsafe() if self._values else "")
        if why:
            self._stopped = why
            raise StoppedError(
                f"{self.facts.name}: expected a machine that may move, got one that has stopped: {why}. "
                "Clear it at the pendant, and start again."
            )

    def _stop(self, got: str) -> StoppedError:
        self.abort()
        return StoppedError(f"{self.facts.name}: expected its motion to be done, got {got}. It was told to stop.")
