"""How a motion ended, and everything that was sensed on the way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from tanteo.hand import Sensed

Ending: TypeAlias = Literal["reached", "lost", "nothing", "limit", "timeout"]
"""``reached``: it did what it was for. ``lost``: the surface ended under a sensor, or gave no ranges any more.
``nothing``: within its reach there was nothing to sense. ``limit``: something, or a bound of the workspace, was so near
that it could not go on. ``timeout``: it took too long."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """One motion that has ended; the hand is commanded to rest.

    Attributes:
        name: Of the motion.
        status: How it ended.
        message: The same in one sentence.
        log: What was sensed, one entry a period, in order.
    """

    name: str
    status: Ending
    message: str
    log: tuple[Sensed, ...]

    @property
    def reached(self) -> bool:
        """It did what it was for."""
        return self.status == "reached"

    @property
    def seconds(self) -> float:
        """How long it took."""
        return self.log[-1].time - self.log[0].time if self.log else 0.0
