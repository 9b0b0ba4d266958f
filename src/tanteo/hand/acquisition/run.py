"""One acquisition under way, what it has done and sensed so far, and what becomes of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.geometry.typing import FloatArray
from tanteo.hand.acquisition.seen import Cloud, Known, cloud_of
from tanteo.hand.motion.following import retreat
from tanteo.hand.motion.steering import Motion, Rules
from tanteo.hand.robot import Hand, Robot
from tanteo.sensors import Readings, RobotPreset, concatenate
from tanteo.words.findings import AtPose, Finding

Outcome: TypeAlias = Literal["acquired", "lost", "nothing", "limit", "timeout", "unclear"]
"""``acquired``: the feature is sensed. ``unclear``: what was read does not determine it, or contradicts itself. The
others are the endings of the motion that could not do its part (:data:`tanteo.hand.Ending`)."""


Attempt: TypeAlias = tuple[Outcome, Finding, Feature | None]
"""Status of an attempt, its reason, and the feature, which is there exactly if it was acquired."""


def failed(motion: Motion) -> Attempt:
    """An acquisition that ends with a motion that could not do its part."""
    assert motion.status != "reached"
    return motion.status, motion.finding, None


@dataclass(frozen=True, slots=True, eq=False)
class Acquired:
    """One acquisition that has ended.

    Attributes:
        kind: ``plane``, ``edge`` or ``vertex``.
        status: How it ended.
        finding: reason for the status.
        feature: What was asked for; none unless acquired.
        others: Features that were sensed on the way: the face of an edge, the edges of a corner.
        readings: The record, of all labels; none if nothing was read on purpose.
        motions: All motions in order.
    """

    kind: str
    status: Outcome
    finding: Finding
    feature: Feature | None
    others: tuple[Feature, ...]
    readings: Readings | None
    motions: tuple[Motion, ...]

    @property
    def message(self) -> str:
        """Return the reason for the status in words."""
        return self.finding.message

    @property
    def acquired(self) -> bool:
        """The feature is sensed."""
        return self.status == "acquired"

    @property
    def seconds(self) -> float:
        """How long the robot took."""
        return self.motions[-1].log[-1].time - self.motions[0].log[0].time if self.motions else 0.0


LEAST_STANDOFF = 1.25
"""Stand-off in clearances: below, the guard would hold the hand before it arrives."""


@dataclass(slots=True)
class SensingRun:
    """One acquisition under way: its robot, its rules, the motions so far and the labelled readings.

    Attributes:
        robot: The hand.
        standoff: Of the hand's front over the surface [m].
        rules: What the motions keep to.
        errors: Of the robot, for the covariance; none are assumed without it.
        motions: All of them, in order.
        readings: Records of the labels so far.
        others: Features sensed on the way.
        places: Where the hand has stood over a patch ``(3,)`` [m].
    """

    robot: Robot
    standoff: float
    rules: Rules
    errors: RobotPreset | str | None
    motions: list[Motion] = field(default_factory=list)
    readings: list[Readings] = field(default_factory=list)
    others: list[Feature] = field(default_factory=list)
    places: list[FloatArray] = field(default_factory=list)
    _known: tuple[int, Known | None] = (0, None)

    def __post_init__(self) -> None:
        least = LEAST_STANDOFF * self.rules.clearance
        if not self.standoff >= least:
            raise InputError(
                f"standoff: expected at least {LEAST_STANDOFF:g} times the clearance ({1e3 * least:.3g} mm), got "
                f"{1e3 * self.standoff:.3g} mm. Keep farther away, or lower the clearance."
            )

    @property
    def hand(self) -> Hand:
        """Its hand."""
        return self.robot.hand

    def does(self, motion: Motion) -> Motion:
        """Remember a motion."""
        self.motions.append(motion)
        return motion

    def seen(self) -> Cloud:
        """What all motions so far have met, and what is met now."""
        now = Motion("now", "reached", AtPose(), (self.robot.sensed,))
        return cloud_of(self.hand, [*self.motions, now])

    def known(self) -> Known:
        """Where beams and hand have been in all motions so far."""
        count, before = self._known
        if before is None or count < len(self.motions):
            log = [s for motion in self.motions[count:] for s in motion.log] or [self.robot.sensed]
            before = Known(self.hand, log, before)
            self._known = len(self.motions), before
        return before


def back_off(run: SensingRun, distance: float) -> Motion:
    """Away from the surface along the hand's axis."""
    return run.does(retreat(run.robot, distance, run.rules))


def finish(kind: str, run: SensingRun, status: Outcome, finding: Finding, feature: Feature | None) -> Acquired:
    """The result of a run."""
    others = tuple(f for f in run.others if feature is None or f.label != feature.label)
    record = concatenate(run.readings) if run.readings else None
    return Acquired(kind, status, finding, feature, others, record, tuple(run.motions))
