"""Player of a session on a page: it waits between readings, obeys the user's commands, and compares at the end.

All work is in the thread that calls :meth:`Player.run`; a page only adds commands to :attr:`Player.commands`. The
readings depend only on the seed, the policy, and the order of the clicks, not on time.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NoReturn, Protocol

import numpy as np

from tanteo.hand import HandReading
from tanteo.planning import Action, Done
from tanteo.planning.policies import policy_named
from tanteo.render.live import drawing, panel
from tanteo.render.live.commands import (
    Advance,
    AnswerNow,
    Choose,
    Click,
    Command,
    Contest,
    Go,
    Left,
    Pause,
    Quit,
    Restart,
    leave,
    picked,
)
from tanteo.render.live.contest import Rival
from tanteo.render.live.primitives import Primitive
from tanteo.render.live.shows import Show
from tanteo.render.live.snapshot import Snapshot, by_hand, ending_words, result
from tanteo.words.findings import EndedByUser

_FRAME, _PAUSE, _SOON = 0.05, 1.5, 0.5
"""Time between pictures of a moving hand, pause between readings without a hand, and longest single wait [s]."""

HELP = "Press Go or Step, or click on a part to sense there yourself."
COMPARING = "The policy '{}' senses the same scene now ..."
YOUR_TURN = "Your turn: click where to sense. The planner senses the same scene, hidden from you."


class Page(Protocol):
    """Interface of a page that shows a session."""

    def show(self, group: str, primitives: Sequence[Primitive]) -> None:
        """Replace the primitives of a group.

        Args:
            group: name of the group.
            primitives: new content of the group.
        """
        ...

    def set_text(self, place: str, html: str) -> None:
        """Replace the text of a panel.

        Args:
            place: name of the panel: ``status``, ``bars`` or ``steps``.
            html: new content, escaped HTML.
        """
        ...


@dataclass(slots=True, eq=False)
class Player:
    """Player that runs shows on a page until the user closes it.

    Attributes:
        make: function that creates a show from seed and policy, reproducibly.
        page: page to draw on.
        seed: seed of the next show.
        policy: name of the policy of the next show.
        speed: multiple of real time.
        commands: queue of the user's commands.
    """

    make: Callable[[int, str], Show]
    page: Page
    seed: int
    policy: str = "information"
    speed: float = 3.0
    commands: queue.SimpleQueue[Command] = field(default_factory=queue.SimpleQueue)
    _mode: str = field(init=False, default="paused")
    _show: Show = field(init=False)
    _lines: list[str] = field(init=False, default_factory=list)
    _note: str = field(init=False, default="")
    _played: tuple[int, str] = field(init=False, default=(0, ""))
    _drawn: float = field(init=False, default=0.0)
    _last: HandReading | None = field(init=False, default=None)
    _contest: bool = field(init=False, default=False)
    _rival: Rival = field(init=False)

    def __post_init__(self) -> None:
        self._rival = Rival(self.make)

    def run(self) -> None:
        """Run until the command :class:`Quit`."""
        how: Command = Restart()
        while not isinstance(how, Quit):
            how = self._once(contest=isinstance(how, Contest))
        self._rival.leave()

    def _once(self, *, contest: bool) -> Command:
        """Run one show, wait at its end, and return the command that left it."""
        self._contest = contest
        try:
            self._over(self._played_on())
        except Left as left:
            return left.how

    def _played_on(self) -> Done:
        """Run one show to its end, or until the user requests the answer."""
        try:
            self._begin()
            self._gate()
            return self._show.run(self)
        except Left as left:
            if isinstance(left.how, AnswerNow):
                return Done(False, (EndedByUser(),))
            raise

    def _begin(self) -> None:
        self._rival.leave()
        self._show = self.make(self.seed, self.policy)
        self._lines, self._note, self._drawn, self._played = [], "", 0.0, (self.seed, self.policy)
        self._mode = "paused"
        self.page.show("furniture", drawing.furniture_primitives(self._show.furniture))
        self.page.show("truth", [])
        self.page.show("planner", [])
        if self._contest:
            self._rival.begin(self.seed, self.policy)
        self._last = None if self._show.hand is None else self._show.hand[1]
        self._hand()

    def place(self, note: str) -> None:
        """Show the result of a reading, and wait for the next command (see :class:`Watch`).

        Args:
            note: remarks for the user.
        """
        self._hand()
        session = self._show.session
        now = Snapshot.of(session)
        if len(now.steps) > len(self._lines):
            line = panel.step_line(now)
            self._lines.append(f"{line} ({note})" if note else line)
            self._note = note
        else:
            self._note = f"No reading there. {note}"
        if self._mode == "step":
            self._mode = "paused"
        self._gate()

    def moved(self, sensed: HandReading) -> None:
        """Draw the moving hand at the chosen speed.

        Args:
            sensed: readings and pose of the hand.
        """
        self._last = sensed
        gone = sensed.time - self._drawn
        if gone < _FRAME * self.speed and self.commands.empty():
            return
        self._hand()
        self._wait(gone / self.speed, resting=False)

    def _gate(self) -> None:
        """Choose and show the next reading, and wait until it may start."""
        self._rival.rest()
        action = self._show.session.ask()
        self._draw()
        if isinstance(action, Done):
            return
        self._rival.turn()  # meanwhile, the user searches
        self._wait(_PAUSE / self.speed if self._show.hand is None and self._mode == "going" else 0.0, resting=True)
        if self._show.hand is None:
            self._set_note("Sensing ...")  # the update may take a second

    def _wait(self, seconds: float, *, resting: bool) -> None:
        """Take commands for a time, and while the session is paused."""
        end = time.monotonic() + seconds
        while True:
            command = self._next(end)
            if command is not None:
                self._take(command, resting=resting)
            elif self._mode != "paused":
                return

    def _next(self, end: float) -> Command | None:
        """Return the next command, or None after a time; short waits allow interrupts."""
        left = end - time.monotonic()
        try:
            if self._mode == "paused":
                return self.commands.get(timeout=_SOON)
            return self.commands.get_nowait() if left <= 0 else self.commands.get(timeout=min(left, _SOON))
        except queue.Empty:
            return None

    def _take(self, command: Command, *, resting: bool) -> None:
        self._rival.rest()
        leave(command)
        if isinstance(command, Choose):
            self._choose(command, resting=resting)
        elif isinstance(command, Click):
            self._clicked(command, resting=resting)
        elif self._contest and not isinstance(command, Pause) and not by_hand(self._show.session.pending):
            self._set_note("In a contest you choose all places: click on the part.")
        else:
            self._mode = {Go: "going", Pause: "paused", Advance: "step"}[type(command)]
            self._set_note(self._note)

    def _choose(self, chosen: Choose, *, resting: bool) -> None:
        self.seed = self.seed if chosen.seed is None else chosen.seed
        self.speed = chosen.speed or self.speed
        if chosen.policy is None or chosen.policy == self.policy:
            return
        self.policy = chosen.policy
        if self._contest:  # used from the next contest: this planner has started
            return
        self._show.session.policy = policy_named(self.policy)
        if resting:
            self._show.session.put(None)
            self._show.session.ask()
            self._draw()

    def _clicked(self, click: Click, *, resting: bool) -> None:
        session = self._show.session
        if not resting or session.pending is None:
            self._set_note("Wait until the hand rests, then click again.")
            return
        now = Snapshot.of(session)
        seen = np.array([k for k in now.drawn_modes().tolist() if now.layer(k) not in click.hidden], dtype=np.int64)
        found = picked(session, seen, click.eye, click.ray, session.pending.number)
        if not isinstance(found, Action):
            self._set_note(found.message)
            return
        session.put(found)
        if self._mode == "paused":
            self._mode = "step"
        self._draw()

    def _over(self, done: Done) -> NoReturn:
        """Show the end, the real part, and the comparison with the planner."""
        session, truth = self._show.session, self._show.truth
        self._mode = "paused"
        self._rival.rest()
        self.page.show("truth", drawing.truth_primitives(truth))
        words, table = [*ending_words(session, done, truth)], ""
        if Snapshot.of(session).places[1] or self._contest:
            self._end([*words, COMPARING.format(self.policy)])
            table = self._compared()
        self._end(words, table)
        while True:
            command = self._next(0.0)
            if command is None:
                continue
            if isinstance(command, AnswerNow):
                continue
            leave(command)
            if isinstance(command, Choose):
                self.seed = self.seed if command.seed is None else command.seed
                self.policy, self.speed = command.policy or self.policy, command.speed or self.speed
            else:
                self._end([*words, "The session has ended. Press Restart to begin again."], table)

    def _compared(self) -> str:
        """Return the table that compares the user's run with the policy on the same scene."""
        session, truth = self._show.session, self._show.truth
        seed, policy = self._played if self._contest else (self._played[0], self.policy)
        if self._contest:
            self.page.show("planner", self._rival.play_on(self._patient))
        planned = self._rival.result(seed, policy, truth, self._patient)
        return panel.compared(result(session, truth), planned, Snapshot.of(session).places, truth=bool(truth))

    def _patient(self) -> None:
        """Let the user leave during a wait; other commands are dropped."""
        while not self.commands.empty():
            command = self.commands.get()
            if not isinstance(command, AnswerNow):
                leave(command)

    def _hand(self) -> None:
        if self._last is not None and self._show.hand is not None:
            self._drawn = self._last.time
            self.page.show("hand", drawing.hand_primitives(self._show.hand[0], self._last))
            if self._show.arm is not None:
                self.page.show("arm", drawing.arm_primitives(self._show.arm))

    def _draw(self) -> None:
        now = Snapshot.of(self._show.session)
        self.page.show("state", drawing.state_primitives(now))
        self.page.show("readings", drawing.reading_primitives(now))
        hidden = self._contest and not by_hand(now.action)
        self.page.show("next", [] if hidden else drawing.next_primitives(now))
        self.page.set_text("bars", panel.bars(now))
        self.page.set_text("steps", panel.steps(self._lines))
        self._set_note(self._note)

    def _set_note(self, note: str) -> None:
        now = Snapshot.of(self._show.session)
        waits = self._mode == "paused" and now.action is not None
        help_ = (YOUR_TURN if self._contest else HELP) if waits else ""
        self.page.set_text("status", panel.status(now, note, help_, self._rival.standing(len(now.steps))))

    def _end(self, words: Sequence[str], table: str = "") -> None:
        self.page.set_text("status", panel.verdict(Snapshot.of(self._show.session), words, table))
