"""Fake LinuxCNC: linuxcncrsh on a port of loopback, with an interpreter of the blocks that the driver sends.

Sources: those of the driver (:mod:`tanteo.machines.linuxcnc`), and recorded answers of LinuxCNC 2.9.
"""

from __future__ import annotations

import queue
import re
import socket
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.fake import Fake
from tanteo.machines.faults import Faults
from tanteo.machines.gcode import Modal
from tanteo.machines.linuxcnc import CONNECT, ENABLE
from tanteo.machines.server import Server
from tanteo.machines.world import World


class LinuxCncFake(Fake):
    """Fake LinuxCNC machine with three axes and a touch probe, under linuxcncrsh.

    Attributes:
        modal: modal state of the interpreter.
        received: requests that clients have sent.
    """

    def __init__(
        self, world: World, start: Vectors, *, speedup: float = np.inf, faults: Faults | None = None, port: int = 0,
        offset: Vectors | None = None, turn: float = 0.0, metric: bool = True, on: bool = True, thief: int = 0,
    ) -> None:  # fmt: skip
        super().__init__(world, start, speedup, faults)
        self.modal = Modal({1: np.zeros(3) if offset is None else np.asarray(offset, dtype=np.float64)})
        self.received = list[str]()
        self._unit, self._thief = _MM if metric else 25.4e-3, thief
        self.modal.turns[1] = np.radians(turn)
        self._estop, self._on, self._mode, self._error = False, on, "MANUAL", ""
        self._display, self._running = list[str](), False
        self._probed = np.zeros(4)
        self._blocks: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._server = Server(self._serve, port)
        self._server.start(self._interpret)
        self.ports = (self._server.port,)

    def close(self) -> None:
        """Switch the machine off."""
        self.tip.emergency.set()
        self._blocks.put(None)
        self._server.close()

    def press_stop(self) -> None:
        """Press the emergency stop."""
        self.tip.emergency.set()
        self._estop, self._on = True, False

    def _serve(self, client: socket.socket) -> None:
        state = _Client()
        rest = b""
        while data := client.recv(4096):
            *rows, rest = re.split(rb"[\r\n]+", rest + data)
            for row in rows:
                answer = self._answer(row.decode("ascii", "replace").strip(), state)
                if answer and not self._silent:
                    client.sendall(answer.encode("ascii"))

    def _answer(self, row: str, client: _Client) -> str:
        """Return the answer to a request; empty if it has none."""
        self.received.append(row)
        word, _, rest = row.partition(" ")
        name, _, value = rest.partition(" ")
        if word.lower() == "hello":
            client.known = name == CONNECT
            return "HELLO ACK EMCNETSVR 1.1\r\n" if client.known else "HELLO NAK\r\n"
        if word.lower() == "get" and client.known:
            value_text = self._get(name.upper(), client)
            return f"GET {name.upper()} NAK\r\n\r\n" if value_text is None else f"{name.upper()} {value_text}\r\n"
        if word.lower() == "set" and client.known:
            done = self._set(name.lower(), value, client)
            spoken = client.verbose or not done
            return f"SET {name.upper()} {'ACK' if done else 'NAK'}\n\r" if spoken and name.lower() != "enable" else ""
        return ""

    def _get(self, name: str, client: _Client) -> str | None:
        fixed: dict[str, Callable[[], str]] = {
            "ESTOP": lambda: _on(self._estop), "MACHINE": lambda: _on(self._on), "MODE": lambda: self._mode,
            "ENABLE": lambda: _on(client.enabled),
            "PROBE_VALUE": lambda: str(int(self.tip.tripped)),
            "PROGRAM_STATUS": lambda: "RUNNING" if self._running or not self._blocks.empty() else "IDLE",
            "ABS_ACT_POS": lambda: " ".join(f"{v:.6f}" for v in (*(self.tip.place / self._unit + 0.0), 0.0, 0.0, 0.0)),
            "USER_LINEAR_UNITS": lambda: "MM" if self._unit == _MM else "INCH",
            "OPERATOR_DISPLAY": lambda: self._display.pop(0) if self._display else "OK", "ERROR": self._take_error,
        }  # fmt: skip
        return fixed[name]() if name in fixed else None

    def _take_error(self) -> str:
        error, self._error = self._error, ""
        return error or "OK"

    def _set(self, name: str, value: str, client: _Client) -> bool:
        """Carry out a ``SET`` request; return whether it succeeds."""
        if name == "enable":
            client.enabled = value == ENABLE
            return True
        if name in ("echo", "verbose"):
            client.verbose = client.verbose if name == "echo" else value == "on"
            return True
        if not client.enabled:
            return False
        if name == "abort":
            self._abort()
        elif name == "mode":
            self._mode = value.upper()
        elif name == "mdi":
            if self._estop or not self._on or self._mode != "MDI":
                return False
            self._blocks.put(value)
        return name in ("abort", "mode", "mdi")

    def _abort(self) -> None:
        while not self._blocks.empty():
            with suppress(queue.Empty):
                self._blocks.get_nowait()
        if self._running:
            self.tip.cancel.set()

    def _interpret(self) -> None:
        while (line := self._blocks.get()) is not None:
            self._running = True
            try:
                self._run(line)
            finally:
                self._running = False
                self.tip.cancel.clear()

    def _run(self, line: str) -> None:
        if line.lower().startswith("(debug,"):
            self._debug(line[7:].rstrip(")"))
            return
        try:
            block = self.modal.read(line)
        except ValueError:
            self._error = f"Bad number format in '{line}'"
            return
        if block.conflicts:
            self._error = "Two G codes used from same modal group"
        elif block.of_machine and self.modal.motion not in ("0", "1"):
            self._error = "Must use G0 or G1 with G53"
        elif block.sets:
            self.modal.set_offset(block)
        elif block.moves:
            self._move(self.modal.goal(block, self.tip.place))
        elif unknown := block.codes - _KNOWN:
            self._error = f"Unknown G code used: G{min(unknown)}"

    def _debug(self, text: str) -> None:
        if self._thief:  # another display takes the message
            self._thief -= 1
            return
        self._display.append(re.sub(r"#(\d+|<\w+>)", lambda found: f"{self._parameter(found[1]):.6f}", text))

    def _parameter(self, name: str) -> float:
        """Return a parameter of the interpreter: contacts in the program's unit, offsets in the machine's unit."""
        modal = self.modal
        named = {
            "<_metric>": modal.unit == _MM, "<_absolute>": modal.absolute, "<_units_per_minute>": modal.per_minute,
            "<_spindle_on>": False, "5220": modal.active,
        }  # fmt: skip
        if name in named:
            return float(named[name])
        number = int(name)
        if number == 5070:
            return float(self._probed[3])
        if 5061 <= number <= 5063:
            return float(self.modal.program(self._probed[:3])[number - 5061] / self.modal.unit)
        slot, k = divmod(number - 5201, 20)
        if slot >= 1 and k < 3:
            return float(self.modal.offsets.get(slot, np.zeros(3))[k] / self._unit)
        return float(np.degrees(self.modal.turns.get(slot, 0.0))) if k == 9 and slot >= 1 else 0.0

    def _drop(self) -> None:
        self._server.drop()

    def _move(self, goal: Vectors) -> None:
        guarded = self.modal.motion.startswith("38")
        outcome, place = self._motion(goal, self.modal.feed, guarded=guarded)
        if outcome == "tripped":
            self._error = "Probe is already tripped when starting G38.2 or G38.3 move"
        elif guarded and outcome in ("arrived", "contact"):
            self._probed = np.array([*place, float(outcome == "contact")])


class _Client:
    """State of one connection in linuxcncrsh."""

    def __init__(self) -> None:
        self.known, self.enabled, self.verbose = False, False, False


def _on(state: bool) -> str:
    return "ON" if state else "OFF"


_MM = 1e-3
_KNOWN = frozenset(
    {"0", "1", "10", "20", "21", "38.2", "38.3", "40", "49", "53", "54", "55", "56", "57", "58", "59", "80", "90", "91"}
    | {"93", "94"}
)
