"""Live pages of sessions, records and external runs."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tanteo.errors import MissingExtraError, install_command
from tanteo.geometry import SE3
from tanteo.geometry.typing import Vectors
from tanteo.planning import POLICIES, Session
from tanteo.render.live import drawing, panel
from tanteo.render.live.player import Page, Player
from tanteo.render.live.shows import Show
from tanteo.render.live.snapshot import Snapshot

if TYPE_CHECKING:
    from tanteo.hand import Hand, HandReading
    from tanteo.planning.start import Start
    from tanteo.render.live.page import LivePage


def moments(session: Session) -> list[Snapshot]:
    """Return the snapshots of a session before the first reading and after every step, each with the next action.

    Args:
        session: session from a record; it is not changed.
    """
    again = Session(session.start, session.probe, session.sensing, session.policy, session.stop, session.seed)
    again.significance = session.significance
    observations = session.observations
    following = [*(one.action for one in observations), session.pending]
    now = [Snapshot.of(again)]
    for one in observations:
        again.resume([one])
        now.append(Snapshot.of(again))
    pairs = zip(now, following, strict=True)
    return [replace(n, steps=session.steps[:k], action=a) for k, (n, a) in enumerate(pairs)]


def show_moment(page: Page, all_moments: Sequence[Snapshot], k: int) -> None:
    """Draw one moment of a session.

    Args:
        page: page to draw on.
        all_moments: all moments of the session.
        k: index of the moment.
    """
    now = all_moments[k]
    page.show("state", drawing.state_primitives(now))
    page.show("readings", drawing.reading_primitives(now))
    page.show("next", drawing.next_primitives(now))
    page.set_text("status", panel.status(now, f"Step {k} of {len(all_moments) - 1} of the record."))
    page.set_text("bars", panel.bars(now))
    page.set_text("steps", panel.steps([panel.step_line(m) for m in all_moments[1 : k + 1]]))


NEEDS_VISER = f"the live page: expected viser, got none installed. Install it: {install_command('viewer')}."


def play(
    make: Callable[[int, str], Show], seed: int, policy: str, *, port: int = 8080, ready: Callable[[str], None]
) -> None:
    """Open a page and run shows on it until the process is interrupted.

    Args:
        make: function that creates a show from seed and policy, reproducibly.
        seed: seed of the first show.
        policy: name of the policy of the first show.
        port: port on this machine; if it is in use, the next free one.
        ready: callback with the address of the page.

    Raises:
        MissingExtraError: viser is not installed.
    """
    first = make(seed, policy)
    middle, size = extent(first.session.start, first.hand)
    page = _opened(port, middle, size if first.hand else size + 0.5 * first.session.probe.standoff)
    player = Player(make, page, seed, policy)
    page.session_controls(player.commands.put, tuple(POLICIES), policy, seed, hand=first.hand is not None)
    ready(page.url)
    try:
        player.run()
    finally:
        page.stop()


def replay(session: Session, *, port: int = 8080, ready: Callable[[str], None]) -> None:
    """Open a page of a record, with a slider over its steps, until the process is interrupted.

    Args:
        session: session from a record.
        port: port on this machine, or the next free one.
        ready: callback with the address of the page.

    Raises:
        MissingExtraError: viser is not installed.
    """
    page = _opened(port, *extent(session.start))
    wanted: queue.SimpleQueue[int] = queue.SimpleQueue()
    every = moments(session)
    page.record_controls(wanted.put, len(every) - 1, hand=False)
    show_moment(page, every, len(every) - 1)
    ready(page.url)
    try:
        while True:
            try:
                show_moment(page, every, wanted.get(timeout=0.5))
            except queue.Empty:
                continue
    finally:
        page.stop()


@contextmanager
def follow(session: Session, *, port: int = 8080, ready: Callable[[str], None]) -> Iterator[Callable[[str], None]]:
    """Open a page of a session that runs elsewhere; the page cannot control it.

    The context yields a function that draws the present session with a note and requests its next action. The page
    closes at the end of the context.

    Args:
        session: session that runs elsewhere.
        port: port on this machine, or the next free one.
        ready: callback with the address of the page.

    Raises:
        MissingExtraError: viser is not installed.
    """
    page = _opened(port, *extent(session.start))
    lines = list[str]()

    def draw(note: str) -> None:
        session.ask()
        now = Snapshot.of(session)
        if len(now.steps) > len(lines):
            lines.append(panel.step_line(now))
        page.show("state", drawing.state_primitives(now))
        page.show("readings", drawing.reading_primitives(now))
        page.show("next", drawing.next_primitives(now))
        page.set_text("status", panel.status(now, note))
        page.set_text("bars", panel.bars(now))
        page.set_text("steps", panel.steps(lines))

    page.viewing_controls()
    draw("")
    ready(page.url)
    try:
        yield draw
    finally:
        page.stop()


def _opened(port: int, middle: Vectors, size: float) -> LivePage:
    try:
        from tanteo.render.live.page import LivePage  # needs the extra viewer
    except ModuleNotFoundError as error:
        if error.name != "viser":
            raise
        raise MissingExtraError(NEEDS_VISER) from None
    return LivePage(port, middle, size)


def extent(start: Start, hand: tuple[Hand, HandReading] | None = None) -> tuple[Vectors, float]:
    """Return centre and size of the view of the possible parts and of the hand [m].

    Args:
        start: prior poses of the parts.
        hand: hand and its first reading; None without a hand.
    """
    parts = [start.targets[k].part for k in start.part]
    middles = np.stack([SE3.apply(T, part.centroid) for part, T in zip(parts, start.Ts, strict=True)])
    middle, size = np.asarray(start.weights @ middles), max(part.diagonal for part in parts)
    if hand is None:
        return middle, size
    body, T = hand[0].body, hand[1].T_world_hand
    centres = SE3.apply(T, body.centres)
    seen = np.concatenate([centres - body.radii[:, None], centres + body.radii[:, None], middle[None] - size / 2])
    low, high = seen.min(axis=0), seen.max(axis=0)
    return (low + high) / 2, max(size, _FILLED * float((high - low).max()))


_FILLED = 0.8
"""Ratio of the size of the view to the extent of hand and parts, which the oblique view shortens."""
