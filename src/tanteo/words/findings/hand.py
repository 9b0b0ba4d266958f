"""Findings of a hand: how its motions and its acquisitions of features ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from tanteo.words.findings.base import Finding


@dataclass(frozen=True, slots=True)
class AtPose(Finding):
    """The hand is at the demanded pose."""

    kind: ClassVar[str] = "at_pose"


@dataclass(frozen=True, slots=True)
class AtRest(Finding):
    """The hand took readings at rest.

    Attributes:
        count: number of readings.
    """

    kind: ClassVar[str] = "at_rest"
    count: int


@dataclass(frozen=True, slots=True)
class SurroundingsScanned(Finding):
    """The hand scanned its surroundings."""

    kind: ClassVar[str] = "looked_around"


@dataclass(frozen=True, slots=True)
class AtStandoff(Finding):
    """The hand is at its stand-off before a surface.

    Attributes:
        distance: stand-off [m].
        square: whether the hand is square to the surface.
    """

    kind: ClassVar[str] = "at_standoff"
    distance: float
    square: bool


@dataclass(frozen=True, slots=True)
class MovedBack(Finding):
    """The hand retreated.

    Attributes:
        distance: length of the path [m].
    """

    kind: ClassVar[str] = "moved_back"
    distance: float


@dataclass(frozen=True, slots=True)
class Followed(Finding):
    """The hand followed a surface.

    Attributes:
        distance: length of the path [m].
    """

    kind: ClassVar[str] = "followed"
    distance: float


@dataclass(frozen=True, slots=True)
class EdgeCrossed(Finding):
    """The sensors crossed an edge and returned over it.

    Attributes:
        crossings: number of crossings.
        sensors: number of sensors that crossed.
    """

    kind: ClassVar[str] = "edge_crossed"
    crossings: int
    sensors: int


@dataclass(frozen=True, slots=True)
class NearSurface(Finding):
    """A motion is blocked: a sensor is near a surface.

    Attributes:
        sensor: name of the sensor.
    """

    kind: ClassVar[str] = "near_surface"
    sensor: str


@dataclass(frozen=True, slots=True)
class AtLimit(Finding):
    """A motion is blocked: the hand is at a bound or a forbidden box of the workspace.

    Attributes:
        limit: name of the bound or the box.
    """

    kind: ClassVar[str] = "at_limit"
    limit: str


@dataclass(frozen=True, slots=True)
class TimedOut(Finding):
    """A motion took too long.

    Attributes:
        seconds: time limit [s].
    """

    kind: ClassVar[str] = "timed_out"
    seconds: float


@dataclass(frozen=True, slots=True)
class NothingInRange(Finding):
    """No frontal beam hit anything during a scan."""

    kind: ClassVar[str] = "nothing_in_range"


@dataclass(frozen=True, slots=True)
class NoSurfaceAhead(Finding):
    """No surface is ahead of the hand.

    Attributes:
        reach: distance that was searched [m].
    """

    kind: ClassVar[str] = "no_surface_ahead"
    reach: float


@dataclass(frozen=True, slots=True)
class NoRanges(Finding):
    """The surface gives no ranges, because the beams hit it too obliquely."""

    kind: ClassVar[str] = "no_ranges"


@dataclass(frozen=True, slots=True)
class NotUnderSensors(Finding):
    """The surface is not under the frontal sensors.

    Attributes:
        both: whether both sensors are needed; otherwise it is under neither.
    """

    kind: ClassVar[str] = "not_under_sensors"
    both: bool


@dataclass(frozen=True, slots=True)
class TwoSurfaces(Finding):
    """The frontal sensors are over two different surfaces.

    Attributes:
        angle: apparent tilt of a single surface [rad].
    """

    kind: ClassVar[str] = "two_surfaces"
    angle: float


@dataclass(frozen=True, slots=True)
class SurfaceEnded(Finding):
    """The surface ended under the hand.

    Attributes:
        distance: length of the path until then [m].
    """

    kind: ClassVar[str] = "surface_ended"
    distance: float


@dataclass(frozen=True, slots=True)
class SurfaceBent(Finding):
    """The surface bent away from the hand.

    Attributes:
        distance: length of the path until then [m].
    """

    kind: ClassVar[str] = "surface_bent"
    distance: float


@dataclass(frozen=True, slots=True)
class BendsAway(Finding):
    """The surface does not end in an edge, it bends away.

    Attributes:
        angle: angle of the bend [rad]; infinite if it is too steep for the sensors.
    """

    kind: ClassVar[str] = "bends_away"
    angle: float


@dataclass(frozen=True, slots=True)
class NoEdge(Finding):
    """The surface does not end within the reach.

    Attributes:
        reach: distance that was searched [m].
    """

    kind: ClassVar[str] = "no_edge"
    reach: float


@dataclass(frozen=True, slots=True)
class EdgeNotRepeated(Finding):
    """The surface ended at different places on the way out and on the way back."""

    kind: ClassVar[str] = "edge_not_repeated"


@dataclass(frozen=True, slots=True)
class NotCrossed(Finding):
    """No beam crossed the rim."""

    kind: ClassVar[str] = "not_crossed"


@dataclass(frozen=True, slots=True)
class NoSpace(Finding):
    """The hand has no free space somewhere.

    Attributes:
        place: place as a clause, such as ``over the face``.
    """

    kind: ClassVar[str] = "no_room"
    place: str


@dataclass(frozen=True, slots=True)
class NotAllSeen(Finding):
    """The space that the hand needs was not seen completely.

    Attributes:
        place: place as a clause, such as ``over the rim``.
    """

    kind: ClassVar[str] = "not_all_seen"
    place: str


@dataclass(frozen=True, slots=True)
class SpaceEnds(Finding):
    """The known free space ends before the surface does.

    Attributes:
        distance: length of the known free space [m].
    """

    kind: ClassVar[str] = "space_ends"
    distance: float


@dataclass(frozen=True, slots=True)
class NoFlatFace(Finding):
    """No flat face was seen where it should be."""

    kind: ClassVar[str] = "no_flat_face"


@dataclass(frozen=True, slots=True)
class FacesTooNarrow(Finding):
    """No face is wide enough for both frontal sensors."""

    kind: ClassVar[str] = "faces_too_narrow"


@dataclass(frozen=True, slots=True)
class FaceNotRepeated(Finding):
    """The face was not found at the same place twice."""

    kind: ClassVar[str] = "face_not_repeated"


@dataclass(frozen=True, slots=True)
class OtherFace(Finding):
    """The sensed face is another one than the expected face.

    Attributes:
        distance: its distance from the expected place [m].
        angle: its tilt from the expected normal [rad].
        sd: standard deviation of the expected distance [m].
        angle_sd: standard deviation of the expected tilt [rad].
    """

    kind: ClassVar[str] = "other_face"
    distance: float
    angle: float
    sd: float
    angle_sd: float


@dataclass(frozen=True, slots=True)
class ScanTooShort(Finding):
    """The scan is too short to determine the tilt of the face."""

    kind: ClassVar[str] = "scan_too_short"


@dataclass(frozen=True, slots=True)
class SurfaceLost(Finding):
    """The surface was under the frontal sensors for too short a time."""

    kind: ClassVar[str] = "surface_lost"


@dataclass(frozen=True, slots=True)
class ReadingsTaken(Finding):
    """A feature is sensed by readings.

    Attributes:
        count: number of readings.
    """

    kind: ClassVar[str] = "readings_taken"
    count: int


@dataclass(frozen=True, slots=True)
class NotOneFeature(Finding):
    """The readings do not belong to one feature of the expected kind.

    Attributes:
        feature: kind of the feature.
        cause: reason as a clause.
    """

    kind: ClassVar[str] = "not_one_feature"
    feature: str
    cause: str


@dataclass(frozen=True, slots=True)
class EdgeAlongFace(Finding):
    """The expected edge is not parallel to the sensed face."""

    kind: ClassVar[str] = "edge_along_face"


@dataclass(frozen=True, slots=True)
class EdgeAtOnePlace(Finding):
    """The sensors crossed the edge at one place only."""

    kind: ClassVar[str] = "edge_at_one_place"


@dataclass(frozen=True, slots=True)
class FewEdgeCrossings(Finding):
    """The sensors crossed the edge at too few places.

    Attributes:
        count: number of crossings.
        alone: whether one place is far from all others.
    """

    kind: ClassVar[str] = "edge_met_rarely"
    count: int
    alone: bool


@dataclass(frozen=True, slots=True)
class EdgesMixed(Finding):
    """Most of the crossings belong to other edges.

    Attributes:
        count: number of all crossings.
        own: number of crossings of this edge.
    """

    kind: ClassVar[str] = "edges_mixed"
    count: int
    own: int


@dataclass(frozen=True, slots=True)
class PlaceBeside(Finding):
    """One place disagrees with the line or circle of the others.

    Attributes:
        sds: its distance in standard deviations.
        shape: ``line`` or ``circle``.
    """

    kind: ClassVar[str] = "place_beside"
    sds: float
    shape: Literal["line", "circle"]


@dataclass(frozen=True, slots=True)
class EdgeOffFace(Finding):
    """The sensed edge is not in its face, as at a bevel or a rounding.

    Attributes:
        offset: height of the edge over the face [m]; negative below.
    """

    kind: ClassVar[str] = "edge_off_face"
    offset: float


@dataclass(frozen=True, slots=True)
class FaceEndsElsewhere(Finding):
    """Between the places where an edge was crossed, the face does not end at that line.

    Attributes:
        beyond: whether the face continues beyond the line; otherwise it ends before it.
    """

    kind: ClassVar[str] = "face_ends_elsewhere"
    beyond: bool


@dataclass(frozen=True, slots=True)
class CreaseSensed(Finding):
    """The edge is the line in which the planes of two faces meet."""

    kind: ClassVar[str] = "crease_sensed"


@dataclass(frozen=True, slots=True)
class CreaseOff(Finding):
    """The planes of two faces meet beside the bend of the surface.

    Attributes:
        distance: distance of their line from the bend [m].
    """

    kind: ClassVar[str] = "crease_off"
    distance: float


@dataclass(frozen=True, slots=True)
class RimNotSeen(Finding):
    """The beams show no rim where it should be.

    Attributes:
        convex: whether it is the rim of a boss; otherwise of a bore.
        narrowest: smallest diameter of a bore that the beams show [m]; NaN for a boss.
    """

    kind: ClassVar[str] = "rim_not_seen"
    convex: bool
    narrowest: float


@dataclass(frozen=True, slots=True)
class BoreTooNarrow(Finding):
    """The bore is too narrow for the beams at this stand-off.

    Attributes:
        narrowest: smallest diameter that a beam needs [m].
    """

    kind: ClassVar[str] = "bore_too_narrow"
    narrowest: float


@dataclass(frozen=True, slots=True)
class FewRimPlaces(Finding):
    """The rim was crossed at too few places to determine its circle.

    Attributes:
        count: number of places.
        cause: ``few``: too few to check each other; ``spread``: they cover too little of the circle; ``open``: none
            within ``angle``; ``alone``: one is far from all others.
        angle: angle of the circle without a place [rad]; NaN unless the cause is ``open``.
    """

    kind: ClassVar[str] = "rim_met_rarely"
    count: int
    cause: Literal["few", "spread", "open", "alone"]
    angle: float


@dataclass(frozen=True, slots=True)
class OtherRim(Finding):
    """The sensed rim is another one than the expected rim.

    Attributes:
        radius: its radius [m].
        distance: its distance from the expected place [m].
        expected: expected radius [m].
        fraction: standard deviation of the expected radius, as a fraction.
        sd: standard deviation of the expected place [m].
    """

    kind: ClassVar[str] = "other_rim"
    radius: float
    distance: float
    expected: float
    fraction: float
    sd: float


@dataclass(frozen=True, slots=True)
class RimSensed(Finding):
    """A rim is sensed.

    Attributes:
        crossings: number of crossings.
        places: number of places.
    """

    kind: ClassVar[str] = "rim_sensed"
    crossings: int
    places: int


@dataclass(frozen=True, slots=True)
class NoTwoRings(Finding):
    """The bore is too narrow for beams over its rim to reach two rings of its wall."""

    kind: ClassVar[str] = "no_two_rings"


@dataclass(frozen=True, slots=True)
class FewWallPlaces(Finding):
    """The wall was read at too few places.

    Attributes:
        count: number of places.
        tried: number of places that were tried.
        depth: depth below the rim [m].
    """

    kind: ClassVar[str] = "wall_met_rarely"
    count: int
    tried: int
    depth: float


@dataclass(frozen=True, slots=True)
class WallSensed(Finding):
    """A wall is sensed.

    Attributes:
        count: number of places.
        depths: depths of the two rings below the rim [m].
    """

    kind: ClassVar[str] = "wall_sensed"
    count: int
    depths: tuple[float, float]


@dataclass(frozen=True, slots=True)
class EdgesMeet(Finding):
    """Two sensed edges meet in a corner."""

    kind: ClassVar[str] = "edges_meet"


@dataclass(frozen=True, slots=True)
class EdgesPass(Finding):
    """Two sensed edges pass each other.

    Attributes:
        distance: distance between them [m].
        sds: the same in standard deviations.
    """

    kind: ClassVar[str] = "edges_pass"
    distance: float
    sds: float


@dataclass(frozen=True, slots=True)
class StepFailed(Finding):
    """A step of an acquisition failed.

    Attributes:
        step: name of the step.
        cause: reason of the failure.
        before: finding of an earlier step that the sentence repeats; None for none.
    """

    kind: ClassVar[str] = "step_failed"
    step: str
    cause: Finding
    before: Finding | None = None


@dataclass(frozen=True, slots=True)
class AfterMotion(Finding):
    """A result, and the last motion that failed before.

    Attributes:
        result: the result.
        motion: ending of the motion.
    """

    kind: ClassVar[str] = "after_motion"
    result: Finding
    motion: Finding
