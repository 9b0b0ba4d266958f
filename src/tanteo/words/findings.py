"""What an answer found, as typed values in SI units; :mod:`tanteo.words.sentences` puts them into words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

Role = Literal["verdict", "cause", "advice", "question"]
"""What a finding is for: the verdict itself, what it rests on or what is odd, what to do, or what the user may have
meant otherwise. Questions stand beside the message, not in it."""

Share = tuple[str, float]
"""Name of a part and its probability."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Base of all findings.

    Attributes:
        kind: name of the kind, as documents have it.
        role: what the finding is for.
    """

    kind: ClassVar[str]
    role: ClassVar[Role] = "cause"

    @property
    def message(self) -> str:
        """The finding in words."""
        from tanteo.words.sentences import sentence

        return sentence(self)


# ---- verdicts


@dataclass(frozen=True, slots=True)
class Located(Finding):
    """One part at one pose.

    Attributes:
        part: name of the part.
        probability: its posterior; NaN where it is as sure as usual.
        corner_sd: largest corner sd [m].
        others: what else it may be, most probable first.
    """

    kind: ClassVar[str] = "located"
    role: ClassVar[Role] = "verdict"
    part: str
    probability: float
    corner_sd: float
    others: tuple[Share, ...] = ()


@dataclass(frozen=True, slots=True)
class PoseWithin(Finding):
    """A part in one of several poses that differ by less than the tolerance of the goal.

    Attributes:
        part: name of the part.
        probability: its posterior; NaN where it is as sure as usual.
        tolerance: of the goal [m].
        feature: feature of the part that the tolerance is about; empty for the whole part.
        others: what else it may be.
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
        probability: its posterior over all poses; NaN where it is as sure as usual.
        others: what else it may be.
    """

    kind: ClassVar[str] = "several_poses"
    role: ClassVar[Role] = "verdict"
    part: str
    probability: float = float("nan")
    others: tuple[Share, ...] = ()


@dataclass(frozen=True, slots=True)
class SeveralParts(Finding):
    """Several parts remain.

    Attributes:
        parts: their names, most probable first.
        more: number of further parts.
        equal: a part that fits exactly like the first one; empty if none does.
    """

    kind: ClassVar[str] = "several_parts"
    role: ClassVar[Role] = "verdict"
    parts: tuple[str, ...]
    more: int = 0
    equal: str = ""


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
    """

    kind: ClassVar[str] = "may_be_unknown"
    role: ClassVar[Role] = "verdict"
    part: str
    unknown: float


@dataclass(frozen=True, slots=True)
class FreeMotions(Finding):
    """A part fits, but some of its motions are not observed.

    Attributes:
        part: name of the part.
        motions: the unobserved directions, in words.
        face: what to sense to observe the first one; empty if nothing is known.
    """

    kind: ClassVar[str] = "free_motions"
    role: ClassVar[Role] = "verdict"
    part: str
    motions: tuple[str, ...]
    face: str = ""


@dataclass(frozen=True, slots=True)
class NoPart(Finding):
    """No part explains the readings at all."""

    kind: ClassVar[str] = "no_part"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class UnknownObject(Finding):
    """The unknown object is more probable than any part.

    Attributes:
        unknown: its probability.
        part: name of the closest part.
        probability: posterior of that.
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
        p_value: of the joint test.
        worst: the reading that contradicts it most; None if no reading is far off.
    """

    kind: ClassVar[str] = "contradicted"
    role: ClassVar[Role] = "verdict"
    part: str
    p_value: float
    worst: WorstReading | None = None


@dataclass(frozen=True, slots=True)
class PriorContradicted(Finding):
    """The closest part is not where the prior of the pose has it.

    Attributes:
        part: name of the part.
        p_value: of the prior.
    """

    kind: ClassVar[str] = "prior_contradicted"
    role: ClassVar[Role] = "verdict"
    part: str
    p_value: float


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


# ---- what a verdict rests on


