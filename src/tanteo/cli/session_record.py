"""Write the record of a session during a command, also after an interruption."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tanteo import io
from tanteo.cli import files
from tanteo.cli.printing import complain, print_text
from tanteo.errors import InputError

if TYPE_CHECKING:
    from tanteo.planning import Session

_ENDS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Signals of a termination and of a closed terminal."""


@contextmanager
def kept(session: Session, record: str | None) -> Iterator[Callable[[], None]]:
    """Write the record also after an interruption: Ctrl-C, a termination signal, or a closed terminal.

    Args:
        session: session to record.
        record: file of the record; None to write nothing.

    Yields:
        A function that writes the record; a call after every question saves it against a power failure.

    Raises:
        KeyboardInterrupt: the command was interrupted.
    """
    failed = list[InputError]()

    def keep() -> None:
        if record is None or session.readings is None or failed:
            return
        try:
            write_session(session, record)
        except InputError as error:  # the write at the end raises the error again
            failed.append(error)
            complain("warning", f"{error} Sensing continues.")

    is_main = threading.current_thread() is threading.main_thread()  # only the main thread can handle signals
    # signals that the caller ignores, as nohup does, stay ignored
    handled = [number for number in _ENDS if is_main and signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, _interrupt) for number in handled}
    try:
        yield keep
    except KeyboardInterrupt:
        if record is not None and session.readings is not None:
            write_session(session, record)
            print_text(f"record written up to here: {record}", sys.stderr)
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def write_session(session: Session, record: str | None) -> None:
    """Write the record of a session, or only its readings if the file name ends in ``.csv``.

    Args:
        session: session to record.
        record: file to write; None to write nothing.

    Raises:
        InputError: the file cannot be written.
    """
    if record is None:
        return
    if session.readings is None:
        complain("warning", "there are no readings, so no record is written.")
        return
    with files.writing("--record", record):
        if record.lower().endswith(".csv"):
            io.write_readings(session.readings, record, unit="m")
        else:
            io.write_record(session, record)
