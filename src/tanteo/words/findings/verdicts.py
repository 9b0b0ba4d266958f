"""Verdicts on readings: part and pose, or the reason why they are not known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.defaults import SIGNIFICANCE
from tanteo.words.findings.base import Finding, Role, Share


@dataclass(frozen=True, slots=True)
class Located(Finding):
    """One part at one pose.

    Attributes:
        part: name of the part.
        probability: its posterior; NaN if it is too high to be reported.
        corner_sd: largest corner sd [m].
        others: other parts that are possible, with their probabilities, most probable first.
    """

    kind: ClassVar[str] = "located"
    role: ClassVar[Role] = "verdict"
    part: str
    probability: float
    corner_sd: float
    others: tuple[Share, ...] = ()


@dataclass(frozen=True, slots=True)
class SeveralEqual(Finding):
    """Several equal parts, each at its pose with its own readings.

    Attributes:
        part: name of the part.
        readings: ids of the readings of each part.
        positions: position of each part in the world [m].
        corner_sds: largest corner sd of each part [m].
        statuses: status of each part.
        left: ids of the readings that are on none of them.
    """

    kind: ClassVar[str] = "several_equal"
    role: ClassVar[Role] = "verdict"
    part: str
    readings: tuple[tuple[str, ...], ...]
    positions: tuple[tuple[float, ...], ...]
    corner_sds: tuple[float, ...]
    statuses: tuple[str, ...]
    left: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PoseWithin(Finding):
    """A part in one of several poses that differ by less than the tolerance of the goal.

    Attributes:
        part: name of the part.
        probability: its posterior; NaN if it is too high to be reported.
        tolerance: tolerance of the goal [m].
        feature: feature of the part that the tolerance is about; empty for the whole part.
        others: other parts that are possible, with their probabilities, most probable first.
    """

    kind: ClassVar[str] = "pose_within"
    role: ClassVar[Role] = "verdict"
    part: str
    probability: float
    tolerance: float
    feature: str = ""
    others: tuple[Share, ...] = ()


@dataclass(frozen=True, slots=True)
class SeveralPoses(Finding):
    """One part in one of several poses.

    Attributes:
        part: name of the part.
        probability: its posterior over all poses; NaN if it is too high to be reported.
        others: other parts that are possible, with their probabilities, most probable first.
        poses: number of poses that are possible; 0 if it is not known.
    """

    kind: ClassVar[str] = "several_poses"
    role: ClassVar[Role] = "verdict"
    part: str
    probability: float = float("nan")
    others: tuple[Share, ...] = ()
    poses: int = 0


@dataclass(frozen=True, slots=True)
class SeveralParts(Finding):
    """Several parts remain.

    Attributes:
        parts: their names, most probable first.
        more: number of further parts.
        equal: a part that fits exactly like the first one; empty if none does.
        mirror: a part among them that is the mirror image of the first one; empty if none is.
    """

    kind: ClassVar[str] = "several_parts"
    role: ClassVar[Role] = "verdict"
    parts: tuple[str, ...]
    more: int = 0
    equal: str = ""
    mirror: str = ""


@dataclass(frozen=True, slots=True)
class GivenTwice(Finding):
    """One part stands more than once among the candidates.

    Attributes:
        part: its name.
    """

    kind: ClassVar[str] = "given_twice"
    role: ClassVar[Role] = "verdict"
    part: str


@dataclass(frozen=True, slots=True)
class MayBeUnknown(Finding):
    """A part fits, but an unknown one may fit, too.

    Attributes:
        part: name of the part.
        unknown: probability of the unknown object.
        outliers: ids of the readings that are not on the part.
    """

    kind: ClassVar[str] = "may_be_unknown"
    role: ClassVar[Role] = "verdict"
    part: str
    unknown: float
    outliers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FreeMotions(Finding):
    """A part fits, but some of its motions are not observed.

    Attributes:
        part: name of the part.
        motions: the unobserved directions as text.
        face: face to sense to observe the first one; empty if none is known.
    """

    kind: ClassVar[str] = "free_motions"
    role: ClassVar[Role] = "verdict"
    part: str
    motions: tuple[str, ...]
    face: str = ""


@dataclass(frozen=True, slots=True)
class OutlierOrVariant(Finding):
    """A part fits, but readings contradict it: they are outliers, or the object is a variant of the part.

    Attributes:
        part: name of the part.
        readings: their ids, the worst first.
        distances: signed distance of each from the surface [m]; negative inside the material.
        places: place of each in the world [m].
        faces: name of the face that the approach to each meets, or that is nearest to it.
    """

    kind: ClassVar[str] = "outlier_or_variant"
    role: ClassVar[Role] = "verdict"
    part: str
    readings: tuple[str, ...]
    distances: tuple[float, ...]
    places: tuple[tuple[float, float, float], ...]
    faces: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class TooCoarse(Finding):
    """A part fits in one pose, but the pose is less certain than the smallest feature of the part is large.

    Attributes:
        part: name of the part.
        corner: 95 % bound of the error at the worst corner of its box [m].
        limit: size of the feature [m].
        what: feature with article.
    """

    kind: ClassVar[str] = "too_coarse"
    role: ClassVar[Role] = "verdict"
    part: str
    corner: float
    limit: float
    what: str


@dataclass(frozen=True, slots=True)
class NoPart(Finding):
    """No part explains the readings at all.

    Attributes:
        part: name of the only part; empty if there are several.
        missing: kinds of centres among the readings that none of the parts has.
        present: kinds of centres that a part has.
        freeform: whether a part has free-form faces, among which may be round ones that a mesh does not show as such.
    """

    kind: ClassVar[str] = "no_part"
    role: ClassVar[Role] = "verdict"
    part: str = ""
    missing: tuple[str, ...] = ()
    present: tuple[str, ...] = ()
    freeform: bool = False


@dataclass(frozen=True, slots=True)
class UnknownObject(Finding):
    """The unknown object is more probable than any part.

    Attributes:
        unknown: its probability.
        part: name of the closest part.
        probability: posterior of that part.
    """

    kind: ClassVar[str] = "unknown_object"
    role: ClassVar[Role] = "verdict"
    unknown: float
    part: str
    probability: float


@dataclass(frozen=True, slots=True)
class MostlyOnPart(Finding):
    """The unknown object is more probable than a part that most readings are on.

    Attributes:
        part: name of that part.
        unknown: probability of the unknown object.
        outliers: ids of the readings that are off it.
        count: number of readings.
    """

    kind: ClassVar[str] = "mostly_on_part"
    role: ClassVar[Role] = "verdict"
    part: str
    unknown: float
    outliers: tuple[str, ...]
    count: int


@dataclass(frozen=True, slots=True)
class WorstReading(Finding):
    """The reading that contradicts a hypothesis most.

    Attributes:
        reading: its id.
        sds: its distance, or the tilt of its normal, in standard deviations.
        normal: whether it is the normal that contradicts.
    """

    kind: ClassVar[str] = "worst_reading"
    reading: str
    sds: float
    normal: bool = False


@dataclass(frozen=True, slots=True)
class Contradicted(Finding):
    """The joint test rejects the closest part.

    Attributes:
        part: name of the part.
        p_value: p-value of the joint test.
        worst: the reading that contradicts it most; None if no reading is far off.
        significance: significance level of the test.
    """

    kind: ClassVar[str] = "contradicted"
    role: ClassVar[Role] = "verdict"
    part: str
    p_value: float
    worst: WorstReading | None = None
    significance: float = SIGNIFICANCE


@dataclass(frozen=True, slots=True)
class PriorContradicted(Finding):
    """The closest part is not where the prior of the pose has it.

    Attributes:
        part: name of the part.
        p_value: p-value of the distance from the prior.
        significance: significance level of the test.
    """

    kind: ClassVar[str] = "prior_contradicted"
    role: ClassVar[Role] = "verdict"
    part: str
    p_value: float
    significance: float = SIGNIFICANCE


@dataclass(frozen=True, slots=True)
class LabelsContradicted(Finding):
    """More labelled readings are off the best part than labels are wrong.

    Attributes:
        part: name of the part.
        outliers: number of labelled readings that are off it.
        count: number of labelled readings.
    """

    kind: ClassVar[str] = "labels_contradicted"
    role: ClassVar[Role] = "verdict"
    part: str
    outliers: int
    count: int


@dataclass(frozen=True, slots=True)
class AmongUnsearched(Finding):
    """So little was sensed that very many parts may explain it.

    Attributes:
        part: the best part that was searched; empty if none was found.
        count: number of parts that were not searched.
        probability: posterior of these together, at most.
    """

    kind: ClassVar[str] = "among_unsearched"
    role: ClassVar[Role] = "verdict"
    part: str
    count: int
    probability: float
