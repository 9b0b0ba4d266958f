"""Findings of a session, which chooses one reading after the other: its state, and why it ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class NoContact(Finding):
    """No reading of a session has hit a part yet."""

    kind: ClassVar[str] = "nothing_met"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class EmptySpace(Finding):
    """Beams had no echo at every place where the part may be."""

    kind: ClassVar[str] = "empty_space"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class NoPartLeft(Finding):
    """No part at any prior pose explains the readings of a session."""

    kind: ClassVar[str] = "no_part_left"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class WiderPrior(Finding):
    """A session contradicts its prior pose, and a new one may have a wider one."""

    kind: ClassVar[str] = "wider_prior"
    role: ClassVar[Role] = "advice"


@dataclass(frozen=True, slots=True)
class MovedMeanwhile(Finding):
    """The readings that do not fit are together in time: something may have moved.

    Attributes:
        first: id of the first of them.
        last: id of the last one.
        outliers: their number, where the readings between fit in part; 0 where all of these do not fit.
        fitting: id of the reading beyond which all fit.
        after: whether the fitting ones come after that reading; otherwise before.
    """

    kind: ClassVar[str] = "moved"
    first: str
    last: str
    outliers: int
    fitting: str
    after: bool


@dataclass(frozen=True, slots=True)
class GoalReached(Finding):
    """Part and pose are known as well as the goal demands.

    Attributes:
        part: name of the part.
        probability: its posterior; NaN if the goal demands no part.
        tolerance: tolerance of the goal [m]; NaN if the goal demands no pose.
        within: probability that the tolerance is kept; NaN without one.
        feature: feature of the part that has to keep the tolerance; empty for all corners of the part's box.
    """

    kind: ClassVar[str] = "goal_reached"
    role: ClassVar[Role] = "verdict"
    part: str
    probability: float = float("nan")
    tolerance: float = float("nan")
    within: float = float("nan")
    feature: str = ""


@dataclass(frozen=True, slots=True)
class ReadingLimit(Finding):
    """The largest allowed number of readings is made.

    Attributes:
        allowed: largest number of readings that the goal allows.
        made: number of readings that were made; more if some came without being requested.
    """

    kind: ClassVar[str] = "reading_limit"
    role: ClassVar[Role] = "verdict"
    allowed: int
    made: int


@dataclass(frozen=True, slots=True)
class NotWorthCost(Finding):
    """No reading is expected to give enough information.

    Attributes:
        gain: expected information of the best reading [nats].
    """

    kind: ClassVar[str] = "not_worth_cost"
    role: ClassVar[Role] = "verdict"
    gain: float


@dataclass(frozen=True, slots=True)
class AccuracyNeeded(Finding):
    """Whether the pose is as accurate as the user needs.

    Attributes:
        part: name of the part.
        need: largest allowed error of the part's farthest corner [m].
        error: error that this corner exceeds with 5 % [m].
        reached: whether the answer is decided and the error small enough.
    """

    kind: ClassVar[str] = "accuracy_needed"
    part: str
    need: float
    error: float
    reached: bool


@dataclass(frozen=True, slots=True)
class NoPlaceReached(Finding):
    """The probe cannot reach any place of the part.

    Attributes:
        parts: names of the parts; empty for all parts of a session, wherever they may be.
        limit: limit of the probe without which it reaches a place: ``standoff``, ``clearance``, ``workspace``,
            ``obstacles``, ``tool`` or ``directions``; empty if several prevent it.
        value: stand-off or clearance [m]; NaN for another limit.
        possible: smaller stand-off or clearance with which the probe reaches a place [m]; NaN for another limit.
    """

    kind: ClassVar[str] = "no_place_reached"
    role: ClassVar[Role] = "verdict"
    parts: tuple[str, ...] = ()
    limit: str = ""
    value: float = float("nan")
    possible: float = float("nan")


@dataclass(frozen=True, slots=True)
class NoClearPath(Finding):
    """Hand or machine has no clear path to one reading, or to many readings in succession.

    Attributes:
        device: moving device, ``hand`` or ``machine``.
        last: whether the run ends for this reason.
        reason: sentence on the limit that refused the last path; empty if none is known.
    """

    kind: ClassVar[str] = "no_clear_path"
    device: str
    last: bool = False
    reason: str = ""


@dataclass(frozen=True, slots=True)
class NoPriorPose(Finding):
    """No reading has arrived, and no prior pose is given, so that no reading can be chosen."""

    kind: ClassVar[str] = "no_prior_pose"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class EndedByUser(Finding):
    """The user ended the session."""

    kind: ClassVar[str] = "ended_by_user"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class RepeatedNames(Finding):
    """Names of new readings occur among earlier readings.

    Attributes:
        known: names of readings that the session has already; they are not counted again.
        corrected: names of readings that the session has with other errors, radius or normal, which it keeps.
        renamed: new names of readings whose name belongs to another reading.
    """

    kind: ClassVar[str] = "repeated_names"
    known: tuple[str, ...] = ()
    corrected: tuple[str, ...] = ()
    renamed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class NoEcho(Finding):
    """No sensor of the hand had an echo."""

    kind: ClassVar[str] = "no_echo"


@dataclass(frozen=True, slots=True)
class BeamsFree(Finding):
    """The sensors had no echo within their range."""

    kind: ClassVar[str] = "beams_free"


@dataclass(frozen=True, slots=True)
class FurnitureHit(Finding):
    """Some beams hit furniture.

    Attributes:
        count: number of these beams.
    """

    kind: ClassVar[str] = "furniture_met"
    count: int


@dataclass(frozen=True, slots=True)
class NothingToAcquire(Finding):
    """The feature that the hand should acquire has become improbable."""

    kind: ClassVar[str] = "nothing_to_acquire"


@dataclass(frozen=True, slots=True)
class Stated(Finding):
    """A sentence from outside of the findings: of a user's policy, of an error, or of a record.

    Attributes:
        text: the sentence.
    """

    kind: ClassVar[str] = "stated"
    text: str
