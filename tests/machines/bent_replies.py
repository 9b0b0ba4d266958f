"""Runs of each driver whose controller sends bent replies: ``python -m machines.bent_replies COUNT SEED``.

A run moves and touches through a proxy that bends one reply, or every reply from one on. It passes if it ends in time
with the true distance or an error of tanteo, without an exception in any thread, and with the tip on its paths.
"""

from __future__ import annotations

import collections
import re
import struct
import sys
import threading
import time
from collections.abc import Callable

import numpy as np

from machines.bending import Proxy
from machines.cells import DOWN, START, at, world
from tanteo.errors import TanteoError
from tanteo.hand import Workspace
from tanteo.machines import (
    GrblFake,
    GrblMachine,
    LinuxCncFake,
    LinuxCncMachine,
    MachineLimits,
    SafeMachine,
    UrFake,
    UrMachine,
)
from tanteo.machines.link import TcpLink

KINDS = ("grbl", "linuxcnc", "ur")
TRUE = 0.004
"""Distance from (30, 20, 25) mm to the contact with the block [m]."""
NEAR = 0.45e-3
"""Largest error of an accepted reading [m]: arrival, and braking distance of the drivers."""
PATHS = Workspace(np.array([0.0295, 0.0195, 0.0195]), np.array([0.0305, 0.0205, 0.1005]))
"""The motions are on one vertical line."""
LIMITS = MachineLimits(Workspace(np.array([-0.05, -0.05, 0.0]), np.full(3, 0.15)), travel=0.2, stale=0.4, grace=0.6)
ENDS = 15.0
"""Largest duration of a run [s]: a touch whose acknowledgement is lost waits for its deadline, 6.6 s."""

NUMBERS = [
    b"nan", b"-nan", b"inf", b"-inf", b"1e400", b"-1e400", b"1e3", b"", b"-", b"+", b".", b"1.2.3", b"--1", b"0x10",
    b"1_0", b"9" * 400, b"1,2", b"1 2", "１".encode(), b"None", b"30.", b"1000000.000", b"-0.000", b"25.4",
]  # fmt: skip
_NUMBER = re.compile(rb"-?\d+\.?\d*")
_WORD = re.compile(rb"[A-Za-z_]+")
WORDS = [
    b"",
    b"nan",
    b"Idle",
    b"Run",
    b"Hold:0",
    b"Door:1",
    b"Alarm",
    b"Check",
    b"ON",
    b"OFF",
    b"NAK",
    b"ACK",
    b"x" * 300,
]


def bend(row: bytes, rng: np.random.Generator) -> bytes:
    """Change one reply; several lines are several replies."""
    how = int(rng.integers(12))
    tokens = list(_NUMBER.finditer(row)) if how < 5 else list(_WORD.finditer(row))
    if how < 7 and tokens:
        token = tokens[int(rng.integers(len(tokens)))]
        values = NUMBERS if how < 5 else WORDS
        return row[: token.start()] + values[int(rng.integers(len(values)))] + row[token.end() :]
    cut = int(rng.integers(len(row) + 1))
    garbage = bytes(rng.integers(0, 256, 12).astype(np.uint8)).replace(b"\n", b"").replace(b"\r", b"")
    return [
        row[:cut], row[cut:], row + b"\r\n" + row, row[:cut] + garbage + row[cut:], b"\0" + row,
        row.replace(b",", b";").replace(b" ", b"\t"), b"\r\n".join([row, bend(row, rng) if len(row) > 3 else row]),
        garbage, row + b"x" * 6000, row[::-1], b"ok", b"error:9",
    ][int(rng.integers(12))]  # fmt: skip


DOUBLES = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 0.0, 25.4, 1e3, -1.0]
INTEGERS = [0, 1, 2, 3, 4, 5, 6, 7, 99, -1, 2**31 - 1, -(2**31)]


def bend_package(package: bytes, rng: np.random.Generator) -> bytes:
    """Change one package of RTDE: a value of a data package, its size, letter or recipe, or its bytes."""
    how, body = int(rng.integers(10)), bytearray(package)
    if how < 6 and package[2:3] == b"U" and len(package) > 100:
        layout = "d6d6dQIiiii6d"  # outputs of the driver
        values = list(struct.unpack_from(">" + layout, package, 4))
        k = int(rng.integers(len(values)))
        if isinstance(values[k], float):
            values[k] = DOUBLES[int(rng.integers(len(DOUBLES)))]
        else:
            values[k] = INTEGERS[int(rng.integers(len(INTEGERS)))]
            values[k] = max(values[k], 0) if k in (13, 14) else values[k]  # unsigned
        return package[:4] + struct.pack(">" + layout, *values)
    k = int(rng.integers(len(body)))
    changes = [
        package[:k], package + package, package[:2] + bytes([int(rng.integers(256))]) + package[3:],
        package[:3] + b"\7" + package[4:], struct.pack(">H", int(rng.integers(65536))) + package[2:],
        package[:k] + bytes([int(rng.integers(256))]) + package[k + 1 :], b"", bytes(len(package)),
    ]  # fmt: skip
    return changes[int(rng.integers(len(changes)))]


