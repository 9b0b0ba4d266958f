"""Findings of a calibration of range sensors by planes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.words.findings.base import Finding, Role


@dataclass(frozen=True, slots=True)
class Undetermined(Finding):
    """A combination of the parameters of a beam that a log does not determine.

    Attributes:
        sensor: name of the sensor.
        parameters: names of the parameters, the largest contribution first: ``x`` and ``y`` (origin across the beam),
            ``offset`` (along it), ``rx`` and ``ry`` (direction), ``scale``; of a multi-zone device also ``z`` and
            ``rz``; of a plane ``tilt``.
    """

    kind: ClassVar[str] = "undetermined"
    sensor: str
    parameters: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Calibrated(Finding):
    """A calibration succeeded.

    Attributes:
        sensors: names of the sensors.
        undetermined: combinations of parameters that the log hardly improves; they keep their prior uncertainty.
        by_distances: whether the log has known distances, not poses of the hand.
    """

    kind: ClassVar[str] = "calibrated"
    role: ClassVar[Role] = "verdict"
    sensors: tuple[str, ...]
    undetermined: tuple[Undetermined, ...] = ()
    by_distances: bool = False


@dataclass(frozen=True, slots=True)
class BeamsUndetermined(Finding):
    """Neither the log nor a rig determines where a beam is.

    Attributes:
        undetermined: combinations of parameters that the log does not determine.
        by_distances: whether the log has known distances, not poses of the hand.
    """

    kind: ClassVar[str] = "beams_undetermined"
    role: ClassVar[Role] = "verdict"
    undetermined: tuple[Undetermined, ...]
    by_distances: bool = False


@dataclass(frozen=True, slots=True)
class NotPlanes(Finding):
    """No beams and planes explain the readings better than chance."""

    kind: ClassVar[str] = "not_planes"
    role: ClassVar[Role] = "verdict"


@dataclass(frozen=True, slots=True)
class ManyOutliers(Finding):
    """So many places contradict the others that no result is reliable.

    Attributes:
        outliers: number of these places.
        count: number of all places.
    """

    kind: ClassVar[str] = "many_outliers"
    role: ClassVar[Role] = "verdict"
    outliers: int
    count: int


@dataclass(frozen=True, slots=True)
class PlacesScatter(Finding):
    """The readings of a sensor scatter much more from place to place than at one place.

    Attributes:
        sensor: name of the sensor.
        factor: scatter from place to place over that at one place.
    """

    kind: ClassVar[str] = "places_scatter"
    sensor: str
    factor: float


@dataclass(frozen=True, slots=True)
class OffRig(Finding):
    """A beam is farther from its place on the rig than the rig allows.

    Attributes:
        sensor: name of the sensor.
        distance: distance of its origin from the rig's [m].
        angle: angle of its direction to the rig's [rad].
        p_value: p-value of this deviation.
    """

    kind: ClassVar[str] = "off_rig"
    sensor: str
    distance: float
    angle: float
    p_value: float
