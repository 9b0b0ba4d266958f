"""Verdicts on readings that any part fits: the reason, from which the advice follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class AllOnFurniture(Finding):
    """All readings are on the furniture.

    Attributes:
        count: number of readings.
        name: name of the piece of furniture.
    """

    kind: ClassVar[str] = "all_on_furniture"
    role: ClassVar[Role] = "verdict"
    count: int
    name: str


@dataclass(frozen=True, slots=True)
class NothingSensed(Finding):
    """No reading hit a surface."""

    kind: ClassVar[str] = "nothing_sensed"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class OneCentre(Finding):
    """The readings determine the centre of one round feature and nothing else.

    Attributes:
        slides: whether the part may also slide along the axis through the centre.
    """

    kind: ClassVar[str] = "one_centre"
    role: ClassVar[Role] = "verdict"
    slides: bool


@dataclass(frozen=True, slots=True)
class TwoCentres(Finding):
    """The readings determine the centres of two round features and nothing else.

    Attributes:
        slides: whether the part may also slide along the axes through the centres.
    """

    kind: ClassVar[str] = "two_centres"
    role: ClassVar[Role] = "verdict"
    slides: bool


@dataclass(frozen=True, slots=True)
class TooFewReadings(Finding):
    """So few readings fit any part.

    Attributes:
        count: number of readings.
    """

    kind: ClassVar[str] = "too_few_readings"
    role: ClassVar[Role] = "verdict"
    count: int


@dataclass(frozen=True, slots=True)
class OnOneLine(Finding):
    """The readings lie on one line within their noise."""

    kind: ClassVar[str] = "on_one_line"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class NoiseTooLarge(Finding):
    """The noise of the readings is larger than the distances between them.

    Attributes:
        sd: median standard deviation of the readings [m].
        tolerance: whether the standard deviation contains a tolerance of the part.
    """

    kind: ClassVar[str] = "noise_too_large"
    role: ClassVar[Role] = "verdict"
    sd: float
    tolerance: bool


@dataclass(frozen=True, slots=True)
class NoFeatures(Finding):
    """No feature can be fitted to the labelled readings."""

    kind: ClassVar[str] = "no_features"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class LabelsRejected(Finding):
    """Readings disagree with their labels and are excluded.

    Attributes:
        readings: their ids.
    """

    kind: ClassVar[str] = "labels_rejected"
    readings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class LabelNotes(Finding):
    """Fits of labelled readings that failed or are poor.

    Attributes:
        notes: one clause for each label that is shown.
        more: number of further labels.
    """

    kind: ClassVar[str] = "label_notes"
    notes: tuple[str, ...]
    more: int = 0
