"""Serve TCP connections of a fake controller, on loopback only."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress


class Server:
    """TCP server on 127.0.0.1 that passes each connection to a function in a thread of its own.

    Attributes:
        port: port of the server; chosen by the system if the requested port is 0.
    """

    def __init__(self, serve: Callable[[socket.socket], None], port: int = 0) -> None:
        self._serve = serve
        self._listening = socket.create_server(("127.0.0.1", port))
        self._clients = list[socket.socket]()
        self._closed = False
        self._threads = list[threading.Thread]()
        self.port = int(self._listening.getsockname()[1])
        self.start(self._accept)

    def start(self, run: Callable[..., None], *args: object) -> None:
        """Start a thread that :meth:`close` waits for.

        Args:
            run: function to run in the thread.
            args: its arguments.
        """
        thread = threading.Thread(target=run, args=args, daemon=True, name=f"fake {self.__class__.__name__}")
        self._threads = [t for t in self._threads if t.is_alive()] + [thread]
        thread.start()

    def _accept(self) -> None:
        while not self._closed:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients.append(client)
            self.start(self._run, client)

    def _run(self, client: socket.socket) -> None:
        with suppress(OSError):
            self._serve(client)
        hang_up(client)

    def drop(self) -> None:
        """End all connections, and continue to listen."""
        while self._clients:
            hang_up(self._clients.pop())

    def close(self) -> None:
        """Stop listening, end all connections, and wait for the threads."""
        self._closed = True
        with suppress(OSError):
            self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self.drop()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(1.0)
        self._threads.clear()


def hang_up(client: socket.socket) -> None:
    """End a connection in both directions; never raises.

    Args:
        client: socket of the connection.
    """
    with suppress(OSError):
        client.shutdown(socket.SHUT_RDWR)
    client.close()
