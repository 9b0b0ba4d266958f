"""Fake a GRBL 1.1 controller on a TCP port of loopback, or on a pseudo-terminal.

Sources: those of the driver (gnea/grbl: ``doc/markdown/interface.md``, ``commands.md``, ``grbl/motion_control.c``,
``grbl/protocol.c``, ``grbl/report.c``). Real-time characters are taken out of the stream, ``G38.2`` and ``G38.3``
answer after the motion, a feed hold pauses a motion until ``~`` or a reset, a reset restores the default modes, and an
alarm locks all but ``$`` commands.
"""

from __future__ import annotations

import os
import queue
import select
import socket
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from tanteo.geometry.typing import Vectors
from tanteo.machines.fake import Fake
from tanteo.machines.faults import Faults
from tanteo.machines.gcode import Modal
from tanteo.machines.server import Server
from tanteo.machines.world import World

_RAPID = 0.1
"""Speed of ``G0`` [m/s]."""
_WITH_OFFSET = 10
"""Number of status reports of which one has the offsets (``WCO``): ``REPORT_WCO_REFRESH_IDLE_COUNT`` of GRBL."""


class GrblFake(Fake):
    """Fake GRBL controller with three axes and a touch probe.

    Attributes:
        modal: modal state of the interpreter, including the work offsets.
        received: lines that clients have sent.
    """

    def __init__(
        self, world: World, start: Vectors, *, speedup: float = np.inf, faults: Faults | None = None, port: int = 0,
        offset: Vectors | None = None, inches: bool = False, work_positions: bool = False, alarm: str = "",
    ) -> None:  # fmt: skip
        super().__init__(world, start, speedup, faults)
        self.modal = Modal({1: np.zeros(3) if offset is None else np.asarray(offset, dtype=np.float64)})
        self.received = list[str]()
        self._inches, self._work_positions, self._alarm = inches, work_positions, alarm
        self._send: Callable[[bytes], None] = _no_client
        self._hang_up: Callable[[], None] = _no_client
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._closed, self._reports, self._probed, self._check_mode = False, 0, "0.000,0.000,0.000:0", False
        self._server = Server(self._serve, port)
        self.ports = (self._server.port,)

    def close(self) -> None:
        """Switch the controller off."""
        self._closed = True
        self._lines.put(None)
        self._server.close()
        self._send = self._hang_up = _no_client  # keep no reference to the connection

    def press_stop(self) -> None:
        """Press the emergency stop: the drives lose power, and the controller resets."""
        self.tip.emergency.set()
        self._alarm = "3" if self.tip.moving else "1"
        self._send_rows(f"ALARM:{self._alarm}", "", "Grbl 1.1h ['$' for help]", "[MSG:'$H'|'$X' to unlock]")

    def terminal(self) -> str:
        """Return the name of a new pseudo-terminal that behaves as the serial port of the controller (POSIX only)."""
        import pty
        import tty

        ours, theirs = pty.openpty()
        tty.setraw(ours)
        tty.setraw(theirs)

        def write(data: bytes) -> None:
            with suppress(OSError):
                os.write(ours, data)

        def read() -> bytes:
            while not self._closed:
                if select.select([ours], [], [], 0.05)[0]:
                    return os.read(ours, 4096)
            return b""

        self._server.start(self._talk, read, write, lambda: os.close(ours))
        return os.ttyname(theirs)

    def _serve(self, client: socket.socket) -> None:
        self._talk(lambda: client.recv(4096), client.sendall, self._server.drop)

    def _talk(self, read: Callable[[], bytes], send: Callable[[bytes], None], hang_up: Callable[[], None]) -> None:
        """Serve one client: real-time characters immediately, lines in a thread of their own."""
        self._send, self._hang_up, self._lines = send, hang_up, queue.SimpleQueue()
        self._silent = False
        self._server.start(self._execute, self._lines)
        self._send_rows("", "Grbl 1.1h ['$' for help]")
        line = bytearray()
        while True:
            try:
                data = read()
            except OSError:
                data = b""
            if not data:
                self._lines.put(None)
                return
            for byte in data:
                self._take(byte, line)

    def _take(self, byte: int, line: bytearray) -> None:
        char = chr(byte)
        if char == "?":
            self._send_rows(self._status())
        elif char == "!":
            self.tip.hold.set()
        elif char == "~":
            self.tip.hold.clear()
        elif char == "\x18":
            self._reset()
        elif char in "\r\n":
            if line:
                self._lines.put(line.decode("ascii", "replace"))
                line.clear()
        else:
            line.append(byte)

    def _reset(self) -> None:
        moving = self.tip.moving and not self.tip.hold.is_set()
        while not self._lines.empty():
            self._lines.get_nowait()
        if self.tip.moving:
            self.tip.cancel.set()
        self.tip.hold.clear()
        self.modal.reset()
        self._check_mode = False
        if moving:
            self._alarm = "3"
            self._send_rows("ALARM:3")
        self._send_rows("", "Grbl 1.1h ['$' for help]")
        if self._alarm:
            self._send_rows("[MSG:'$H'|'$X' to unlock]")

    def _send_rows(self, *rows: str) -> None:
        if self._silent:
            return
        with suppress(OSError):
            self._send("".join(f"{row}\r\n" for row in rows).encode())

    def _status(self) -> str:
        state = "Alarm" if self._alarm else "Hold:0" if self.tip.hold.is_set() else "Idle"
        state = "Run" if self.tip.moving and not self.tip.hold.is_set() else state
        state = "Check" if self._check_mode else state
        self._reports += 1
        where = f"MPos:{self._shown(self.tip.place)}"
        if self._work_positions:
            where = f"WPos:{self._shown(self.tip.place - self.modal.offset)}"
        tripped = "|Pn:P" if self.tip.tripped else ""
        has_offset = self._work_positions or self._reports % _WITH_OFFSET == 1
        wco = f"|WCO:{self._shown(self.modal.offset)}" if has_offset else ""
        return f"<{state}|{where}|FS:0,0{tripped}{wco}>"

    def _shown(self, place: Vectors) -> str:
        factor, digits = (1 / 25.4e-3, 4) if self._inches else (1e3, 3)
        return ",".join(f"{factor * v + 0.0:.{digits}f}" for v in place)

    def _execute(self, lines: queue.SimpleQueue[str | None]) -> None:
        while (line := lines.get()) is not None:
            self.received.append(line)
            self._run(line.strip().upper())

    def _run(self, line: str) -> None:
        if line.startswith("$"):
            self._dollar(line)
            return
        if self._alarm:
            self._send_rows("error:9")
            return
        try:
            block = self.modal.read(line)
        except ValueError:
            self._send_rows("error:2")
            return
        if block.conflicts or (block.of_machine and self.modal.motion not in ("0", "1")):
            self._send_rows("error:21" if block.conflicts else "error:30")
        elif block.sets and "R" in block.words:
            self._send_rows("error:20")
        elif block.sets:
            self.modal.set_offset(block)
            self._send_rows("ok")
        elif block.moves:
            self._move(self.modal.goal(block, self.tip.place))
        else:
            self._send_rows("ok")

    def _drop(self) -> None:
        self._hang_up()

    def _move(self, goal: Vectors) -> None:
        guarded = self.modal.motion.startswith("38")
        if self._check_mode:
            self._send_rows("ok")
            return
        if guarded and float(np.linalg.norm(goal - self.tip.place)) < 5e-7:
            self._send_rows("error:33")
            return
        self.tip.cancel.clear()
        speed = _RAPID if self.modal.motion == "0" else self.modal.feed
        outcome, place = self._motion(goal, speed, guarded=guarded)
        if outcome == "tripped":
            self._fail("4")
        elif outcome in ("arrived", "contact"):
            self._ended(outcome == "contact", place, guarded=guarded)

    def _ended(self, hit: bool, place: Vectors, *, guarded: bool) -> None:
        if guarded:
            self._probed = f"{self._shown(place)}:{int(hit)}"
            self._send_rows(f"[PRB:{self._probed}]")
        if not hit and guarded and self.modal.motion == "38.2":
            self._fail("5")
        else:
            self._send_rows("ok")

    def _fail(self, alarm: str) -> None:
        self._alarm = alarm
        self._send_rows(f"ALARM:{alarm}", "[MSG:Reset to continue]")

    def _dollar(self, line: str) -> None:
        if line in ("$$", "$#") and self.tip.hold.is_set():
            self._send_rows("error:8")
        elif line == "$I":
            self._send_rows("[VER:1.1h.20190825:]", "[OPT:V,15,128]", "ok")
        elif line == "$$":
            axes = [f"$12{k}={value}" for k, value in enumerate(("500.000", "500.000", "250.000"))]
            self._send_rows("$10=1", f"$13={int(self._inches)}", "$20=0", "$22=0", "$110=6000.000", *axes, "ok")
        elif line == "$G":
            self._send_rows(f"[GC:{self._modes()}]", "ok")
        elif line == "$C":
            self._check_mode = not self._check_mode
            self._send_rows("[MSG:Enabled]", "ok") if self._check_mode else self._reset()
        elif line == "$#":
            rows = [f"[G{53 + n}:{self._shown(self.modal.offsets.get(n, np.zeros(3)))}]" for n in range(1, 7)]
            zero = self._shown(np.zeros(3))
            more = f"[G28:{zero}]", f"[G30:{zero}]", f"[G92:{zero}]", "[TLO:0.000]", f"[PRB:{self._probed}]"
            self._send_rows(*rows, *more, "ok")
        elif line == "$X":
            self._alarm = ""
            self.tip.emergency.clear()
            self._send_rows("[MSG:Caution: Unlocked]", "ok")
        else:
            self._send_rows("error:3")

    def _modes(self) -> str:
        modal = self.modal
        unit, distance = "G21" if modal.unit == 1e-3 else "G20", "G90" if modal.absolute else "G91"
        feed = "G94" if modal.per_minute else "G93"
        return f"G{modal.motion} G{53 + modal.active} G17 {unit} {distance} {feed} M5 M9 T0 F{60e3 * modal.feed:.0f} S0"


def _no_client(*_: bytes) -> None:
    """Discard bytes while no client is connected."""
