"""Findings on the grounds of a verdict: noise, outliers, shared errors, parts that were not searched."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role
from tanteo.words.findings.verdicts import WorstReading


@dataclass(frozen=True, slots=True)
class CutShort(Finding):
    """The search dropped some assignments of readings to faces, so it may have missed the answer."""

    kind: ClassVar[str] = "cut_short"


@dataclass(frozen=True, slots=True)
class SecondOpinion(Finding):
    """A pose of a detector is confirmed, refuted, or neither by the answer.

    Attributes:
        part: name of the part.
        score: score of the detector.
        state: ``holds``, ``refuted`` or ``open``.
        probability: probability of the part within three deviations of the detection.
        shift: distance of the answer from the detection at the part's middle [m]; 0 if it is refuted.
        turn: rotation between both [rad]; 0 if it is refuted.
    """

    kind: ClassVar[str] = "second_opinion"
    part: str
    score: float
    state: str
    probability: float
    shift: float
    turn: float


@dataclass(frozen=True, slots=True)
class CloseTogether(Finding):
    """The readings cover a small patch, which many parts have more than once."""

    kind: ClassVar[str] = "close_together"


@dataclass(frozen=True, slots=True)
class SharedErrorLimits(Finding):
    """An error that all readings share contributes much to the uncertainty of the answer.

    Attributes:
        error: description of the error.
        share: its own part of the largest corner sd [m].
        corner_sd: the largest corner sd [m].
        without: the largest corner sd if the error were known [m].
        source: name of the kind of error, which decides the advice.
    """

    kind: ClassVar[str] = "shared_error"
    error: str
    share: float
    corner_sd: float
    without: float
    source: str


@dataclass(frozen=True, slots=True)
class Outliers(Finding):
    """Some readings are not on the part.

    Attributes:
        readings: their ids.
        distances: signed distance of each from the surface [m]; negative inside the material.
        count: number of all readings.
        expected: whether so many outliers are expected.
    """

    kind: ClassVar[str] = "outliers"
    readings: tuple[str, ...]
    distances: tuple[float, ...]
    count: int
    expected: bool


@dataclass(frozen=True, slots=True)
class FaceDisplaced(Finding):
    """The part may be a near variant with one face displaced.

    Attributes:
        part: name of the part.
        face: name of the face.
        offset: displacement of the face along its outward normal [m].
        count: number of readings that agree.
    """

    kind: ClassVar[str] = "face_displaced"
    part: str
    face: str
    offset: float
    count: int


@dataclass(frozen=True, slots=True)
class OnFurniture(Finding):
    """Some readings are on the furniture.

    Attributes:
        count: number of all readings.
        on: name of each piece of furniture and number of readings on it.
    """

    kind: ClassVar[str] = "on_furniture"
    count: int
    on: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class OutliersOnPlane(Finding):
    """Readings that are not on the part lie on one plane beside it, such as an unstated table or jaw.

    Attributes:
        readings: their ids.
        count: number of all readings.
    """

    kind: ClassVar[str] = "plane_of_outliers"
    readings: tuple[str, ...]
    count: int


@dataclass(frozen=True, slots=True)
class OnOtherSide(Finding):
    """A part on a table lies on another side than the most probable one, or is in none of its stable poses.

    Attributes:
        part: name of the part.
        probability: probability of the stable pose in which it is; 0 if it is in none.
        most: probability of the most probable stable pose.
        tilt: angle to the nearest stable pose [rad].
    """

    kind: ClassVar[str] = "on_other_side"
    part: str
    probability: float
    most: float
    tilt: float


@dataclass(frozen=True, slots=True)
class OneRegion(Finding):
    """All touches are in one region of the part, so that they hardly discriminate parts with a similar region.

    Attributes:
        extent: largest distance between two touches [m].
        size: size of the part, the diagonal of its box [m].
    """

    kind: ClassVar[str] = "one_region"
    extent: float
    size: float


@dataclass(frozen=True, slots=True)
class MissedPoses(Finding):
    """The search found some poses only once, so it may have missed others.

    Attributes:
        probability: posterior of the poses that were found once.
    """

    kind: ClassVar[str] = "missed_poses"
    probability: float


@dataclass(frozen=True, slots=True)
class OpenSurface(Finding):
    """Some readings do not fit the best part, whose CAD file has gaps.

    Attributes:
        part: name of the part.
    """

    kind: ClassVar[str] = "open_surface"
    part: str


@dataclass(frozen=True, slots=True)
class NotSearched(Finding):
    """Parts that were not searched may explain the readings as well.

    Attributes:
        count: number of these parts.
        probability: posterior of these together, at most.
    """

    kind: ClassVar[str] = "not_searched"
    count: int
    probability: float


@dataclass(frozen=True, slots=True)
class Scatter(Finding):
    """The readings scatter more or less than stated.

    Attributes:
        scale: ratio of the observed noise to the stated one.
        low: lower end of its 95 % interval.
        high: upper end of its 95 % interval.
        worst: the reading that agrees least; None if none is far off.
        part: name of the closest part where the object is unknown; otherwise empty.
    """

    kind: ClassVar[str] = "scatter"
    scale: float
    low: float
    high: float
    worst: WorstReading | None = None
    part: str = ""


@dataclass(frozen=True, slots=True)
class CorrelatedReadings(Finding):
    """Neighbouring readings of the file have similar residuals: their errors are not independent.

    Attributes:
        correlation: correlation of the residuals of neighbouring readings.
        count: number of readings.
        independent: number of independent readings that are as exact.
    """

    kind: ClassVar[str] = "correlated_readings"
    correlation: float
    count: int
    independent: int


@dataclass(frozen=True, slots=True)
class AssumedTip(Finding):
    """Poses of the hand are given, and the error of the tip's offset is not stated.

    Attributes:
        sd: assumed standard deviation along each axis of the hand [m].
        estimate: estimated error of the offset in the hand's frame [m]; empty without an answer.
        sds: standard deviations of the estimate [m].
    """

    kind: ClassVar[str] = "assumed_tip"
    sd: float
    estimate: tuple[float, ...] = ()
    sds: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class AssumedAngles(Finding):
    """The rig states no mounting error of range sensors, and errors of their angles are assumed.

    Attributes:
        devices: names of the devices.
        sd: assumed standard deviation of each angle [rad].
    """

    kind: ClassVar[str] = "assumed_angles"
    devices: tuple[str, ...]
    sd: float


@dataclass(frozen=True, slots=True)
class EstimatedNoise(Finding):
    """No standard deviation was stated, and it is estimated from the readings.

    Attributes:
        sd: estimated standard deviation [m]; NaN if the readings do not determine it.
        low: lower end of its 95 % interval [m].
        high: upper end of its 95 % interval [m].
    """

    kind: ClassVar[str] = "estimated_noise"
    sd: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class SharedEstimates(Finding):
    """Estimates of the errors that the user stated as shared by readings.

    Attributes:
        names: description of each error.
        values: estimate of each [SI unit].
        sds: standard deviation of each [SI unit].
        units: SI unit of each: ``m``, ``rad`` or ``1``.
        prior_sds: stated standard deviation of each [SI unit].
        first: index of the first of them among the shared errors of the hypothesis.
    """

    kind: ClassVar[str] = "shared_estimates"
    names: tuple[str, ...]
    values: tuple[float, ...]
    sds: tuple[float, ...]
    units: tuple[str, ...]
    prior_sds: tuple[float, ...]
    first: int = 0


@dataclass(frozen=True, slots=True)
class CheckPrior(Finding):
    """The answer is ``unknown`` although it includes a prior of the pose, which may be wrong."""

    kind: ClassVar[str] = "check_prior"
    role: ClassVar[Role] = "advice"


@dataclass(frozen=True, slots=True)
class ThinnedReadings(Finding):
    """Only some of very many readings were used.

    Attributes:
        used: number of readings used.
        given: number of readings given.
    """

    kind: ClassVar[str] = "many"
    used: int
    given: int


@dataclass(frozen=True, slots=True)
class WholeMismatch(Finding):
    """Mass or size of the whole object contradict the part.

    Attributes:
        part: name of the part.
        volumes: volume by the mass, and volume of the part [m^3]; empty where they agree.
        sides: sides of the box as stated, and those of the part, longest first [m]; empty where they agree.
    """

    kind: ClassVar[str] = "whole"
    part: str
    volumes: tuple[float, ...] = ()
    sides: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class FreeSpaceCrossed(Finding):
    """The part is in the way of free-space rays.

    Attributes:
        part: name of the part.
        readings: ids of these rays, the worst first.
        lengths: distance from the surface to the end of each ray, inside or behind the part [m].
        count: number of all free-space rays.
    """

    kind: ClassVar[str] = "free_space"
    part: str
    readings: tuple[str, ...]
    lengths: tuple[float, ...]
    count: int
