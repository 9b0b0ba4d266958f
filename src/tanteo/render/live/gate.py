"""Access control of the live page: only the page itself, in a browser on this machine, may connect.

The server is local, but other tabs of the browser can reach it, too. A site whose name resolves to this machine (DNS
rebinding) sends that name as ``Host``; a script of another site sends its ``Origin``. Files and socket of the page
refuse both.
"""

from __future__ import annotations

import http
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import websockets.asyncio.server as sockets
from websockets.http11 import Request, Response

LOCAL = ("127.0.0.1", "localhost", "::1")
"""Names of this machine, with any port, because a tunnel (``ssh -L``) may use another one."""


def is_foreign(host: str | None, origin: str | None) -> bool:
    """Return whether a request does not come from a page of this machine.

    Args:
        host: header ``Host``.
        origin: header ``Origin``; None if no script sent the request.

    Example:
        >>> is_foreign("127.0.0.1:8080", None), is_foreign("127.0.0.1:8080", "http://127.0.0.1:8080")
        (False, False)
        >>> is_foreign("evil.example:8080", None), is_foreign("127.0.0.1:8080", "https://evil.example")
        (True, True)
    """
    try:
        name = urlsplit(f"//{host or ''}").hostname
        source = None if origin is None else urlsplit(origin).netloc
    except ValueError:  # unbalanced brackets
        return True
    return name not in LOCAL or (source is not None and source != host)


@contextmanager
def guarded() -> Iterator[None]:
    """Make websocket servers that start inside the context refuse foreign requests; viser has no setting for this."""
    serve = sockets.serve

    def guarding(*args: Any, process_request: Callable[..., Any] | None = None, **options: Any) -> Any:
        def process(connection: Any, request: Request) -> Any:
            # browsers send each header once
            hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
            if len(hosts) != 1 or len(origins) > 1 or is_foreign(hosts[0], origins[0] if origins else None):
                return _refused(connection)
            return process_request(connection, request) if process_request is not None else None

        return serve(*args, process_request=process, **options)

    sockets.serve = guarding  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        sockets.serve = serve  # type: ignore[misc]


def _refused(connection: Any) -> Response:
    text = "tanteo answers only the page that it serves on this machine.\n"
    response: Response = connection.respond(http.HTTPStatus.FORBIDDEN, text)
    return response
