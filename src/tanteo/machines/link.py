"""A connection that carries bytes: TCP or serial, whose reads end in time, and what is lost is said once."""

from __future__ import annotations

import socket
import threading
from typing import Any, Protocol

from tanteo.errors import MissingExtraError
from tanteo.machines.protocol import LinkLostError


class Link(Protocol):
    """Bytes out, bytes in."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    def read(self, seconds: float) -> bytes:
        """What has come, after ``seconds`` at the latest; empty for nothing. Raises LinkLostError."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of it. Raises LinkLostError."""
        ...

    def close(self) -> None:
        """Never raises."""
        ...


class TcpLink:
    """A socket.

    Raises:
        LinkLostError: nobody listens there.
    """

    def __init__(self, host: str, port: int, seconds: float = 3.0) -> None:
        self.name = f"{host}:{port}"
        self._writing = threading.Lock()
        try:
            self._socket = socket.create_connection((host, port), timeout=seconds)
        except OSError as error:
            why = error.strerror or error
            raise LinkLostError(
                f"{self.name}: expected a controller, got: {why}. Check its address and that it is on."
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self, seconds: float) -> bytes:
        """What has come, after so long at the latest."""
        try:
            self._socket.settimeout(max(seconds, 1e-3))
            data = self._socket.recv(65536)
        except TimeoutError:
            return b""
        except OSError as error:
            raise _lost(self.name, error) from None
        if not data:
            raise LinkLostError(
                f"{self.name}: expected its answer, got the end of the connection. Look at the machine."
            )
        return data

    def write(self, data: bytes) -> None:
        """Send all of it."""
        try:
            with self._writing:
                self._socket.sendall(data)
        except OSError as error:
            raise _lost(self.name, error) from None

    def close(self) -> None:
        """Let go."""
        self._socket.close()


class SerialLink:
    """A serial port, by pyserial (extra ``machines``).

    Raises:
        MissingExtraError: pyserial is not installed.
        LinkLostError: there is no such port.
    """

    def __init__(self, port: str, baud: int = 115200) -> None:
        try:
            import serial
        except ImportError:
            raise MissingExtraError(
                "serial ports: expected pyserial, got none. Install it: pip install 'tanteo[machines]'."
            ) from None
        self.name = port
        self._errors: Any = (serial.SerialException, OSError, TypeError)  # TypeError: closed while it is read
        try:
            self._port: Any = serial.Serial(port, baud, timeout=0.05, write_timeout=2.0)
        except self._errors as error:
            raise LinkLostError(f"{port}: expected a serial port, got: {error}. Check its name and cable.") from None

    def read(self, seconds: float) -> bytes:
        """What has come, after so long at the latest."""
        try:
            self._port.timeout = seconds
            data = self._port.read(1)
            return bytes(data + self._port.read(self._port.in_waiting)) if data else b""
        except self._errors as error:
            raise _lost(self.name, error) from None

    def write(self, data: bytes) -> None:
        """Send all of it."""
        try:
            self._port.write(data)
        except self._errors as error:
            raise _lost(self.name, error) from None

    def close(self) -> None:
        """Let go."""
        self._port.close()


def _lost(name: str, error: Exception) -> LinkLostError:
    why = getattr(error, "strerror", None) or error
    return LinkLostError(f"{name}: expected a connection, got: {why}. Look at the machine before you connect again.")
