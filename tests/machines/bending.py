"""A proxy between a driver and its fake, which changes what the controller sends."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

Change = Callable[[bytes], bytes]


def of_rows(change: Change) -> Change:
    """Apply a change to every complete row of a stream; the row has no line end."""
    rest = b""

    def apply(data: bytes) -> bytes:
        nonlocal rest
        *rows, rest = (rest + data).split(b"\n")
        return b"".join(change(row.strip(b"\r")) + b"\r\n" for row in rows)

    return apply


class Proxy:
    """Passes bytes between a client and a server of loopback; ``change`` is applied to those of the server."""

    def __init__(self, port: int, change: Change) -> None:
        self.change, self._to = change, port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = self._listening.getsockname()[1]
        self._ends: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def _accept(self) -> None:
        with suppress(OSError):
            client, _ = self._listening.accept()
            server = socket.create_connection(("127.0.0.1", self._to))
            self._ends = [client, server]
            for ends in ((client, server, None), (server, client, self.change)):
                thread = threading.Thread(target=self._pump, args=ends, daemon=True)
                self._threads.append(thread)
                thread.start()

    def _pump(self, source: socket.socket, sink: socket.socket, change: Change | None) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(data if change is None else self.change(data))
        for end in (source, sink):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def send(self, data: bytes) -> None:
        """Send bytes to the client, as if they came from the server."""
        self._ends[0].sendall(data)

    def close(self) -> None:
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        for end in self._ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        for thread in self._threads:
            thread.join(1.0)


@contextmanager
def bent(port: int, change: Change) -> Iterator[Proxy]:
    """A proxy in front of a port."""
    proxy = Proxy(port, change)
    try:
        yield proxy
    finally:
        proxy.close()
