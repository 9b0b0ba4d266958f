"""Fake a Universal Robot: dashboard, program port and RTDE on loopback.

RTDE follows the manufacturer's client (:mod:`tanteo.machines.rtde`). The fake interprets only the URScript statements
that :mod:`tanteo.machines.ur` sends: ``movel``, the thread of a guarded motion, and registers.
"""

from __future__ import annotations

import re
import socket
import struct
import threading
import time
from contextlib import suppress
from typing import Any

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines import rtde
from tanteo.machines.fake import Fake
from tanteo.machines.faults import Faults
from tanteo.machines.server import Server
from tanteo.machines.ur_script import (
    ARRIVED,
    CHANGED,
    HIT,
    NUMBER,
    PLACE,
    PUSHED,
    RESULT,
    START_NEAR,
    TCP_NEAR,
    TRIPPED,
)
from tanteo.machines.world import World

_MOVEL = re.compile(r"movel\(p\[([^\]]+)\], a=([\d.]+), v=([\d.]+)\)")
_NUMBER = re.compile(rf"write_output_integer_register\({NUMBER}, (\d+)\)")
_WANTED = re.compile(r"wanted = p\[([^\]]+)\]")
_START = re.compile(r"point_dist\(get_actual_tcp_pose\(\), p\[([^\]]+)\]\)")
_RESULTS = {"arrived": ARRIVED, "contact": HIT, "tripped": TRIPPED, "pushed": PUSHED}
_MODES = {"running": 7, "normal": 1, "emergency": 6}


