"""Packages of the real-time data exchange of Universal Robots (RTDE, protocol 2): both ends.

Read for it: ``rtde/rtde.py`` and ``rtde/serialize.py`` of UniversalRobots/RTDE_Python_Client_Library: a package is a
size (uint16, big-endian, itself included), a letter and a payload; outputs are asked for by a frequency (double) and
names with commas, and answered by a recipe's number and types; data packages begin with that number.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from tanteo.machines.link import Link
from tanteo.machines.protocol import LinkLostError

REQUEST_VERSION, CONTROLLER_VERSION, DATA = b"V", b"v", b"U"
SETUP_OUTPUTS, START, PAUSE = b"O", b"S", b"P"

TYPES: Mapping[str, str] = MappingProxyType(
    {
        "timestamp": "DOUBLE", "actual_TCP_pose": "VECTOR6D", "actual_TCP_speed": "VECTOR6D", "actual_q": "VECTOR6D",
        "actual_digital_input_bits": "UINT64", "runtime_state": "UINT32", "robot_mode": "INT32", "safety_mode": "INT32",
        "robot_status_bits": "UINT32", "safety_status_bits": "UINT32", "actual_TCP_force": "VECTOR6D",
    }
    | {f"output_int_register_{k}": "INT32" for k in range(48)}
    | {f"output_double_register_{k}": "DOUBLE" for k in range(48)}
)  # fmt: skip
"""Types of the outputs that are known here."""

_CODES = {"DOUBLE": "d", "VECTOR6D": "6d", "UINT64": "Q", "UINT32": "I", "INT32": "i", "UINT8": "B", "BOOL": "?"}


def package(letter: bytes, payload: bytes = b"") -> bytes:
    """One package as bytes."""
    return struct.pack(">H", 3 + len(payload)) + letter + payload


def packages(buffer: bytearray) -> Iterator[tuple[bytes, bytes]]:
    """Whole packages at the beginning of a buffer, which are taken out of it."""
    while len(buffer) >= 3:
        size = struct.unpack_from(">H", buffer)[0]
        if size < 3:
            raise ValueError(f"a package of {size} bytes")
        if len(buffer) < size:
            return
        letter, payload = bytes(buffer[2:3]), bytes(buffer[3:size])
        del buffer[:size]
        yield letter, payload


def pack(types: Sequence[str], values: Sequence[object], recipe: int) -> bytes:
    """A data package."""
    flat = [v for value in values for v in (value if isinstance(value, (list, tuple)) else (value,))]
    return package(DATA, struct.pack(_format(types), recipe, *flat))


def unpack(types: Sequence[str], payload: bytes) -> list[object]:
    """Values of a data package, six numbers of a vector as a tuple."""
    flat = struct.unpack(_format(types), payload)[1:]
    out, k = list[object](), 0
    for kind in types:
        count = 6 if kind == "VECTOR6D" else 1
        out.append(tuple(flat[k : k + count]) if count > 1 else flat[k])
        k += count
    return out


def _format(types: Sequence[str]) -> str:
    return ">B" + "".join(_CODES[kind] for kind in types)


class RtdeClient:
    """The outputs of a controller, as they come.

    Attributes:
        values: the latest, by name; empty before the first package.
        at: when they were heard.

    Raises:
        LinkLostError: it does not speak RTDE 2, or has not all outputs.
    """

    def __init__(self, link: Link, outputs: Sequence[str], frequency: float, deadline: float) -> None:
        self.values: dict[str, Any] = {}
        self.at = -float("inf")
        self._link, self._outputs, self._buffer = link, tuple(outputs), bytearray()
        if self._asked(REQUEST_VERSION, struct.pack(">H", 2), deadline) != b"\1":
            raise LinkLostError(f"{link.name}: expected RTDE protocol 2, got none. Update the controller.")
        wanted = struct.pack(">d", frequency) + ",".join(outputs).encode("ascii")
        self._types = self._asked(SETUP_OUTPUTS, wanted, deadline)[1:].decode("ascii").split(",")
        if "NOT_FOUND" in self._types:
            lacks = outputs[self._types.index("NOT_FOUND")]
            raise LinkLostError(f"{link.name}: expected the output '{lacks}', got none. Update the controller.")
        if self._asked(START, b"", deadline) != b"\1":
            raise LinkLostError(f"{link.name}: expected RTDE to start, got a refusal. Restart the controller.")

    def listen(self, seconds: float) -> None:
        """Take in what comes within so long.

        Raises:
            LinkLostError: the connection, or its packages, broke.
        """
        try:
            self._buffer.extend(self._link.read(seconds))
            for letter, payload in packages(self._buffer):
                if letter == DATA:
                    self.values = dict(zip(self._outputs, unpack(self._types, payload), strict=True))
                    self.at = time.monotonic()
        except (ValueError, struct.error) as error:
            raise LinkLostError(f"{self._link.name}: expected packages of RTDE, got {error}. Reconnect.") from None

    def _asked(self, letter: bytes, payload: bytes, deadline: float) -> bytes:
        self._link.write(package(letter, payload))
        while time.monotonic() < deadline:
            for got, body in packages(self._buffer):
                if got == letter:
                    return body
            self._buffer.extend(self._link.read(0.1))
        raise LinkLostError(f"{self._link.name}: expected an answer of RTDE, got none. Check the connection.")
