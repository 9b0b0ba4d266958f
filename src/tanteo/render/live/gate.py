"""Who may talk to the live page: the browser of this machine that shows it, and no page from elsewhere.

The page is served on this machine only, but so is the browser's every other tab. A site whose name leads to this
machine in the end (DNS rebinding) sends that name as ``Host``; a script of another site sends its ``Origin``. Both are
refused, for the page's files as for its socket.
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
"""Names of this machine; any port, since a tunnel (``ssh -L``) may have another."""


def is_foreign(host: str | None, origin: str | None) -> bool:
    """Whether a request is not of a page that this machine serves.

    Args:
        host: its header ``Host``.
        origin: its header ``Origin``; None of what is no script.

    Example:
        >>> is_foreign("127.0.0.1:8080", None), is_foreign("127.0.0.1:8080", "http://127.0.0.1:8080")
        (False, False)
        >>> is_foreign("evil.example:8080", None), is_foreign("127.0.0.1:8080", "https://evil.example")
        (True, True)
    """
    try:
        name = urlsplit(f"//{host or ''}").hostname
        asked_by = None if origin is None else urlsplit(origin).netloc
    except ValueError:  # brackets that do not match
        return True
    return name not in LOCAL or (asked_by is not None and asked_by != host)


@contextmanager
def guarded() -> Iterator[None]:
    """Servers that are started inside refuse what is foreign; viser has no setting for it."""
    serve = sockets.serve

    def guarding(*args: Any, process_request: Callable[..., Any] | None = None, **options: Any) -> Any:
        def process(connection: Any, request: Request) -> Any:
            # a header that comes twice is no browser's
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
