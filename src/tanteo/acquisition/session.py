"""One acquisition under way: what it has to do with, and what it has done and sensed so far."""

from __future__ import annotations

from dataclasses import dataclass, field

from tanteo.acquisition.acquired import Acquired, Outcome
from tanteo.acquisition.cloud import Cloud, cloud_of
from tanteo.acquisition.known import Known
from tanteo.acquisition.record import join
from tanteo.errors import InputError
from tanteo.features import Feature
from tanteo.hand import Hand, Robot
from tanteo.motion import Motion, Rules, retreat
from tanteo.sensors import Readings, RobotPreset
from tanteo.typing import FloatArray

LEAST_STANDOFF = 1.25
"""Stand-off in clearances: below, the guard would hold the hand before it arrives."""


@dataclass(slots=True)
class Session:
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
        now = Motion("now", "reached", "", (self.robot.sensed,))
        return cloud_of(self.hand, [*self.motions, now])

    def known(self) -> Known:
        """Where beams and hand have been in all motions so far."""
        count, before = self._known
        if before is None or count < len(self.motions):
            log = [s for motion in self.motions[count:] for s in motion.log] or [self.robot.sensed]
            before = Known(self.hand, log, before)
            self._known = len(self.motions), before
        return before


def back_off(session: Session, distance: float) -> Motion:
    """Away from the surface along the hand's axis."""
    return session.does(retreat(session.robot, distance, session.rules))


def finish(kind: str, session: Session, status: Outcome, message: str, feature: Feature | None) -> Acquired:
    """The result of a session."""
    others = tuple(f for f in session.others if feature is None or f.label != feature.label)
    record = join(session.readings)
    return Acquired(kind, status, message, feature, others, record, tuple(session.motions))
