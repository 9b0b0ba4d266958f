"""Findings of a plan that is made beforehand, and of a reading that discriminates two parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class PlanGoal:
    """Goal of a plan: part, feature and tolerance.

    Attributes:
        part: name of the part.
        feature: feature that has to keep the tolerance; empty for all corners of the part's box.
        tolerance: tolerance [m].
    """

    part: str
    feature: str
    tolerance: float


@dataclass(frozen=True, slots=True)
class NoReadingNeeded(Finding):
    """The prior pose keeps the tolerance without any reading.

    Attributes:
        goal: goal of the plan.
        within: probability that the tolerance is kept.
    """

    kind: ClassVar[str] = "no_reading_needed"
    role: ClassVar[Role] = "verdict"
    goal: PlanGoal
    within: float


@dataclass(frozen=True, slots=True)
class PlanResult(Finding):
    """Accuracy after the readings of a plan.

    Attributes:
        goal: goal of the plan.
        reached: whether the tolerance is kept with the demanded confidence.
        count: number of readings.
        sd: largest corner sd, or sd of the feature, after the readings [m].
        within: probability that the tolerance is kept, over all placements.
        if_all_meet: the same probability if every reading hits its face.
        all_meet: fraction of the placements at which every reading hits its face.
        better_start: whether a better prior pose would help; otherwise a better sensor or another approach.
        within_assumed: probability that the tolerance is kept if the readings share the errors that ``locate`` assumes
            if none are stated; NaN if it was not computed.
        in_session: number of readings after which the tolerance is kept with the demanded confidence if all of them
            hit their faces, as a session aims them; 0 if it is not.
    """

    kind: ClassVar[str] = "plan_result"
    role: ClassVar[Role] = "verdict"
    goal: PlanGoal
    reached: bool
    count: int
    sd: float
    within: float
    if_all_meet: float
    all_meet: float
    better_start: bool = False
    within_assumed: float = float("nan")
    in_session: int = 0


@dataclass(frozen=True, slots=True)
class SystematicErrorLimits(Finding):
    """The errors that no number of readings averages out are too large.

    Attributes:
        goal: goal of the plan.
        sd: largest corner sd, or sd of the feature, in the limit of infinitely many readings [m].
        least: smallest tolerance that infinitely many readings keep with the demanded confidence [m].
        source: source of the largest of these errors: ``robot`` (with the tip), ``bias``, ``form``, or the name of a
            stated error.
    """

    kind: ClassVar[str] = "systematic_error_limits"
    role: ClassVar[Role] = "verdict"
    goal: PlanGoal
    sd: float
    least: float
    source: str


@dataclass(frozen=True, slots=True)
class ReachLimits(Finding):
    """The places and directions that the probe reaches do not determine the pose, with any number of readings.

    Attributes:
        goal: goal of the plan.
        sd: largest corner sd, or sd of the feature, in the limit of infinitely many readings [m].
        least: smallest tolerance that infinitely many readings keep with the demanded confidence [m].
    """

    kind: ClassVar[str] = "reach_limits"
    role: ClassVar[Role] = "verdict"
    goal: PlanGoal
    sd: float
    least: float


@dataclass(frozen=True, slots=True)
class PriorTooWide(Finding):
    """The prior pose is so uncertain that readings which are planned beforehand miss their faces.

    Attributes:
        goal: goal of the plan.
        sd: largest corner sd, or sd of the feature, before the readings [m].
        within: probability that the plan keeps the tolerance.
        in_session: as of :class:`PlanResult`.
    """

    kind: ClassVar[str] = "prior_too_wide"
    role: ClassVar[Role] = "verdict"
    goal: PlanGoal
    sd: float
    within: float
    in_session: int = 0


@dataclass(frozen=True, slots=True)
class FaceOftenMissed(Finding):
    """One reading of a plan would miss its face at most placements.

    Attributes:
        reading: number of the reading, from 1.
        meets: fraction of the placements at which it hits its face.
        within: probability that the plan keeps the tolerance.
    """

    kind: ClassVar[str] = "face_often_missed"
    role: ClassVar[Role] = "verdict"
    reading: int
    meets: float
    within: float


@dataclass(frozen=True, slots=True)
class StartTooClose(Finding):
    """Some starts of readings, or the paths to them, may be too close to the part.

    Attributes:
        fraction: fraction of the placements with such a start or path.
        clearance: clearance that the probe needs [m].
    """

    kind: ClassVar[str] = "start_too_close"
    fraction: float
    clearance: float


@dataclass(frozen=True, slots=True)
class ReadingDiscriminates(Finding):
    """The best reading to discriminate two parts.

    Attributes:
        parts: names of the parts.
        ranges: expected range for each part [m]; infinite without an echo.
        echoes: fraction of the placements of each part at which a wide beam has an echo.
        information: expected information about the part [nats]; ln 2 decides it.
    """

    kind: ClassVar[str] = "reading_discriminates"
    role: ClassVar[Role] = "verdict"
    parts: tuple[str, str]
    ranges: tuple[float, float]
    echoes: tuple[float, float]
    information: float

    LEAST: ClassVar[float] = 0.3
    """Least information of a reading that is worth making [nats]."""
