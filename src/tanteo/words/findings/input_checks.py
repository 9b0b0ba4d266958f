"""Findings on the input: oddities, and other meanings that would fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class Repeated(Finding):
    """Readings are equal in every number, and each counts.

    Attributes:
        sets: ids of the readings of each set of equal ones.
    """

    kind: ClassVar[str] = "repeated"
    sets: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class RepeatedPlaces(Finding):
    """Places were touched several times, and each place counts once.

    Attributes:
        sets: ids of the readings of each place.
        spread: standard deviation of the repeats about the mean of their place [m].
        drift: mean change from one repeat to the next [m].
    """

    kind: ClassVar[str] = "repeated_places"
    sets: tuple[tuple[str, ...], ...]
    spread: float
    drift: float


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
    """The readings are farther apart than any part is wide, as if millimetres were read as metres.

    Attributes:
        distance: median distance of the readings from their middle [m].
        widest: size of the largest part [m].
    """

    kind: ClassVar[str] = "units"
    distance: float
    widest: float


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
    subject: ClassVar[str] = "the units"
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
    subject: ClassVar[str] = "the units"
    within: float
    smallest: float
    units: UnitsQuestion | None = None


@dataclass(frozen=True, slots=True)
class SpreadQuestion(Finding):
    """The standard deviation of the readings is far too large or too small for a sensor of such parts.

    Attributes:
        sd: median standard deviation [m].
        widest: size of the largest part [m]; NaN where the deviation is finer than that of any sensor.
    """

    kind: ClassVar[str] = "spread"
    role: ClassVar[Role] = "question"
    subject: ClassVar[str] = "the unit of the standard deviations"
    sd: float
    widest: float


@dataclass(frozen=True, slots=True)
class DirectionsQuestion(Finding):
    """Directions lead out of the material.

    Attributes:
        share: fraction of the readings whose direction leads out of the material.
    """

    kind: ClassVar[str] = "directions"
    role: ClassVar[Role] = "question"
    subject: ClassVar[str] = "the signs of the directions (dx, dy, dz)"
    share: float


@dataclass(frozen=True, slots=True)
class NormalsQuestion(Finding):
    """Sensed normals point into the material.

    Attributes:
        share: fraction of the readings whose normal does.
    """

    kind: ClassVar[str] = "normals"
    role: ClassVar[Role] = "question"
    subject: ClassVar[str] = "the signs of the normals (nx, ny, nz)"
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
    subject: ClassVar[str] = "the order and the signs of the columns x, y, z"
    part: str
    probability: float


@dataclass(frozen=True, slots=True)
class Convention(Finding):
    """The readings fit if their numbers are read by another convention.

    Attributes:
        part: name of the part that fits then.
        fitting: number of readings that fit.
        count: number of readings that were tried.
        mistake: name of the other convention, see :mod:`tanteo.words.sentences.input_checks`.
        given: number of all readings, where only some were tried; otherwise 0.
    """

    role: ClassVar[Role] = "question"
    part: str
    fitting: int
    count: int
    mistake: str
    given: int = 0


@dataclass(frozen=True, slots=True)
class HandConvention(Convention):
    """The poses of the hand, or of the sensors on it, fit by another convention."""

    kind: ClassVar[str] = "hand"
    subject: ClassVar[str] = "the poses of the hand and of the sensors on it"


@dataclass(frozen=True, slots=True)
class ResponseConvention(Convention):
    """The ranges fit if the devices report something else of their cones."""

    kind: ClassVar[str] = "response"
    subject: ClassVar[str] = "the response of the sensors in the rig"


@dataclass(frozen=True, slots=True)
class DirectionsConvention(Convention):
    """The directions fit by another convention."""

    kind: ClassVar[str] = "directions"
    subject: ClassVar[str] = "the signs of the directions (dx, dy, dz)"


@dataclass(frozen=True, slots=True)
class NormalsConvention(Convention):
    """The normals fit by another convention."""

    kind: ClassVar[str] = "normals"
    subject: ClassVar[str] = "the signs of the normals (nx, ny, nz)"


@dataclass(frozen=True, slots=True)
class UnitsConvention(Convention):
    """The lengths fit in another unit."""

    kind: ClassVar[str] = "units"
    subject: ClassVar[str] = "the units"


@dataclass(frozen=True, slots=True)
class MirrorConvention(Convention):
    """The readings fit in a left-handed frame."""

    kind: ClassVar[str] = "mirror"
    subject: ClassVar[str] = "the order and the signs of the columns x, y, z"


@dataclass(frozen=True, slots=True)
class OffsetQuestion(Finding):
    """The readings fit if the surface is nearer or farther by the same length everywhere.

    Attributes:
        part: name of the part that fits then.
        fitting: number of readings that fit.
        count: number of readings that were tried.
        offset: distance by which the surface is farther than it was read [m].
        touched: whether a tip touched; otherwise a range sensor measured.
        given: number of all readings, where only some were tried; otherwise 0.
        faces: names of the faces, if each has an offset of its own: stock; otherwise empty.
        groups: names of the groups of readings, if each has an offset of its own; otherwise empty.
        offsets: offset of each face or group [m].
        sds: standard deviation of each of these [m].
    """

    kind: ClassVar[str] = "offset"
    role: ClassVar[Role] = "question"
    subject: ClassVar[str] = "the tip radius and the zero of the sensor"
    part: str
    fitting: int
    count: int
    offset: float
    touched: bool
    given: int = 0
    faces: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    offsets: tuple[float, ...] = ()
    sds: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class ScaleQuestion(Finding):
    """The readings fit if the object is larger or smaller than the part by a factor.

    Attributes:
        part: name of the part that fits then.
        fitting: number of readings that fit.
        count: number of readings that were tried.
        scale: size of the object over that of the part.
        sd: standard deviation of the scale.
        given: number of all readings, where only some were tried; otherwise 0.
    """

    kind: ClassVar[str] = "scale"
    role: ClassVar[Role] = "question"
    subject: ClassVar[str] = "the scale of the readings"
    part: str
    fitting: int
    count: int
    scale: float
    sd: float
    given: int = 0
