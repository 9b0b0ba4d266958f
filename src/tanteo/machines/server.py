"""A TCP server of a fake controller, on loopback alone, for one client at a time."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress


class Server:
    """Listens on 127.0.0.1 and hands each connection to a function in a thread of its own.

    Attributes:
        port: where it listens; one that the system chose, if none was asked for.
    """

    def __init__(self, serve: Callable[[socket.socket], None], port: int = 0) -> None:
        self._serve = serve
        self._listening = socket.create_server(("127.0.0.1", port))
        self._clients = list[socket.socket]()
        self._closed = False
        self.port = int(self._listening.getsockname()[1])
        threading.Thread(target=self._accept, daemon=True, name="fake").start()

    def _accept(self) -> None:
        while not self._closed:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients.append(client)
            threading.Thread(target=self._run, args=(client,), daemon=True, name="fake client").start()

    def _run(self, client: socket.socket) -> None:
        with suppress(OSError):
            self._serve(client)
        hang_up(client)

    def drop(self) -> None:
        """End all connections; it goes on listening."""
        while self._clients:
            hang_up(self._clients.pop())

    def close(self) -> None:
        """End all."""
        self._closed = True
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.drop()


def hang_up(client: socket.socket) -> None:
    """End a connection at both ends; never raises."""
    with suppress(OSError):
        client.shutdown(socket.SHUT_RDWR)
    client.close()
