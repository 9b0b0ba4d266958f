"""A live page beside a command that carries a session out itself: it shows, and nothing on it moves anything."""

from __future__ import annotations

import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from tanteo.cli.printing import say

if TYPE_CHECKING:
    from tanteo.planning import Session


@contextmanager
def page_of(session: Session, *, live: bool, show: bool) -> Iterator[Callable[[str], None]]:
    """What draws a session on a live page, with a note; nothing if none is wanted.

    Args:
        session: what is known and asked.
        live: whether a page is wanted.
        show: whether it is opened in a browser, on a desktop.

    Raises:
        MissingExtraError: viser is not installed.
    """
    if not live:
        yield lambda note: None
        return
    from tanteo.render import follow

    def ready(url: str) -> None:
        say(f"Live page: {url}", sys.stderr)
        if show and sys.stderr.isatty():
            webbrowser.open(url)

    with follow(session, ready=ready) as draw:
        yield draw


def stay(*, live: bool) -> None:
    """The page stays until it has been seen enough."""
    if live:
        say("The machine is let go. The page stays until Ctrl-C.", sys.stderr)
        with suppress(KeyboardInterrupt):
            until_interrupted()


def until_interrupted() -> None:
    """Wait for Ctrl-C."""
    threading.Event().wait()
