"""A recorded session, step by step."""

from __future__ import annotations

from collections.abc import Sequence

from tanteo.session import Session
from tanteo.viewer import drawing, panel
from tanteo.viewer.player import Page
from tanteo.viewer.snapshot import Snapshot


def moments(session: Session) -> list[Snapshot]:
    """What was known before the first reading and after every telling; each with the question that came next.

    Args:
        session: as it was read from its record; it is told again, and stays as it is.
    """
    again = Session(session.start, session.probe, session.sensing, session.policy, session.stop, session.seed)
    told = session.observations
    following = [*(one.action for one in told), session.asked]
    states = [again.state]
    for one in told:
        again.resume([one])
        states.append(again.state)
    return [Snapshot(b, session.steps[:k], a) for k, (b, a) in enumerate(zip(states, following, strict=True))]


def show_moment(page: Page, all_moments: Sequence[Snapshot], k: int) -> None:
    """Draw one of them."""
    now = all_moments[k]
    page.show("state", drawing.state_primitives(now))
    page.show("readings", drawing.reading_primitives(now))
    page.show("next", drawing.next_primitives(now))
    page.say("status", panel.status(now, f"After step {k} of {len(all_moments) - 1} of the record."))
    page.say("bars", panel.bars(now))
    page.say("told", panel.steps([panel.step_line(m) for m in all_moments[1 : k + 1]]))