@dataclass(frozen=True, slots=True)
class CutShort(Finding):
    """The search dropped some assignments."""

    kind: ClassVar[str] = "cut_short"


@dataclass(frozen=True, slots=True)
class CloseTogether(Finding):
    """The readings cover a small patch, which many parts have more than once."""

    kind: ClassVar[str] = "close_together"


@dataclass(frozen=True, slots=True)
class SharedErrorLimits(Finding):
    """An error that all readings share contributes much to the uncertainty of the answer.

    Attributes:
        error: what the error is.
        share: its own part of the largest corner sd [m].
        corner_sd: the largest corner sd [m].
        without: the largest corner sd if the error were known [m].
        source: name of the kind of error, which decides what lessens it.
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
        distances: how far each is from the surface [m].
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
        on: name of each object and number of readings on it.
    """

    kind: ClassVar[str] = "on_furniture"
    count: int
    on: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class MissedPoses(Finding):
    """The search met some poses only once, so it may have missed others.

    Attributes:
        probability: of the poses that were met once.
    """

    kind: ClassVar[str] = "missed_poses"
    probability: float


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
        scale: noise over stated noise.
        low: lower end of its 95 % interval.
        high: upper end.
        worst: the reading that agrees least; None if none is far off.
    """

    kind: ClassVar[str] = "scatter"
    scale: float
    low: float
    high: float
    worst: WorstReading | None = None


@dataclass(frozen=True, slots=True)
class EstimatedNoise(Finding):
    """Nobody stated a standard deviation, and the readings decide it.

    Attributes:
        sd: estimated standard deviation [m].
        low: lower end of its 95 % interval [m].
        high: upper end [m].
    """

    kind: ClassVar[str] = "estimated_noise"
    sd: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class NoNoiseStated(Finding):
    """Nobody stated a standard deviation, and the readings do not decide it."""

    kind: ClassVar[str] = "no_noise_stated"
    role: ClassVar[Role] = "advice"


@dataclass(frozen=True, slots=True)
class CheckPrior(Finding):
    """The answer is unknown, and a prior of the pose counted."""

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
        lengths: how far each ray ends behind the surface [m].
        count: number of all free-space rays.
    """

    kind: ClassVar[str] = "free_space"
    part: str
    readings: tuple[str, ...]
    lengths: tuple[float, ...]
    count: int


@dataclass(frozen=True, slots=True)
class Repeated(Finding):
    """Readings are equal in every number, and each counts.

    Attributes:
        sets: ids of the readings of each set of equal ones.
    """

    kind: ClassVar[str] = "repeated"
    sets: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Stuck(Finding):
    """A sensor gave the same range again and again, from different places.

    Attributes:
        sensor: its name; empty if there is one sensor without a name.
        first: id of the first of these readings.
        last: id of the last one.
        count: their number.
        range: the range that they all have [m].
    """

    kind: ClassVar[str] = "stuck"
    sensor: str
    first: str
    last: str
    count: int
    range: float


@dataclass(frozen=True, slots=True)
class TooFarApart(Finding):
    """The readings lie farther apart than any part is wide, as millimetres would that are taken for metres.

    Attributes:
        distance: median distance of the readings from their middle [m].
        widest: size of the largest part [m].
    """

    kind: ClassVar[str] = "units"
    distance: float
    widest: float


# ---- questions: what the user may have meant otherwise


@dataclass(frozen=True, slots=True)
class UnitsQuestion(Finding):
    """Other units would make readings and parts fit.

    Attributes:
        widest: size of the largest part [m].
        parts: number of parts.
        span: distance that the readings span [m].
        columns: units of the columns that would fit.
        files: units of the part files that would fit.
    """

    kind: ClassVar[str] = "units"
    role: ClassVar[Role] = "question"
    widest: float
    parts: int
    span: float
    columns: tuple[str, ...] = ()
    files: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class TooNarrow(Finding):
    """All readings lie within a tiny part of the smallest part.

    Attributes:
        within: largest distance of a reading from the middle [m].
        smallest: size of the smallest part [m].
        units: the units that would fit; None if none would.
    """

    kind: ClassVar[str] = "units"
    role: ClassVar[Role] = "question"
    within: float
    smallest: float
    units: UnitsQuestion | None = None


