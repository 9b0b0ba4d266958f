"""The one wrapper around every driver: limits before a motion, a watchdog beside it, the way back after it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent import futures
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from tanteo.errors import TanteoError
from tanteo.geometry import SE3
from tanteo.geometry.typing import Transforms, Vectors
from tanteo.machines.limits import MachineLimits
from tanteo.machines.protocol import (
    ContactError,
    Facts,
    LateError,
    Machine,
    MachineError,
    MachineStatus,
    RefusedError,
    Sensed,
    StoppedError,
    in_mm,
    in_words,
    place_of,
)

_T = TypeVar("_T")
_TICK = 0.02
"""Between two looks of the watchdog [s]."""


@dataclass(slots=True, eq=False)
class SafeMachine:
    """A machine that keeps its limits, whoever drives it.

    Every motion is checked before it is sent, shown to ``confirm``, watched while it runs, and checked where it ended.
    After an abort, an alarm, a lost connection or a missing answer there is no further motion.

    Attributes:
        machine: the driver.
        limits: what it may do.
        confirm: asked in words before every motion; False to a touch refuses that place, to a way ends the run.
        dry_run: motions are checked and shown, and none is sent.
        show: told in words of every motion.
    """

    machine: Machine
    limits: MachineLimits
    confirm: Callable[[str], bool] | None = None
    dry_run: bool = False
    show: Callable[[str], None] | None = None
    _stopped: str = field(init=False, default="")
    _last: Transforms | None = field(init=False, default=None)
    _at: Vectors | None = field(init=False, default=None)

    @property
    def facts(self) -> Facts:
        """Of the driver."""
        return self.machine.facts

    @property
    def stopped(self) -> str:
        """Why there is no further motion; empty if there may be."""
        return self._stopped

    def status(self) -> MachineStatus:
        """Of the driver."""
        return self.machine.status()

    def place(self) -> Vectors:
        """Where the tip is ``(3,)`` [m]; in a dry run where it would be."""
        if self.dry_run and self._at is not None:
            return self._at
        return place_of(self.machine)

    def move(self, T_world_probe: Transforms) -> None:
        """Straight to a pose, at the speed of travelling.

        Raises:
            RefusedError: it is outside of the limits, or was refused; nothing was sent.
            ContactError: something was met; the machine was brought back to where it came from.
            StoppedError: no further motion.
        """
        goal, here, speed = T_world_probe[:3, 3], self.place(), self.limits.travel
        self._allow(here, goal, f"move to {in_mm(goal)}")
        if self._only_shown(goal):
            return
        came = SE3.from_parts(T_world_probe[:3, :3], here)
        try:
            self._watched(lambda s: self.machine.move(T_world_probe, speed, s), here, goal, speed)
        except ContactError:
            self._go_back(came)
            raise
        self._arrived(goal)
        self._last = T_world_probe

    def sense(self, direction: Vectors, reach: float) -> Sensed:
        """From here along a direction until something is met; what follows should be inside :meth:`touching`.

        A range sensor looks along it from where it rests.
        """
        contact = self.facts.contact
        if not 0 < reach <= (self.limits.reach if contact else np.inf):
            raise RefusedError(
                f"reach: expected up to {1e3 * self.limits.reach:g} mm, got {1e3 * reach:.3g} mm. "
                "Know the place better, or allow more."
            )
        here = self.place()
        goal = here + reach * direction if contact else here
        what = "touch" if contact else "range"
        self._allow(here, goal, f"{what} along {in_words(direction)}, {1e3 * reach:.2f} mm at most")
        if self._only_shown(here):
            return Sensed(here, direction, np.inf, reach)
        speed = self.limits.touch
        sensed = self._watched(lambda s: self.machine.sense(direction, reach, speed, s), here, goal, speed)
        if sensed.met and not 0 <= sensed.distance <= reach + self.limits.arrival:
            self._stop(f"a contact {1e3 * sensed.distance:.3f} mm away, beyond the {1e3 * reach:.3f} mm that were sent")
        return sensed

    @contextmanager
    def touching(self) -> Iterator[None]:
        """Inside is a guarded motion and what is made of it: on leaving, however that is, the probe goes back.

        It goes to where the last motion ended, unless the machine has stopped.
        """
        start = self._last
        try:
            yield
        finally:
            if start is not None and self.facts.contact and not self._stopped and not self.dry_run:
                self._go_back(start)

    def abort(self, why: str = "it was told to stop") -> None:
        """Stop at once, for good; never raises."""
        self._stopped = self._stopped or why
        self.machine.abort()

    def write_frame(self, text: str) -> None:
        """Have the controller set a frame.

        Raises:
            StoppedError: no further command.
        """
        self._check_running()
        self.machine.write_frame(text, self.limits.grace)

    def close(self) -> None:
        """Let go of the machine."""
        self.machine.close()

    def _check_running(self) -> None:
        if self._stopped:
            raise StoppedError(
                f"{self.facts.name}: expected a machine that may move, got one that has stopped: {self._stopped}. "
                "Look at it, clear it there, and start again."
            )

    def _allow(self, here: Vectors, goal: Vectors, what: str) -> None:
        """Whether a straight way may be sent at all."""
        self._check_running()
        if not np.isfinite(goal).all():
            raise RefusedError(f"{what}: expected finite numbers, got others. Nothing was sent.")
        if past := self.limits.passed(here, goal):
            raise RefusedError(f"{what}: expected a way that keeps its limits, got one past {past}. Nothing was sent.")
        if self.confirm is not None and not self.dry_run and not self.confirm(what):
            self._refused(what)
        if self.show is not None:
            self.show(what)

    def _refused(self, what: str) -> None:
        """A no to a touch is one to that place, a no to a way ends the run: each other place begins with a way."""
        no = f"{what}: expected a yes, got no. Nothing was sent."
        if what.startswith(("touch", "range")):
            raise RefusedError(no)
        self._stopped = self._stopped or "you said no to a motion"
        raise StoppedError(no)

    def _only_shown(self, goal: Vectors) -> bool:
        if self.dry_run:
            self._at = goal
        return self.dry_run

    def _watched(self, run: Callable[[float], _T], here: Vectors, goal: Vectors, speed: float) -> _T:
        """A motion in a thread of its own, which may hang without this one: its end, its error, or a stop."""
        seconds = float(np.linalg.norm(goal - here)) / speed * 1.5 + self.limits.grace
        motion = futures.Future[_T]()

        def call() -> None:
            try:
                motion.set_result(run(seconds))
            except BaseException as error:  # noqa: BLE001  handed to the thread that asked
                motion.set_exception(error)

        threading.Thread(target=call, daemon=True, name="motion").start()
        try:
            self._wait(motion, seconds + 1.0)
        except BaseException:
            self.abort("its motion was interrupted")
            futures.wait([motion], 1.0)
            raise
        if (error := motion.exception()) is not None:
            self._latch(error)
            if not isinstance(error, TanteoError):
                raise StoppedError(
                    f"{self.facts.name}: expected its driver to end a motion or to say why not, got "
                    f"{type(error).__name__}: {error}. A stop was sent: check the machine, then the driver."
                ) from error
        return motion.result()

    def _wait(self, motion: futures.Future[_T], seconds: float) -> None:
        begun = time.monotonic()
        while not futures.wait([motion], _TICK).done:
            passed = time.monotonic() - begun
            if self._stopped:  # by another thread; the driver ends its motion by itself
                futures.wait([motion], 1.0)
                self._check_running()
            if (age := self.machine.status().age) > self.limits.stale and passed > self.limits.stale:
                self._late(f"the controller has said nothing for {min(age, passed):.1f} s")
            if passed > seconds:
                self._late(f"a motion did not end within {seconds:.1f} s")

    def _late(self, why: str) -> None:
        self._stopped = self._stopped or why
        raise LateError(
            f"{self.facts.name}: expected an answer in time, got none: {why}. It was told to stop: look at it before "
            "you start again."
        )

    def _latch(self, error: BaseException) -> None:
        if isinstance(error, StoppedError) or not isinstance(error, MachineError):
            self._stopped = self._stopped or str(error)
            self.machine.abort()

    def _arrived(self, goal: Vectors) -> None:
        here = self.place()
        off = float(np.linalg.norm(here - goal))
        if off > self.limits.arrival:
            self._stop(f"a motion that ended {1e3 * off:.3f} mm from its goal, at {in_mm(here)}")

    def _stop(self, got: str) -> None:
        self.abort(got)
        raise StoppedError(
            f"{self.facts.name}: expected its motions to end where they were sent, got {got}. Look there."
        )

    def _go_back(self, T: Transforms) -> None:
        here, goal, speed = self.place(), T[:3, 3], self.limits.travel
        self._watched(lambda s: self.machine.back(T, speed, s), here, goal, speed)
        self._arrived(goal)
