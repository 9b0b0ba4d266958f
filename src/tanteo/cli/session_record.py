"""The record of a session that the command holds, whatever ends it."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tanteo import io
from tanteo.cli import files
from tanteo.cli.printing import complain, say
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.planning import Session

_ENDS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""The system's order to end, and a terminal that has gone."""


@contextmanager
def kept(session: Session, record: str | None) -> Iterator[Callable[[], None]]:
    """What was told until an interruption (Ctrl-C, an order to end, a terminal that has gone) is in the record.

    Yields:
        To call after every question: who is killed, or loses power, has the record up to there.
    """
    failed = list[InputError]()

    def keep() -> None:
        if record is None or session.readings is None or failed:
            return
        try:
            write_session(session, record)
        except InputError as error:  # the end will say it again, and then it is a failure
            failed.append(error)
            complain("warning", f"{error} Sensing goes on.")

    ours = threading.current_thread() is threading.main_thread()  # others may not listen to signals
    heard = [number for number in _ENDS if ours and signal.getsignal(number) != signal.SIG_IGN]  # nohup means it
    before = {number: signal.signal(number, _interrupt) for number in heard}
    try:
        yield keep
    except KeyboardInterrupt:
        if record is not None and session.readings is not None:
            write_session(session, record)
            say(f"record written up to here: {record}", sys.stderr)
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def write_session(session: Session, record: str | None) -> None:
    """The record of the session; of a file whose name ends in .csv, the readings alone."""
    if record is None:
        return
    if session.readings is None:
        complain("warning", "nothing was read, so there is no record.")
        return
    with files.writing("--record", record):
        if record.lower().endswith(".csv"):
            io.write_readings(session.readings, record, unit="m")
        else:
            io.write_record(session, record)