class Bending:
    """Bends replies from number ``first`` on, all or one, counted over all connections of a driver."""

    def __init__(self, first: int, lasting: bool, rng: np.random.Generator) -> None:
        self.first, self.lasting, self.rng = first, lasting, rng
        self.count, self.bent = 0, list[bytes]()
        self._lock = threading.Lock()

    def _apply(self, reply: bytes, change: Callable[[bytes, np.random.Generator], bytes]) -> bytes:
        with self._lock:
            self.count += 1
            if self.count < self.first or (self.count > self.first and not self.lasting):
                return reply
            made = change(reply, self.rng)
            self.bent.append(made[:80])
            return made

    def rows(self, end: bytes):
        """Apply to rows of a stream."""
        rest = b""

        def apply(data: bytes) -> bytes:
            nonlocal rest
            *rows, rest = (rest + data).split(b"\n")
            return b"".join(self._apply(row.strip(b"\r"), bend) + end if row.strip() else end for row in rows)

        return apply

    def packages(self):
        """Apply to packages of RTDE."""
        rest = b""

        def apply(data: bytes) -> bytes:
            nonlocal rest
            rest, out = rest + data, b""
            while len(rest) >= 3 and len(rest) >= (size := struct.unpack_from(">H", rest)[0]) >= 3:
                out += self._apply(rest[:size], bend_package)
                rest = rest[size:]
            return out

        return apply


FAKES = {"grbl": GrblFake, "linuxcnc": LinuxCncFake, "ur": UrFake}


def connected(kind: str, ports):
    links = [TcpLink("127.0.0.1", port) for port in ports]
    if kind == "grbl":
        return GrblMachine(*links, seconds=1.0)
    return LinuxCncMachine(*links, seconds=1.0) if kind == "linuxcnc" else UrMachine(*links, seconds=1.0)


def scenario(safe: SafeMachine) -> float:
    safe.move(at(30, 20, 25))
    with safe.touching():
        sensed = safe.sense(DOWN, 0.008)
    safe.move(at(30, 20, 90))
    return sensed.distance


def run(kind: str, bending: Bending) -> tuple[str, str]:
    """Make one run; return its end (``read``, ``refused`` or what went wrong), and a text about it."""
    fake = FAKES[kind](world(), START)
    failed = list[str]()
    before = threading.excepthook
    threading.excepthook = lambda args: failed.append(f"{args.exc_type.__name__}: {args.exc_value}")
    of_robot = bending.rows(b"\n"), lambda data: data, bending.packages()
    changes = of_robot if kind == "ur" else (bending.rows(b"\r\n"),)
    proxies = [Proxy(port, change) for port, change in zip(fake.ports, changes, strict=True)]
    begun, machine = time.monotonic(), None
    try:
        try:
            machine = connected(kind, [proxy.port for proxy in proxies])
            distance = scenario(SafeMachine(machine, LIMITS))
            end, text = ("read", "") if abs(distance - TRUE) <= NEAR else ("wrong reading", f"{distance}")
        except TanteoError as error:
            end, text = "refused", str(error)
        except BaseException as error:  # noqa: BLE001  what the run is about
            end, text = "another exception", f"{type(error).__name__}: {error}"
        finally:
            if machine is not None:
                machine.close()
    finally:
        for proxy in proxies:
            proxy.close()
        fake.close()
        threading.excepthook = before
    if failed:
        end, text = "exception in a thread", failed[0]
    if time.monotonic() - begun > ENDS:
        end, text = "late", f"{time.monotonic() - begun:.1f} s"
    outside = [p for p in fake.tip.travelled if (p < PATHS.low).any() or (p > PATHS.high).any()]
    if outside:
        end, text = "outside", f"{outside[0]}"
    return end, text


def replies(kind: str) -> int:
    """Return the number of replies of an undisturbed run; on a busy computer one may be refused as late."""
    ends = []
    for _ in range(3):
        bending = Bending(10**9, False, np.random.default_rng(0))
        ends.append(run(kind, bending))
        if ends[-1][0] == "read":
            return bending.count
    raise AssertionError(ends)


def runs(kind: str, count: int, seed: int) -> tuple[collections.Counter, list[str]]:
    """Bend replies at random; return the ends, and texts on those that are none of ``read`` and ``refused``."""
    total, ends, bad = replies(kind), collections.Counter[str](), list[str]()
    for k in range(count):
        rng = np.random.default_rng((seed, KINDS.index(kind), k))
        bending = Bending(1 + int(rng.integers(total)), bool(rng.integers(4) == 0), rng)
        end, text = run(kind, bending)
        ends[end] += 1
        if end not in ("read", "refused"):
            bad.append(f"{kind} {k}: {end}, {text}, after {bending.bent[:2]}")
    return ends, bad


def main() -> None:
    """Print the ends of the runs; exit with 1 if one is neither a true reading nor a refusal."""
    failed = False
    count, seed = (int(v) for v in [*sys.argv[1:], "200", "0"][:2])
    for kind in KINDS:
        ends, bad = runs(kind, count, seed)
        print(kind, dict(ends))
        print(*bad, sep="\n", end="\n" * bool(bad))
        failed = failed or bool(bad)
    sys.exit(failed)


if __name__ == "__main__":
    main()
