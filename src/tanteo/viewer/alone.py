"""The same scene without the person: how many places the policy needs by itself."""

from __future__ import annotations

import queue
from dataclasses import dataclass

from tanteo.hand import Sensed
from tanteo.viewer.commands import Command, leave
from tanteo.viewer.shows import Show


def places_alone(show: Show, commands: queue.SimpleQueue[Command]) -> int:
    """Carry a show out unseen; the number of its places.

    Args:
        show: of the same seed and policy.
        commands: what the person wants meanwhile; all but to leave is dropped.

    Raises:
        Left: the person wants to begin again, or to end.
    """
    show.run(_Unseen(commands))
    return len(show.session.steps)


@dataclass(frozen=True, slots=True, eq=False)
class _Unseen:
    """Watches a run that nobody sees."""

    commands: queue.SimpleQueue[Command]

    def place(self, note: str) -> None:
        while not self.commands.empty():
            leave(self.commands.get())

    def moved(self, sensed: Sensed) -> None:
        pass
