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
from tanteo.sensors import Readings, concatenate
from tanteo.sensors.presets import RobotPreset
from tanteo.words.findings import AtPose, Finding

Outcome: TypeAlias = Literal["acquired", "lost", "nothing", "limit", "timeout", "unclear"]
"""``acquired``: the feature is sensed. ``unclear``: what was read does not determine it, or contradicts itself. The
others are the endings of the motion that could not do its part (:data:`tanteo.hand.motion.Ending`)."""


Attempt: TypeAlias = tuple[Outcome, Finding, Feature | None]
"""Status, reason as a finding, and the feature; None unless the status is ``acquired``."""


def failed(motion: Motion) -> Attempt:
    """Return the result of an acquisition that ends with a failed motion.

    Args:
        motion: motion that did not reach its goal.
    """
    assert motion.status != "reached"
    return motion.status, motion.finding, None


@dataclass(frozen=True, slots=True, eq=False)
class Acquired:
    """Result of an acquisition.

    Attributes:
        kind: kind of the feature: ``plane``, ``edge``, ``vertex``, ``circle`` or ``cylinder``.
        status: status at the end.
        finding: reason for the status.
        feature: acquired feature; None unless the status is ``acquired``.
        others: further sensed features, such as the face of an edge or the edges of a corner.
        readings: record of all labels; None if there are no readings of features.
        motions: motions in order.
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
        """Return the reason for the status as text."""
        return self.finding.message

    @property
    def acquired(self) -> bool:
        """Whether the feature was acquired."""
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
        """Append a motion to the run, and return it.

        Args:
            motion: motion that has ended.
        """
        self.motions.append(motion)
        return motion

    def seen(self) -> Cloud:
        """Return the points that all motions and the current reading have measured."""
        now = Motion("now", "reached", AtPose(), (self.robot.sensed,))
        return cloud_of(self.hand, [*self.motions, now])

    def known(self) -> Known:
        """Return the space that beams and hand have covered in all motions so far."""
        count, before = self._known
        if before is None or count < len(self.motions):
            log = [s for motion in self.motions[count:] for s in motion.log] or [self.robot.sensed]
            before = Known(self.hand, log, before)
            self._known = len(self.motions), before
        return before


def back_off(run: SensingRun, distance: float) -> Motion:
    """Retreat from the surface along the hand's axis.

    Args:
        run: running acquisition.
        distance: distance of the retreat [m].
    """
    return run.does(retreat(run.robot, distance, run.rules))


def finish(kind: str, run: SensingRun, status: Outcome, finding: Finding, feature: Feature | None) -> Acquired:
    """Return the result of a run.

    Args:
        kind: kind of the feature.
        run: acquisition.
        status: status at the end.
        finding: reason for the status.
        feature: acquired feature; None if there is none.
    """
    others = tuple(f for f in run.others if feature is None or f.label != feature.label)
    record = concatenate(run.readings) if run.readings else None
    return Acquired(kind, status, finding, feature, others, record, tuple(run.motions))
