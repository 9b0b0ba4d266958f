"""Reasons of a policy for the next reading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class ViewFirst(Finding):
    """A view of the camera on the hand is expected to give more information per second than the best reading.

    Attributes:
        gain: expected information of the view about part and pose [nats].
        seconds: duration of the view with travel [s].
        other_gain: expected information of the best reading [nats].
        other_seconds: duration of that reading with travel [s].
        excluded: reasons for which other views are excluded, with the number of these views.
    """

    kind: ClassVar[str] = "view_first"
    gain: float
    seconds: float
    other_gain: float
    other_seconds: float
    excluded: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, slots=True)
class MostInformation(Finding):
    """The reading, or the feature to which it belongs, has the greatest expected information.

    Attributes:
        gain: expected information about part and pose [nats].
        feature: name of the feature; empty for a single reading.
        others: number of further readings of the feature.
    """

    kind: ClassVar[str] = "most_information"
    gain: float
    feature: str = ""
    others: int = 0


@dataclass(frozen=True, slots=True)
class RepeatMisfit(Finding):
    """An earlier reading of this beam does not fit the most probable hypothesis."""

    kind: ClassVar[str] = "repeat_misfit"


@dataclass(frozen=True, slots=True)
class DrawnAtRandom(Finding):
    """The reading was drawn at random."""

    kind: ClassVar[str] = "drawn_at_random"


@dataclass(frozen=True, slots=True)
class NearestPlace(Finding):
    """The reading is the nearest one at a new place."""

    kind: ClassVar[str] = "nearest_place"


@dataclass(frozen=True, slots=True)
class LargestFaceLeast(Finding):
    """The reading is on the face with the largest area for each of its readings.

    Attributes:
        face: name of the face.
        confirms: whether it is made to exclude a near variant of the part.
    """

    kind: ClassVar[str] = "largest_face_least"
    face: str
    confirms: bool = False


@dataclass(frozen=True, slots=True)
class Rule321(Finding):
    """The reading follows the 3-2-1 rule.

    Attributes:
        number: its number in the rule, 1 to 6.
    """

    kind: ClassVar[str] = "rule_3_2_1"
    number: int


@dataclass(frozen=True, slots=True)
class ChosenByUser(Finding):
    """The user chose the reading."""

    kind: ClassVar[str] = "chosen_by_user"


@dataclass(frozen=True, slots=True)
class ExpectedReading:
    """Reading that one hypothesis expects.

    Attributes:
        part: name of the hypothesis' part.
        probability: probability of the hypothesis.
        face: name of the face that is hit; empty for a miss.
        distance: distance from the start to the contact [m]; infinite for a miss.
        sd: standard deviation of the distance from pose and sensor [m]; NaN for a miss.
    """

    part: str
    probability: float
    face: str
    distance: float
    sd: float


@dataclass(frozen=True, slots=True)
class NextTouch(Finding):
    """The reading with the most information about an answer that is not decided.

    Attributes:
        part: name of the part at which the reading aims.
        face: name of the aimed face.
        start: start of the motion or beam, world frame [m].
        point: point where the approach is expected to reach the surface, world frame [m].
        direction: unit direction of the approach, world frame.
        gain: expected information [nats].
        expected: reading that each hypothesis expects, in their order.
        clear: whether the approach is clear of the part wherever it may be.
    """

    kind: ClassVar[str] = "next_touch"
    role: ClassVar[Role] = "advice"
    names_step: ClassVar[bool] = True
    part: str
    face: str
    start: tuple[float, ...]
    point: tuple[float, ...]
    direction: tuple[float, ...]
    gain: float
    expected: tuple[ExpectedReading, ...]
    clear: bool = True


REASONS: dict[str, type[Finding]] = {
    cls.kind: cls
    for cls in (MostInformation, RepeatMisfit, DrawnAtRandom, NearestPlace, LargestFaceLeast, Rule321, ChosenByUser)
}
"""Types of reasons by kind, for records."""