@dataclass(frozen=True, slots=True)
class SpreadQuestion(Finding):
    """The standard deviation of the readings is one that no sensor of such parts has.

    Attributes:
        sd: median standard deviation [m].
        widest: size of the largest part [m]; NaN where the deviation is finer than that of any sensor.
    """

    kind: ClassVar[str] = "spread"
    role: ClassVar[Role] = "question"
    sd: float
    widest: float


@dataclass(frozen=True, slots=True)
class DirectionsQuestion(Finding):
    """Directions lead out of the material.

    Attributes:
        share: share of the readings whose direction does.
    """

    kind: ClassVar[str] = "directions"
    role: ClassVar[Role] = "question"
    share: float


@dataclass(frozen=True, slots=True)
class NormalsQuestion(Finding):
    """Sensed normals point into the material.

    Attributes:
        share: share of the readings whose normal does.
    """

    kind: ClassVar[str] = "normals"
    role: ClassVar[Role] = "question"
    share: float


@dataclass(frozen=True, slots=True)
class MirrorQuestion(Finding):
    """The mirror image of a part fits all readings.

    Attributes:
        part: name of the part.
        probability: posterior of its mirror image.
    """

    kind: ClassVar[str] = "mirror"
    role: ClassVar[Role] = "question"
    part: str
    probability: float


@dataclass(frozen=True, slots=True)
class Convention(Finding):
    """The readings fit if their numbers are read by another convention.

    Attributes:
        part: name of the part that fits then.
        fitting: number of readings that fit.
        count: number of readings that were tried.
        meant: the convention, in words.
        advice: what to do about it.
        given: number of all readings, where only some were tried; otherwise 0.
    """

    role: ClassVar[Role] = "question"
    part: str
    fitting: int
    count: int
    meant: str
    advice: str
    given: int = 0


@dataclass(frozen=True, slots=True)
class HandConvention(Convention):
    """The poses of the hand may be meant otherwise."""

    kind: ClassVar[str] = "hand"


@dataclass(frozen=True, slots=True)
class DirectionsConvention(Convention):
    """The directions may be meant otherwise."""

    kind: ClassVar[str] = "directions"


@dataclass(frozen=True, slots=True)
class NormalsConvention(Convention):
    """The normals may be meant otherwise."""

    kind: ClassVar[str] = "normals"


@dataclass(frozen=True, slots=True)
class UnitsConvention(Convention):
    """The lengths may be in another unit."""

    kind: ClassVar[str] = "units"


@dataclass(frozen=True, slots=True)
class MirrorConvention(Convention):
    """The readings may be in a left-handed frame."""

    kind: ClassVar[str] = "mirror"


@dataclass(frozen=True, slots=True)
class OffsetQuestion(Finding):
    """The readings fit if the surface is nearer or farther by the same length everywhere.

    Attributes:
        part: name of the part that fits then.
        fitting: number of readings that fit.
        count: number of readings that were tried.
        offset: how much farther the surface is than it was read [m].
        touched: whether a tip touched; otherwise a range sensor measured.
        given: number of all readings, where only some were tried; otherwise 0.
    """

    kind: ClassVar[str] = "offset"
    role: ClassVar[Role] = "question"
    part: str
    fitting: int
    count: int
    offset: float
    touched: bool
    given: int = 0


# ---- sessions


@dataclass(frozen=True, slots=True)
class NothingMet(Finding):
    """No reading of a session has met a part yet."""

    kind: ClassVar[str] = "nothing_met"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class EmptySpace(Finding):
    """Beams met nothing at every place where the part may be."""

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