class UrFake(Fake):
    """Fake robot whose TCP is the centre of the ball.

    Attributes:
        ports: ports of dashboard, programs and RTDE.
        programs: programs that clients have sent.
        turn: rotation vector of the TCP ``(3,)`` [rad].
        remote: whether the robot is in remote control.
        tcp: offset of the TCP from the flange ``(6,)`` [m, rad].
    """

    def __init__(
        self, world: World, start: Vectors, *, speedup: float = np.inf, faults: Faults | None = None,
        ports: tuple[int, int, int] = (0, 0, 0), remote: bool = True,
    ) -> None:  # fmt: skip
        super().__init__(world, start, speedup, faults)
        self.turn = np.array([np.pi, 0.0, 0.0])
        self.remote, self.tcp = remote, np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
        self.programs = list[str]()
        self._registers: dict[str, Any] = {}
        self._playing, self._safety = False, _MODES["normal"]
        self._busy = threading.Lock()
        self._begun = time.monotonic()
        serve = (self._dashboard, self._program_port, self._rtde)
        self._servers = [Server(one, port) for one, port in zip(serve, ports, strict=True)]
        self.ports = tuple(server.port for server in self._servers)

    def close(self) -> None:
        """Switch the robot off."""
        self.tip.emergency.set()
        for server in self._servers:
            server.close()

    def press_stop(self) -> None:
        """Press the emergency stop."""
        self.tip.emergency.set()
        self._safety = _MODES["emergency"]

    def _drop(self) -> None:
        for server in self._servers:
            server.drop()

    def _dashboard(self, client: socket.socket) -> None:
        client.sendall(b"Connected: Universal Robots Dashboard Server\n")
        for line in client.makefile("r", encoding="ascii", errors="replace"):
            client.sendall((self._answer(line.strip()) + "\n").encode("ascii"))

    def _answer(self, question: str) -> str:
        if question == "stop":
            self._halt()
            return "Stopped"
        return {
            "robotmode": "Robotmode: RUNNING" if self._safety == _MODES["normal"] else "Robotmode: POWER_OFF",
            "safetystatus": "Safetystatus: NORMAL" if self._safety == _MODES["normal"] else
            "Safetystatus: ROBOT_EMERGENCY_STOP",
            "is in remote control": "true" if self.remote else "false",
            "PolyscopeVersion": "URSoftware 5.11.0.0 (fake)",
            "running": f"Program running: {str(self._playing).lower()}",
        }.get(question, f"could not understand: '{question}'")  # fmt: skip

    def _halt(self) -> None:
        """End the running program, and wait until it has ended."""
        self.tip.cancel.set()
        with self._busy:
            self.tip.cancel.clear()

    def _program_port(self, client: socket.socket) -> None:
        text = ""
        while data := client.recv(65536):
            text += data.decode("ascii", "replace")
            while (end := re.search(r"^end\r?\n", text, re.MULTILINE)) is not None:
                program, text = text[: end.end()], text[end.end() :]
                self._halt()
                self._servers[1].start(self._run, program)

    def _run(self, program: str) -> None:
        """Interpret one program."""
        with self._busy:
            self.programs.append(program)
            moves, number = _MOVEL.search(program), _NUMBER.search(program)
            if moves is None or number is None or not self.remote or self._safety != _MODES["normal"]:
                return
            self._registers |= {f"output_int_register_{RESULT}": 0}
            self._registers |= {f"output_int_register_{NUMBER}": int(number[1])}
            if not self._as_expected(program):
                self._registers |= {f"output_int_register_{RESULT}": CHANGED}
                return
            self._playing = True
            try:
                self._move(moves, guarded="thread search()" in program)
            finally:
                self._playing = False

    def _as_expected(self, program: str) -> bool:
        """Return whether TCP and start are those that the program compares them with."""
        wanted, start = (
            np.array([float(v) for v in found[1].split(",")]) if found else None
            for found in (_WANTED.search(program), _START.search(program))
        )
        tcp = wanted is None or float(np.linalg.norm(wanted - self.tcp)) <= TCP_NEAR
        return tcp and (start is None or float(np.linalg.norm(start[:3] - self.tip.place)) <= START_NEAR)

    def _move(self, moves: re.Match[str], *, guarded: bool) -> None:
        pose = np.array([float(v) for v in moves[1].split(",")])
        outcome, place = self._motion(pose[:3], float(moves[3]), guarded=guarded)
        if outcome in ("arrived", "contact"):
            self.turn = pose[3:]
            values = [*place, *self.turn]
            self._registers |= {f"output_double_register_{PLACE + k}": float(v) for k, v in enumerate(values)}
        if outcome != "unreported":
            self._registers |= {f"output_int_register_{RESULT}": _RESULTS[outcome]}

    def _rtde(self, client: socket.socket) -> None:
        buffer, names, types, period = bytearray(), list[str](), list[str](), 0.008
        started = threading.Event()
        while data := client.recv(4096):
            buffer.extend(data)
            for letter, payload in rtde.packages(buffer):
                if letter == rtde.SETUP_OUTPUTS:
                    period = 1.0 / max(struct.unpack(">d", payload[:8])[0], 1.0)
                    names = [
                        name for name in payload[8:].decode("ascii").split(",") if name
                    ]  # ur-rtde ends with a comma
                    types = [rtde.TYPES.get(name, "NOT_FOUND") for name in names]
                client.sendall(self._reply(letter, types))
                if letter == rtde.START and not started.is_set():
                    started.set()
                    self._servers[2].start(self._stream, client, names, types, period)

    @staticmethod
    def _reply(letter: bytes, types: list[str]) -> bytes:
        if letter == rtde.SETUP_OUTPUTS:
            return rtde.package(letter, b"\1" + ",".join(types).encode("ascii"))
        if letter == rtde.CONTROLLER_VERSION:
            return rtde.package(letter, struct.pack(">IIII", 5, 11, 0, 0))
        known = (rtde.REQUEST_VERSION, rtde.START, rtde.PAUSE)
        return rtde.package(letter, b"\1") if letter in known else b""

    def _stream(self, client: socket.socket, names: list[str], types: list[str], period: float) -> None:
        with suppress(OSError):
            while True:
                if not self._silent:
                    client.sendall(rtde.pack(types, [self._value(name) for name in names], 1))
                time.sleep(period)

    def _value(self, name: str) -> Any:
        if rtde.TYPES.get(name) == "VECTOR6D":
            vectors = {"actual_TCP_pose": (*self.tip.place, *self.turn), "tcp_offset": self.tcp}
            return [float(v) for v in vectors.get(name, (0.0,) * 6)]
        if name == "actual_digital_input_bits":
            return int(self.tip.tripped)
        fixed = {
            "timestamp": time.monotonic() - self._begun, "runtime_state": 2 if self._playing else 1,
            "robot_mode": _MODES["running"], "safety_mode": self._safety,
            "robot_status_bits": 3 if self._playing else 1,  # powered, and a program runs
        }  # fmt: skip
        return fixed.get(name, self._registers.get(name, 0.0 if "double" in name else 0))
