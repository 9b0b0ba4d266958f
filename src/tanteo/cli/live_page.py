"""Show the session of a running command on a live page, which has no controls."""

from __future__ import annotations

import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from tanteo.cli.printing import print_text

if TYPE_CHECKING:
    from tanteo.planning import Session


@contextmanager
def page_of(session: Session, *, live: bool, show: bool) -> Iterator[Callable[[str], None]]:
    """Show a session on a live page.

    Args:
        session: session to show.
        live: whether to open a page; otherwise the context does nothing.
        show: whether to open the page in a browser.

    Yields:
        A function that draws the current session with a note.

    Raises:
        MissingExtraError: viser is not installed.
    """
    if not live:
        yield lambda note: None
        return
    from tanteo.render.live import follow

    def ready(url: str) -> None:
        print_text(f"Live page: {url}", sys.stderr)
        if show and sys.stderr.isatty():
            webbrowser.open(url)

    with follow(session, ready=ready) as draw:
        yield draw


def stay(*, live: bool) -> None:
    """Keep the page open until Ctrl-C.

    Args:
        live: whether there is a page.
    """
    if live:
        print_text("The machine is disconnected. The page stays until Ctrl-C.", sys.stderr)
        with suppress(KeyboardInterrupt):
            until_interrupted()


def until_interrupted() -> None:
    """Wait for Ctrl-C."""
    threading.Event().wait()
