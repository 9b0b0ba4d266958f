"""What became of an acquisition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from tanteo.features import Feature
from tanteo.motion import Motion
from tanteo.sensors import Readings

Outcome: TypeAlias = Literal["acquired", "lost", "nothing", "limit", "timeout", "unclear"]
"""``acquired``: the feature is sensed. ``unclear``: what was read does not determine it, or contradicts itself. The
others are the endings of the motion that could not do its part (:data:`tanteo.motion.Ending`)."""


Attempt: TypeAlias = tuple[Outcome, str, Feature | None]
"""How it ended, the same in one sentence, and the feature, which is there exactly if it was acquired."""


def failed(motion: Motion) -> Attempt:
    """An acquisition that ends with a motion that could not do its part."""
    assert motion.status != "reached"
    return motion.status, motion.message, None


@dataclass(frozen=True, slots=True, eq=False)
class Acquired:
    """One acquisition that has ended.

    Attributes:
        kind: ``plane``, ``edge`` or ``vertex``.
        status: How it ended.
        message: The same in one sentence.
        feature: What was asked for; none unless acquired.
        others: Features that were sensed on the way: the face of an edge, the edges of a corner.
        readings: The record, of all labels; none if nothing was read on purpose.
        motions: All motions in order.
    """

    kind: str
    status: Outcome
    message: str
    feature: Feature | None
    others: tuple[Feature, ...]
    readings: Readings | None
    motions: tuple[Motion, ...]

    @property
    def acquired(self) -> bool:
        """The feature is sensed."""
        return self.status == "acquired"

    @property
    def seconds(self) -> float:
        """How long the robot took."""
        return self.motions[-1].log[-1].time - self.motions[0].log[0].time if self.motions else 0.0
