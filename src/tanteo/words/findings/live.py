"""Findings of the live page: the belief at one moment, its steps, and the user's run beside the planner's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from tanteo.words.findings.base import Finding


@dataclass(frozen=True, slots=True)
class NothingSensedYet(Finding):
    """A session has no reading yet.

    Attributes:
        parts: number of parts that may be there.
        drawn: name of the part that the page draws.
        probability: its prior probability, as after an image; None if all parts are equally probable.
    """

    kind: ClassVar[str] = "nothing_sensed_yet"
    parts: int
    drawn: str
    probability: float | None = None


@dataclass(frozen=True, slots=True)
class Leader(Finding):
    """The most probable part at one moment of a session.

    Attributes:
        part: name of the part.
        probability: its posterior.
        decided: whether it is more probable than all others together.
        corner_sd: largest corner sd [m]; NaN if it is not known.
    """

    kind: ClassVar[str] = "leader"
    part: str
    probability: float
    decided: bool
    corner_sd: float


@dataclass(frozen=True, slots=True)
class PlacesSensed(Finding):
    """Number of places that are sensed.

    Attributes:
        policy: number of places that the policy chose.
        user: number of places that the user chose.
    """

    kind: ClassVar[str] = "places_sensed"
    policy: int
    user: int


@dataclass(frozen=True, slots=True)
class StepResult(Finding):
    """Belief after one step.

    Attributes:
        number: number of the step, from 1.
        user: whether the user chose the reading.
        target: face and part of the reading; empty if it was not requested.
        part: most probable part after it; empty if no part explains the readings.
        probability: posterior of that part.
        corner_sd: largest corner sd [m].
    """

    kind: ClassVar[str] = "step_result"
    number: int
    user: bool
    target: str
    part: str
    probability: float
    corner_sd: float


@dataclass(frozen=True, slots=True)
class PlannerResult(Finding):
    """Belief of the planner that plays the same scene beside the user.

    Attributes:
        places: number of places that it has sensed.
        probability: posterior of its most probable part.
        corner_sd: largest corner sd [m].
        finished: whether it needs no more places.
    """

    kind: ClassVar[str] = "planner_result"
    places: int
    probability: float = float("nan")
    corner_sd: float = float("nan")
    finished: bool = False


@dataclass(frozen=True, slots=True)
class ClickFailed(Finding):
    """A click of the user gives no reading.

    Attributes:
        cause: nothing is at the click, the probe has no free space, or the hand cannot reach its place.
    """

    kind: ClassVar[str] = "click_failed"
    cause: Literal["nothing", "space", "reach"]


@dataclass(frozen=True, slots=True)
class TruthWithin(Finding):
    """Largest distance between the true surface and the estimate.

    Attributes:
        distance: that distance [m].
    """

    kind: ClassVar[str] = "truth_within"
    distance: float
