"""Encode and decode packages of Universal Robots' real-time data exchange (RTDE, protocol 2), for both ends.

Source: ``rtde/rtde.py`` and ``rtde/serialize.py`` of UniversalRobots/RTDE_Python_Client_Library. A package is a size
(uint16, big-endian, including itself), a letter and a payload. A client requests outputs by a frequency (double) and
names with commas. The controller answers with the number of a recipe and the types. Data packages begin with that
number.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any

import numpy as np

from tanteo.machines.link import Link
from tanteo.machines.protocol import LinkLostError, quoted

REQUEST_VERSION, CONTROLLER_VERSION, DATA = b"V", b"v", b"U"
SETUP_OUTPUTS, START, PAUSE = b"O", b"S", b"P"

TYPES: Mapping[str, str] = MappingProxyType(
    {
        "timestamp": "DOUBLE", "actual_TCP_pose": "VECTOR6D", "actual_TCP_speed": "VECTOR6D", "actual_q": "VECTOR6D",
        "actual_digital_input_bits": "UINT64", "runtime_state": "UINT32", "robot_mode": "INT32", "safety_mode": "INT32",
        "tcp_offset": "VECTOR6D", "robot_status_bits": "UINT32",
        "safety_status_bits": "UINT32", "actual_TCP_force": "VECTOR6D",
    }
    | {f"output_int_register_{k}": "INT32" for k in range(48)}
    | {f"output_double_register_{k}": "DOUBLE" for k in range(48)}
)  # fmt: skip
"""Types of the supported outputs, by name."""

_LARGEST = 1e9
"""Largest magnitude of a number: seconds since the start of a controller are fewer, positions and angles smaller."""
_CODES = {"DOUBLE": "d", "VECTOR6D": "6d", "UINT64": "Q", "UINT32": "I", "INT32": "i", "UINT8": "B", "BOOL": "?"}


def package(letter: bytes, payload: bytes = b"") -> bytes:
    """Return a package as bytes.

    Args:
        letter: letter of the package.
        payload: content of the package.
    """
    return struct.pack(">H", 3 + len(payload)) + letter + payload


def packages(buffer: bytearray) -> Iterator[tuple[bytes, bytes]]:
    """Remove complete packages from the beginning of a buffer.

    Args:
        buffer: received bytes; changed in place.

    Yields:
        Letter and payload of each package.

    Raises:
        ValueError: the size of a package is invalid.
    """
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
    """Return a data package as bytes.

    Args:
        types: types of the values.
        values: values; a vector is a tuple or list of six numbers.
        recipe: number of the recipe.
    """
    flat = [v for value in values for v in (value if isinstance(value, (list, tuple)) else (value,))]
    return package(DATA, struct.pack(_format(types), recipe, *flat))


def unpack(types: Sequence[str], payload: bytes) -> list[object]:
    """Return the values of a data package; a vector is a tuple of six numbers.

    Args:
        types: types of the values.
        payload: content of the package.
    """
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
    """Client that receives the outputs of a controller.

    Attributes:
        values: latest values by name; empty before the first package.
        at: time of their arrival, by the monotonic clock [s].

    Raises:
        LinkLostError: the controller does not support RTDE 2, or does not have all outputs.
    """

    def __init__(self, link: Link, outputs: Sequence[str], frequency: float, deadline: float) -> None:
        self.values: dict[str, Any] = {}
        self.at = -float("inf")
        self._link, self._outputs, self._buffer = link, tuple(outputs), bytearray()
        if self._requested(REQUEST_VERSION, struct.pack(">H", 2), deadline) != b"\1":
            raise LinkLostError(f"{link.name}: expected RTDE protocol 2, got none. Update the controller.")
        wanted = struct.pack(">d", frequency) + ",".join(outputs).encode("ascii")
        answer = self._requested(SETUP_OUTPUTS, wanted, deadline)
        self._recipe, self._types = answer[:1], answer[1:].decode("ascii", "replace").split(",")
        if "NOT_FOUND" in self._types:
            lacks = ", ".join(name for name, kind in zip(outputs, self._types, strict=False) if kind == "NOT_FOUND")
            raise LinkLostError(f"{link.name}: expected the output '{lacks}', got none. Update the controller.")
        if self._types != [TYPES[name] for name in outputs]:
            raise LinkLostError(
                f"{link.name}: expected the types of its outputs, got {quoted(','.join(self._types))}. Update the "
                "controller."
            )
        if self._requested(START, b"", deadline) != b"\1":
            raise LinkLostError(f"{link.name}: expected RTDE to start, got a refusal. Restart the controller.")

    def listen(self, seconds: float) -> None:
        """Receive the packages that arrive within a time.

        Args:
            seconds: largest time to wait [s].

        Raises:
            LinkLostError: the connection is lost, or a package is malformed.
        """
        self._buffer.extend(self._link.read(seconds))
        with self._whole():
            for letter, payload in packages(self._buffer):
                if letter == DATA:
                    self.values = self._values_of(payload)
                    self.at = time.monotonic()

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """Raise the error of a malformed package."""
        try:
            yield
        except (ValueError, struct.error) as error:
            raise LinkLostError(f"{self._link.name}: expected packages of RTDE, got {error}. Reconnect.") from None

    def _values_of(self, payload: bytes) -> dict[str, Any]:
        """Return the values of a data package by name; raise ValueError if one is not a plausible number."""
        if payload[:1] != self._recipe:
            raise ValueError(f"the recipe {quoted(payload[:1].hex())} in place of {quoted(self._recipe.hex())}")
        values = dict(zip(self._outputs, unpack(self._types, payload), strict=True))
        for name, value in values.items():
            if TYPES[name] in ("DOUBLE", "VECTOR6D") and not (np.abs(np.asarray(value)) <= _LARGEST).all():
                raise ValueError(f"{name} = {value}")
        return values

    def _requested(self, letter: bytes, payload: bytes, deadline: float) -> bytes:
        self._link.write(package(letter, payload))
        while time.monotonic() < deadline:
            with self._whole():
                for got, body in packages(self._buffer):
                    if got == letter:
                        return body
            self._buffer.extend(self._link.read(0.1))
        raise LinkLostError(f"{self._link.name}: expected an answer of RTDE, got none. Check the connection.")
