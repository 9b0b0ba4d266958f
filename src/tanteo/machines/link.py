"""Connect to controllers over TCP or a serial port, with reads that end in time."""

from __future__ import annotations

import socket
import threading
from typing import Any, Protocol

from tanteo.errors import MissingExtraError, install_command
from tanteo.machines.protocol import LinkLostError


class Link(Protocol):
    """Connection that sends and receives bytes."""

    @property
    def name(self) -> str:
        """Return the name of the connection for messages."""
        ...

    def read(self, seconds: float) -> bytes:
        """Return the bytes that have arrived, after at most ``seconds``; empty if there are none.

        Args:
            seconds: largest time to wait [s].

        Raises:
            LinkLostError: the connection is lost.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send bytes.

        Args:
            data: bytes to send.

        Raises:
            LinkLostError: the connection is lost.
        """
        ...

    def close(self) -> None:
        """Disconnect; never raises."""
        ...


class TcpLink:
    """Connection over TCP.

    Raises:
        LinkLostError: no controller listens at this address.
    """

    def __init__(self, host: str, port: int, seconds: float = 3.0) -> None:
        self.name = f"{host}:{port}"
        self._writing = threading.RLock()  # a signal handler may send a stop during a write
        try:
            self._socket = socket.create_connection((host, port), timeout=seconds)
        except OSError as error:
            why = error.strerror or error
            raise LinkLostError(
                f"{self.name}: expected a controller, got: {why}. Check its address and that it is on."
            ) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self, seconds: float) -> bytes:
        """Return the bytes that have arrived, after at most ``seconds``; empty if there are none.

        Args:
            seconds: largest time to wait [s].

        Raises:
            LinkLostError: the connection is lost.
        """
        try:
            self._socket.settimeout(max(seconds, 1e-3))
            data = self._socket.recv(65536)
        except TimeoutError:
            return b""
        except OSError as error:
            raise _lost(self.name, error) from None
        if not data:
            raise LinkLostError(f"{self.name}: expected its answer, got the end of the connection. Check the machine.")
        return data

    def write(self, data: bytes) -> None:
        """Send bytes.

        Args:
            data: bytes to send.

        Raises:
            LinkLostError: the connection is lost.
        """
        try:
            with self._writing:
                self._socket.sendall(data)
        except OSError as error:
            raise _lost(self.name, error) from None

    def close(self) -> None:
        """Disconnect."""
        self._socket.close()


class SerialLink:
    """Connection over a serial port, by pyserial (extra ``machines``).

    Raises:
        MissingExtraError: pyserial is not installed.
        LinkLostError: the port does not exist or cannot be opened.
    """

    def __init__(self, port: str, baud: int = 115200) -> None:
        try:
            import serial
        except ImportError:
            raise MissingExtraError(
                f"serial ports: expected pyserial, got none. Install it: {install_command('machines')}."
            ) from None
        self.name = port
        self._errors: Any = (serial.SerialException, OSError, TypeError)  # TypeError if another thread closes the port
        try:
            self._port: Any = serial.Serial(port, baud, timeout=0.05, write_timeout=2.0)
        except self._errors as error:
            raise LinkLostError(f"{port}: expected a serial port, got: {error}. Check its name and cable.") from None

    def read(self, seconds: float) -> bytes:
        """Return the bytes that have arrived, after at most ``seconds``; empty if there are none.

        Args:
            seconds: largest time to wait [s].

        Raises:
            LinkLostError: the connection is lost.
        """
        try:
            self._port.timeout = seconds
            data = self._port.read(1)
            return bytes(data + self._port.read(self._port.in_waiting)) if data else b""
        except self._errors as error:
            raise _lost(self.name, error) from None

    def write(self, data: bytes) -> None:
        """Send bytes.

        Args:
            data: bytes to send.

        Raises:
            LinkLostError: the connection is lost.
        """
        try:
            self._port.write(data)
        except self._errors as error:
            raise _lost(self.name, error) from None

    def close(self) -> None:
        """Disconnect."""
        self._port.close()


def _lost(name: str, error: Exception) -> LinkLostError:
    why = getattr(error, "strerror", None) or error
    return LinkLostError(f"{name}: expected a connection, got: {why}. Check the machine before you connect again.")
