"""Wrap every driver: check limits before a motion, watch it while it runs, and retract after it."""

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
"""Period of the watchdog [s]."""


@dataclass(slots=True, eq=False)
class SafeMachine:
    """Machine that enforces limits around any driver.

    It checks every motion before it sends it, passes it to ``confirm``, watches it, and checks its end. After an abort,
    an alarm, a lost connection or a missing answer it sends no further motion.

    Attributes:
        machine: driver of the machine.
        limits: limits of its motions.
        confirm: function that is called with the text of every motion before it is sent; False for a touch refuses
            that touch, False for a path ends the run. None to send without confirmation.
        dry_run: whether motions are checked and shown but not sent.
        show: function that receives the text of every motion; None for none.
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
        """Constant properties of the driver."""
        return self.machine.facts

    @property
    def stopped(self) -> str:
        """Reason for which no further motion is sent; empty if motions are possible."""
        return self._stopped

    def status(self) -> MachineStatus:
        """Return the status of the driver."""
        return self.machine.status()

    def place(self) -> Vectors:
        """Return the position of the tip ``(3,)`` [m]; in a dry run the position that it would have."""
        if self.dry_run and self._at is not None:
            return self._at
        return place_of(self.machine)

    def move(self, T_world_probe: Transforms) -> None:
        """Move straight to a pose, at the travel speed.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].

        Raises:
            RefusedError: the path violates the limits; nothing was sent.
            ContactError: the probe touched something; the machine has retracted to its start.
            StoppedError: the machine does not move any more.
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
        """Move along a direction until contact, inside :meth:`touching`; a range sensor measures at rest.

        Args:
            direction: unit direction ``(3,)``.
            reach: largest distance [m].

        Raises:
            RefusedError: the motion violates the limits, or the operator declined it; nothing was sent.
            ContactError: the probe was in contact at the start.
            StoppedError: the machine does not move any more.
        """
        contact = self.facts.contact
        if not 0 < reach <= (self.limits.reach if contact else np.inf):
            raise RefusedError(
                f"reach: expected up to {1e3 * self.limits.reach:g} mm, got {1e3 * reach:.3g} mm. "
                "Reduce the uncertainty of the pose, or allow a larger reach."
            )
        here = self.place()
        goal = here + reach * direction if contact else here
        what = "touch" if contact else "range"
        self._allow(here, goal, f"{what} along {in_words(direction)}, {1e3 * reach:.2f} mm at most")
        if self._only_shown(here):
            return Sensed(here, direction, np.inf, reach)
        speed = self.limits.touch
        sensed = self._watched(lambda s: self.machine.sense(direction, reach, speed, s), here, goal, speed)
        if sensed.hit and not 0 <= sensed.distance <= reach + self.limits.arrival:
            self._stop(f"a contact {1e3 * sensed.distance:.3f} mm away, beyond the commanded {1e3 * reach:.3f} mm")
        return sensed

    @contextmanager
    def touching(self) -> Iterator[None]:
        """Retract the probe at the end of the context, also after an error.

        The context contains a guarded motion and the processing of its result. The probe retracts to the end of the
        last motion, unless the machine has stopped.
        """
        start = self._last
        try:
            yield
        finally:
            if start is not None and self.facts.contact and not self._stopped and not self.dry_run:
                self._go_back(start)

    def abort(self, why: str = "a stop was commanded") -> None:
        """Stop immediately and permanently; never raises.

        Args:
            why: reason of the stop.
        """
        self._stopped = self._stopped or why
        self.machine.abort()

    def write_frame(self, text: str) -> None:
        """Send the lines that set a work frame to the controller.

        Args:
            text: lines, as :func:`tanteo.io.poses.write_work_frame` writes them.

        Raises:
            StoppedError: the machine takes no further commands.
        """
        self._check_running()
        self.machine.write_frame(text, self.limits.grace)

    def close(self) -> None:
        """Disconnect the machine."""
        self.machine.close()

    def _check_running(self) -> None:
        if self._stopped:
            raise StoppedError(
                f"{self.facts.name}: expected a machine that can move, got a stopped one: {self._stopped}. "
                "Check it, clear the stop at the machine, and start again."
            )

    def _allow(self, here: Vectors, goal: Vectors, what: str) -> None:
        """Check that a straight path may be sent; raise an error otherwise."""
        self._check_running()
        if not np.isfinite(goal).all():
            raise RefusedError(f"{what}: expected finite numbers, got others. Nothing was sent.")
        if past := self.limits.violation(here, goal):
            raise RefusedError(f"{what}: expected a path within the limits, got one past {past}. Nothing was sent.")
        if self.confirm is not None and not self.dry_run and not self.confirm(what):
            self._refused(what)
        if self.show is not None:
            self.show(what)

    def _refused(self, what: str) -> None:
        """Refuse a declined touch; stop at a declined path, because every other reading begins with a path."""
        no = f"{what}: expected a yes, got no. Nothing was sent."
        if what.startswith(("touch", "range")):
            raise RefusedError(no)
        self._stopped = self._stopped or "the operator declined a motion"
        raise StoppedError(no)

    def _only_shown(self, goal: Vectors) -> bool:
        if self.dry_run:
            self._at = goal
        return self.dry_run

    def _watched(self, run: Callable[[float], _T], here: Vectors, goal: Vectors, speed: float) -> _T:
        """Run a motion in a thread and watch it; return its result, or raise its error or that of a stop.

        A driver that hangs does not block this thread.
        """
        seconds = float(np.linalg.norm(goal - here)) / speed * 1.5 + self.limits.grace
        motion = futures.Future[_T]()

        def call() -> None:
            try:
                motion.set_result(run(seconds))
            except BaseException as error:  # noqa: BLE001  raised again in the calling thread
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
                    f"{self.facts.name}: expected its driver to end a motion or to raise a MachineError, got "
                    f"{type(error).__name__}: {error}. A stop was sent: check the machine, then the driver."
                ) from error
        return motion.result()

    def _wait(self, motion: futures.Future[_T], seconds: float) -> None:
        begun = time.monotonic()
        while not futures.wait([motion], _TICK).done:
            passed = time.monotonic() - begun
            if self._stopped:  # another thread has aborted; the driver ends its motion
                futures.wait([motion], 1.0)
                self._check_running()
            if (age := self.machine.status().age) > self.limits.stale and passed > self.limits.stale:
                self._late(f"the controller has sent nothing for {min(age, passed):.1f} s")
            if passed > seconds:
                self._late(f"a motion did not end within {seconds:.1f} s")

    def _late(self, why: str) -> None:
        self._stopped = self._stopped or why
        raise LateError(
            f"{self.facts.name}: expected an answer in time, got none: {why}. A stop was sent: check the machine "
            "before you start again."
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
            f"{self.facts.name}: expected its motions to end at their goals, got {got}. Check the machine."
        )

    def _go_back(self, T: Transforms) -> None:
        here, goal, speed = self.place(), T[:3, 3], self.limits.travel
        self._watched(lambda s: self.machine.back(T, speed, s), here, goal, speed)
        self._arrived(goal)
