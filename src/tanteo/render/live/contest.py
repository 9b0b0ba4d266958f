"""The planner as an opponent: it plays the same scene unseen, place by place, while the person looks for the next."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from tanteo.hand import HandReading, Solid
from tanteo.planning import Done, Step
from tanteo.render.live import drawing, panel
from tanteo.render.live.primitives import Primitive
from tanteo.render.live.shows import Show
from tanteo.render.live.snapshot import Result, Snapshot, result


class Opponent:
    """Carries a show out unseen, in a thread that computes only when it is told to.

    Two threads never compute at the same time if whoever wants to compute calls :meth:`rest` before.

    Args:
        show: What it plays; nobody else may touch it before it rests.
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
        """What its places told so far."""
        return self.show.session.steps

    def turn(self) -> None:
        """Let it sense one more place; it has no turn when it is through."""
        self.rest()
        if self.end is None:
            self._resting.clear()
            self._allowed.release()

    def rest(self, patience: Callable[[], None] = lambda: None) -> None:
        """Wait until its turn is over.

        Args:
            patience: Called now and then; may raise.

        Raises:
            Exception: What went wrong in its thread.
        """
        while not self._resting.wait(0.1):
            patience()
        if self._error is not None:
            raise self._error

    def finish(self, patience: Callable[[], None]) -> Done:
        """Let it play to its end."""
        while self.end is None:
            self.turn()
            self.rest(patience)
        return self.end

    def leave(self) -> None:
        """End it where it is, and wait until it does not compute."""
        self._gone = True
        self._allowed.release()
        self._resting.wait()

    def place(self, note: str) -> None:
        """It sensed a place: its turn is over (see :class:`tanteo.render.Watch`)."""
        self._resting.set()
        self._wait()

    def moved(self, sensed: HandReading) -> None:
        """Nobody sees its hand, but it stops where it is when it is no longer wanted."""
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
        except BaseException as error:  # noqa: BLE001 - told to whoever waits for it
            self._error = error
        finally:
            self._resting.set()


class _GoneError(Exception):
    """It is no longer wanted."""


class Rival:
    """The planner beside the person: in a contest it plays along; otherwise it is played when the person is through.

    Args:
        make: A show from seed and policy; always the same one for the same.
    """

    def __init__(self, make: Callable[[int, str], Show]) -> None:
        self._make = make
        self._opponent: Opponent | None = None
        self._results: dict[tuple[int, str], Result] = {}

    def begin(self, seed: int, policy: str) -> None:
        """Sit down to a contest."""
        self.leave()
        self._opponent = Opponent(self._make(seed, policy))

    def leave(self) -> None:
        """Stop playing."""
        if self._opponent is not None:
            self._opponent.leave()
        self._opponent = None

    def turn(self) -> None:
        """Sense one more place, if it plays along."""
        if self._opponent is not None:
            self._opponent.turn()

    def rest(self) -> None:
        """Wait until it does not compute."""
        if self._opponent is not None:
            self._opponent.rest()

    def standing(self, places: int) -> str:
        """How far it was after so many places, in words; nothing if it does not play along."""
        if self._opponent is None or not places:
            return ""
        return panel.standing(self._opponent.steps[:places], places, through=self._opponent.end is not None)

    def play_on(self, patience: Callable[[], None]) -> list[Primitive]:
        """Play along to the end; where it sensed."""
        assert self._opponent is not None
        self._opponent.finish(patience)
        return drawing.planner_primitives(Snapshot.of(self._opponent.show.session))

    def result(self, seed: int, policy: str, truth: Sequence[Solid], patience: Callable[[], None]) -> Result:
        """What it comes to alone on the same scene."""
        if (seed, policy) not in self._results:
            if self._opponent is None:
                self.begin(seed, policy)
            assert self._opponent is not None
            self._opponent.finish(patience)
            self._results[seed, policy] = result(self._opponent.show.session, truth)
        return self._results[seed, policy]
