"""Stop a machine when its process receives a signal that would end or suspend it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from tanteo.machines.safe import SafeMachine

_NAMES = (
    "SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGBREAK", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGXCPU",
)  # fmt: skip
"""Signals whose default action ends or suspends a process, which then would not watch its machine any more."""
_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


class Interrupted(KeyboardInterrupt):
    """The process received a signal during a run.

    Attributes:
        number: number of the signal.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__(f"the process received {signal.Signals(number).name}")


@contextmanager
def stop_on_signals(machine: SafeMachine) -> Iterator[None]:
    """Stop and close a machine when the process receives a signal during the context.

    The first signal forbids further motions and raises :class:`Interrupted` in the main thread, which stops a running
    motion. The probe does not retract after a stop. Later signals have no effect until the controller has cancelled the
    motion and the machine is closed, at most about two seconds. Signals that the program ignores or handles itself,
    and SIGKILL, are not changed; in other threads than the main one no signal is.

    Args:
        machine: machine that runs in the context.

    Raises:
        Interrupted: the process received a signal.
    """
    received = list[int]()

    def stop(number: int, frame: FrameType | None) -> None:
        if not received:
            received.append(number)
            interrupted = Interrupted(number)
            machine.forbid(str(interrupted))
            raise interrupted

    is_main = threading.current_thread() is threading.main_thread()
    numbers = [getattr(signal, name) for name in _NAMES if is_main and hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    handled = [number for number, handler in before.items() if handler in _DEFAULTS]
    for number in handled:
        signal.signal(number, stop)
    try:
        yield
    except KeyboardInterrupt:
        received.append(signal.SIGINT)  # later signals do not raise
        machine.abort("its run was interrupted")
        machine.close()
        raise
    finally:
        for number in handled:
            signal.signal(number, before[number])
