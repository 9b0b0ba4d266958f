"""Packages of the real-time data exchange of Universal Robots (RTDE, protocol 2): both ends.

Read for it: ``rtde/rtde.py`` and ``rtde/serialize.py`` of UniversalRobots/RTDE_Python_Client_Library: a package is a
size (uint16, big-endian, itself included), a letter and a payload; outputs are asked for by a frequency (double) and
names with commas, and answered by a recipe's number and types; data packages begin with that number.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

REQUEST_VERSION, CONTROLLER_VERSION, MESSAGE, DATA = b"V", b"v", b"M", b"U"
SETUP_OUTPUTS, SETUP_INPUTS, START, PAUSE = b"O", b"I", b"S", b"P"

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
