"""Wrap every driver: check limits before a motion, watch it while it runs, and retract after it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import NoReturn, TypeVar

import numpy as np

from tanteo.errors import TanteoError
from tanteo.geometry import SE3
from tanteo.geometry.typing import Rotations, Transforms, Vectors
from tanteo.machines.limits import DOWN, MachineLimits
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
KNOWN = 2e-3
"""Accepted error of the height of a known surface [m]: the least overtravel of a touch."""


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
    _at_axes: Rotations | None = field(init=False, default=None)
    _rest: Vectors | None = field(init=False, default=None)
    _away: Vectors | None = field(init=False, default=None)

    @property
    def facts(self) -> Facts:
        """Constant properties of the driver."""
        return self.machine.facts

    @property
    def stopped(self) -> str:
        """Reason for which no further motion is sent; empty if motions are possible."""
        return self._stopped

    @property
    def away(self) -> Vectors | None:
        """Unit direction that leads the tip away from a touch that did not end with a retreat; None otherwise."""
        return self._away

    def status(self) -> MachineStatus:
        """Return the status of the driver."""
        return self.machine.status()

    def place(self) -> Vectors:
        """Return the position of the tip ``(3,)`` [m]; in a dry run the position that it would have."""
        if self.dry_run and self._at is not None:
            return self._at
        try:
            return place_of(self.machine)
        except StoppedError as error:
            self.abort(str(error))
            raise

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
        axes = self._axes(), T_world_probe[:3, :3] if self.facts.turns else DOWN
        self._allow(here, goal, f"move to {in_mm(goal)}", axes)
        if self._only_shown(goal, axes[1]):
            return
        came = SE3.from_parts(axes[0], here)
        self._rest = None  # until the motion has ended
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
        if not (np.shape(direction) == (3,) and abs(float(np.linalg.norm(direction)) - 1) < 1e-6):
            raise RefusedError(f"direction: expected a unit vector, got {direction}. Nothing was sent.")
        if not 0 < reach <= (self.limits.reach if contact else np.inf):
            raise RefusedError(
                f"reach: expected up to {1e3 * self.limits.reach:g} mm, got {1e3 * reach:.3g} mm. "
                "Reduce the uncertainty of the pose, or allow a larger reach."
            )
        here = self.place()
        goal = here + reach * direction if contact else here
        what = "touch" if contact else "range"
        axes = self._axes()
        self._allow(here, goal, f"{what} along {in_words(direction)}, {1e3 * reach:.2f} mm at most", (axes, axes))
        if self._only_shown(here, axes):
            return Sensed(here, direction, np.inf, reach)
        speed, self._rest = self.limits.touch, None  # until the motion has ended
        self._away = -direction if contact else None
        sensed = self._watched(lambda s: self.machine.sense(direction, reach, speed, s), here, goal, speed)
        self._check_reading(sensed, here, direction, reach)
        self._rest = None if self.facts.recorded else self.place()
        return sensed

    def check_by_hand(self, seconds: float = 60.0) -> None:
        """Wait until the user triggers the probe by hand and releases it; nothing moves.

        Args:
            seconds: largest time to wait [s].

        Raises:
            StoppedError: the probe reported no contact, or reported one before or after; no motion is possible.
        """
        self._check_running()
        end = time.monotonic() + seconds
        if self._tripped() is not False:
            self._forbid_probe("it reports a contact before it is triggered: its circuit is closed, or inverted")
        for wanted, why in (
            (True, f"it reported no contact within {seconds:g} s: its circuit is open, or it is on another input"),
            (False, "it still reports a contact after it was triggered: its circuit stays closed"),
        ):
            while self._tripped() is not wanted:
                if not time.monotonic() <= end:
                    self._forbid_probe(why)
                time.sleep(_TICK)
            end = time.monotonic() + seconds

    def check_on_surface(self, height: float) -> None:
        """Touch a known surface straight below the tip, and retract.

        Args:
            height: height of the ball's centre at the contact, in the machine's frame [m]; the tip moves at most one
                :data:`KNOWN` below it.

        Raises:
            StoppedError: there was no contact, or one farther than :data:`KNOWN` from the height.
        """
        here = self.place()
        self._last = SE3.from_parts(self._axes(), here)
        with self.touching():
            sensed = self.sense(np.array([0.0, 0.0, -1.0]), float(here[2]) - height + KNOWN)
        if self.dry_run:
            return
        if not sensed.hit:
            self._forbid_probe("it passed a known surface without a contact: its circuit is open")
        if not abs(here[2] - sensed.distance - height) <= KNOWN:
            off = 1e3 * (here[2] - sensed.distance - height)
            self._forbid_probe(f"a known surface is {off:.3f} mm from its height")

    def _tripped(self) -> bool | None:
        """Return whether the probe reports a contact, from a status that is not old."""
        status = self.machine.status()
        if not status.age <= self.limits.stale:
            self._late(f"the controller has sent nothing for {status.age:.1f} s")
        if status.state != "idle":
            self._forbid_probe(f"the machine is {status.state} while its probe is checked")
        return status.tripped

    def _forbid_probe(self, why: str) -> NoReturn:
        self.forbid(f"its probe does not work: {why}")
        self._check_running()
        raise AssertionError("a stopped machine raises")

    @contextmanager
    def touching(self) -> Iterator[None]:
        """Retract the probe at the end of the context, also after an error.

        The context contains a guarded motion and the processing of its result. The probe retracts to the end of the
        last motion, unless the machine has stopped or the user has interrupted the program.
        """
        start = self._last
        try:
            yield
        except KeyboardInterrupt:
            self.abort("its run was interrupted")
            raise
        finally:
            if start is not None and self.facts.contact and not self._stopped and not self.dry_run:
                self._go_back(start)

    def abort(self, why: str = "a stop was commanded") -> None:
        """Stop immediately and permanently; never raises.

        Args:
            why: reason of the stop.
        """
        self.forbid(why)
        self.machine.abort()

    def forbid(self, why: str) -> None:
        """Send no further motion; the machine, which is at rest, receives nothing.

        Args:
            why: reason of the stop.
        """
        self._stopped = self._stopped or why

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

    def _axes(self) -> Rotations:
        """Return the current axes of the tool ``(3, 3)``: reported ones, or those at the end of the last motion."""
        if not self.facts.turns:
            return DOWN
        if self.dry_run and self._at_axes is not None:
            return self._at_axes
        axes = self.machine.status().axes
        if axes is None:
            axes = DOWN if self._last is None else self._last[:3, :3]
        if not (np.shape(axes) == (3, 3) and np.isfinite(axes).all()):
            self._stop(f"axes of the tool {np.asarray(axes).tolist()}", "positions")
        return axes

    def _allow(self, here: Vectors, goal: Vectors, what: str, axes: Sequence[Rotations]) -> None:
        """Check that a straight path may be sent; raise an error otherwise."""
        self._check_running()
        if not np.isfinite(goal).all():
            raise RefusedError(f"{what}: expected finite numbers, got others. Nothing was sent.")
        self._check_rest(here)
        if past := self.limits.violation(here, goal, axes):
            raise RefusedError(f"{what}: expected a path within the limits, got one past {past}. Nothing was sent.")
        if self.confirm is not None and not self.dry_run and not self.confirm(what):
            self._refused(what)
        if self.show is not None:
            self.show(what)

    def _check_rest(self, here: Vectors) -> None:
        """Check that nothing has moved the machine since its last motion ended."""
        if self._rest is None or self.dry_run:
            return
        off = float(np.linalg.norm(here - self._rest))
        if not off <= self.limits.arrival:
            self.forbid(f"another sender moved it by {1e3 * off:.3f} mm")
            self._check_running()

    def _check_reading(self, sensed: Sensed, here: Vectors, direction: Vectors, reach: float) -> None:
        """Check that a reading lies on the commanded line, and that the tip rests where the reading reports it."""
        if not (np.shape(sensed.start) == np.shape(sensed.direction) == (3,) and sensed.distance > -np.inf):
            self._stop(f"a reading at {sensed.start} along {sensed.direction} of {sensed.distance} m", "readings")
        if not np.isfinite([*sensed.start, *sensed.direction]).all():
            self._stop("a reading with numbers that are not finite", "readings")
        if self.facts.recorded:
            return
        near = self.limits.arrival
        if not np.linalg.norm(sensed.start - here) <= near:
            self._stop(f"a reading that begins at {in_mm(sensed.start)} in place of {in_mm(here)}", "readings")
        if self.facts.contact and not np.linalg.norm(sensed.direction - direction) <= near / reach:
            self._stop(f"a reading along {in_words(sensed.direction)}", "readings")
        if sensed.hit and not 0 <= sensed.distance <= reach + near:
            self._stop(f"a contact {1e3 * sensed.distance:.3f} mm away on a motion of {1e3 * reach:.3f} mm", "readings")
        if not self.facts.contact:
            return
        end = here + min(sensed.distance, reach) * direction
        if sensed.reported is not None and not np.linalg.norm(sensed.reported - end) <= near:
            self._stop(f"a report of {in_mm(sensed.reported)}, beside the line to {in_mm(end)}", "readings")
        self._check_stand(end, direction, hit=sensed.hit)

    def _check_stand(self, end: Vectors, direction: Vectors, *, hit: bool) -> None:
        """Check that the tip rests at the end of a reading: at its goal, or a braking distance beyond a contact."""
        near, stand = self.limits.arrival, self.place() - end
        along = float(stand @ direction)
        beside = float(np.linalg.norm(stand - along * direction))
        brake = 0.5 * self.limits.touch**2 / self.facts.deceleration if hit else 0.0
        if not (beside <= near and -near <= along <= near + brake):
            what = "a contact" if hit else "no contact"
            self._stop(f"{what} up to {in_mm(end)}, but a tip that rests at {in_mm(self.place())}", "readings")

    def _refused(self, what: str) -> None:
        """Refuse a declined touch; stop at a declined path, because every other reading begins with a path."""
        no = f"{what}: expected a yes, got no. Nothing was sent."
        if what.startswith(("touch", "range")):
            raise RefusedError(no)
        self._stopped = self._stopped or "the operator declined a motion"
        raise StoppedError(no)

    def _only_shown(self, goal: Vectors, axes: Rotations) -> bool:
        if self.dry_run:
            self._at, self._at_axes = goal, axes
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
            status = self.machine.status()
            if not status.age <= self.limits.stale and passed > self.limits.stale:
                self._late(f"the controller has sent nothing for {np.fmin(status.age, passed):.1f} s")
            if status.place is not None and not np.isfinite(status.place).all():
                self._stop(f"a position of {status.place.tolist()}", "positions")
            if not passed <= seconds:
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
        if not off <= self.limits.arrival:
            self._stop(f"a motion that ended {1e3 * off:.3f} mm from its goal, at {in_mm(here)}", "motions")
        self._rest = here

    def _stop(self, got: str, what: str) -> NoReturn:
        self.abort(got)
        expected = {
            "motions": "its motions to end at their goals", "positions": "positions of three finite numbers",
            "readings": "readings on the commanded line, where the tip rests",
        }  # fmt: skip
        raise StoppedError(f"{self.facts.name}: expected {expected[what]}, got {got}. Check the machine.")

    def _go_back(self, T: Transforms) -> None:
        here, goal, speed = self.place(), T[:3, 3], self.limits.travel
        self._watched(lambda s: self.machine.back(T, speed, s), here, goal, speed)
        self._arrived(goal)
        self._away = None
        if self.facts.contact and self.machine.status().tripped:
            self._forbid_probe("it still reports a contact after the retreat: its circuit is closed")
