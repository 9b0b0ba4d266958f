"""Contest: the policy senses the same scene, hidden, with one reading for each reading of the user."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from tanteo.hand import HandReading
from tanteo.hand.simulator import Solid
from tanteo.planning import Done, Step
from tanteo.render.live import drawing, panel
from tanteo.render.live.primitives import Primitive
from tanteo.render.live.shows import Show
from tanteo.render.live.snapshot import Result, Snapshot, result


class Opponent:
    """Hidden run of a show in a thread that computes only on request.

    Call :meth:`rest` before other computations, so that two threads never compute at the same time.

    Args:
        show: show to run; do not use it elsewhere before :meth:`rest` returns.
    """

    def __init__(self, show: Show) -> None:
        self.show = show
        self.end: Done | None = None
        self._error: BaseException | None = None
        self._gone = False
        self._allowed, self._resting = threading.Semaphore(0), threading.Event()
        self._resting.set()
        self._thread = threading.Thread(target=self._play, name="planner", daemon=True)
        self._thread.start()

    @property
    def steps(self) -> tuple[Step, ...]:
        """Steps of the hidden session so far."""
        return self.show.session.steps

    def turn(self) -> None:
        """Start one more reading, unless the hidden session has ended."""
        self.rest()
        if self.end is None:
            self._resting.clear()
            self._allowed.release()

    def rest(self, patience: Callable[[], None] = lambda: None) -> None:
        """Wait until the thread does not compute.

        Args:
            patience: function to call during the wait; it may raise.

        Raises:
            Exception: error that occurred in the thread.
        """
        while not self._resting.wait(0.1):
            patience()
        if self._error is not None:
            raise self._error

    def finish(self, patience: Callable[[], None]) -> Done:
        """Run the hidden session to its end, and return the end.

        Args:
            patience: function to call during the wait; it may raise.
        """
        while self.end is None:
            self.turn()
            self.rest(patience)
        return self.end

    def leave(self) -> None:
        """Stop the run, and wait until the thread does not compute."""
        self._gone = True
        self._allowed.release()
        self._resting.wait()

    def place(self, note: str) -> None:
        """Wait for the next turn after a reading (see :class:`tanteo.render.live.Watch`).

        Args:
            note: remarks on the reading, which are not shown.
        """
        self._resting.set()
        self._wait()

    def moved(self, sensed: HandReading) -> None:
        """Raise if the run was stopped; the hidden hand is not drawn.

        Args:
            sensed: readings and pose of the hand.

        Raises:
            _GoneError: the run was stopped.
        """
        if self._gone:
            raise _GoneError

    def _wait(self) -> None:
        self._allowed.acquire()
        if self._gone:
            raise _GoneError

    def _play(self) -> None:
        try:
            self._wait()
            self.end = self.show.run(self)
        except _GoneError:
            pass
        except BaseException as error:  # noqa: BLE001 - raised again in rest()
            self._error = error
        finally:
            self._resting.set()


class _GoneError(Exception):
    """Raised to end the thread."""


class Rival:
    """Policy with which the user is compared: it runs during a contest, and otherwise after the user has finished.

    Args:
        make: function that creates a show from seed and policy, reproducibly.
    """

    def __init__(self, make: Callable[[int, str], Show]) -> None:
        self._make = make
        self._opponent: Opponent | None = None
        self._results: dict[tuple[int, str], Result] = {}

    def begin(self, seed: int, policy: str) -> None:
        """Start the hidden run of a contest.

        Args:
            seed: seed of the scene.
            policy: name of the policy.
        """
        self.leave()
        self._opponent = Opponent(self._make(seed, policy))

    def leave(self) -> None:
        """Stop the hidden run."""
        if self._opponent is not None:
            self._opponent.leave()
        self._opponent = None

    def turn(self) -> None:
        """Start one more hidden reading in a contest."""
        if self._opponent is not None:
            self._opponent.turn()

    def rest(self) -> None:
        """Wait until the hidden run does not compute."""
        if self._opponent is not None:
            self._opponent.rest()

    def standing(self, places: int) -> str:
        """Return the posterior of the hidden session after a number of readings as text; empty without a contest.

        Args:
            places: number of readings.
        """
        if self._opponent is None or not places:
            return ""
        return panel.standing(self._opponent.steps[:places], places, through=self._opponent.end is not None)

    def play_on(self, patience: Callable[[], None]) -> list[Primitive]:
        """Run the hidden session to its end, and return its readings as primitives.

        Args:
            patience: function to call during the wait; it may raise.
        """
        assert self._opponent is not None
        self._opponent.finish(patience)
        return drawing.planner_primitives(Snapshot.of(self._opponent.show.session))

    def result(self, seed: int, policy: str, truth: Sequence[Solid], patience: Callable[[], None]) -> Result:
        """Return the result of the policy on the same scene.

        Args:
            seed: seed of the scene.
            policy: name of the policy.
            truth: real parts, world frame.
            patience: function to call during the wait; it may raise.
        """
        if (seed, policy) not in self._results:
            if self._opponent is None:
                self.begin(seed, policy)
            assert self._opponent is not None
            self._opponent.finish(patience)
            self._results[seed, policy] = result(self._opponent.show.session, truth)
        return self._results[seed, policy]
