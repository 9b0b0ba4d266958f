"""Acquire an edge: first its face, then crossings of the edge in both directions at several positions, then a fit.

If the surface only bends, the hand also senses the face beyond, and the edge is the intersection of the two planes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from tanteo.errors import DegenerateError
from tanteo.features import Feature, relate_all
from tanteo.fitting import edge_from_planes
from tanteo.geometry.typing import FloatArray
from tanteo.hand.acquisition.crossings import Search, cross_at, pose_over, rise, scan_above
from tanteo.hand.acquisition.edge_events import Line, against, agreeing, count_places, line_through, on_line, place_of
from tanteo.hand.acquisition.edge_search import FoundEdge, cross_beside, find_edge
from tanteo.hand.acquisition.guesses import EdgeGuess, FaceGuess
from tanteo.hand.acquisition.plane import HOVER, acquire_plane
from tanteo.hand.acquisition.record import fitted_feature, labelled_readings
from tanteo.hand.acquisition.run import Acquired, Attempt, SensingRun, failed, finish
from tanteo.hand.acquisition.ways import facing, fits, nearly_known
from tanteo.hand.motion.crossing import EdgeEvent
from tanteo.hand.motion.steering import Motion, Rules
from tanteo.hand.motion.track import Crease, crease_angle
from tanteo.hand.motion.travelling import go_to, path
from tanteo.hand.robot import Robot
from tanteo.sensors.presets import RobotPreset
from tanteo.words.findings import (
    AfterMotion,
    BendsAway,
    CreaseOff,
    CreaseSensed,
    EdgeAlongFace,
    EdgeAtOnePlace,
    EdgeOffFace,
    Finding,
    NotOneFeature,
    ReadingsTaken,
    StepFailed,
)

_OTHER_FACE = 0.02
"""Distance beyond the bend at which the search for the other face starts [m]."""

_BESIDE = 0.006
"""Largest distance of the planes' intersection from the measured bend [m]; a bend is measured less sharply than a
drop."""


def acquire_crease(
    run: SensingRun, face: Feature, outwards: FloatArray, creases: Sequence[Crease], label: str
) -> Attempt:
    """Acquire an edge at which the surface bends, as the intersection of two sensed planes.

    For a rounded edge, this is the intersection of its extended faces.

    Args:
        run: running acquisition.
        face: sensed face of the edge.
        outwards: direction out of the face, across the edge ``(3,)``.
        creases: bends that the sensors passed.
        label: label of the edge.
    """
    normal = face.T_world_feature[:3, 2]
    place = np.median([place_of(run.hand, c) for c in creases], axis=0)
    angle = float(np.median([c.angle for c in creases]))
    ahead, beyond = _turned(outwards, normal, angle)
    above = _between(run, face, place, _turned(outwards, normal, 0.5 * angle)[1], np.cross(normal, outwards))
    if not above.reached:
        return failed(above)
    status, finding, other = acquire_plane(
        run, FaceGuess(place + _OTHER_FACE * ahead, beyond), f"{label} other face", beside=face
    )
    if other is None:
        return (
            status,
            StepFailed("face beyond it", finding, BendsAway(crease_angle(creases))),
            None,
        )
    run.others.append(other)
    try:
        edge = edge_from_planes(face, other, place, label)
    except DegenerateError as error:
        return "unclear", NotOneFeature("crease", str(error)), None
    away = place - edge.T_world_feature[:3, 3]
    direction = edge.T_world_feature[:3, 0]
    off = float(np.linalg.norm(away - (away @ direction) * direction))
    if off > _BESIDE:
        return "unclear", CreaseOff(off), None
    return "acquired", CreaseSensed(), edge


def _turned(outwards: FloatArray, normal: FloatArray, angle: float) -> tuple[FloatArray, FloatArray]:
    """Return the direction out of a face, and its normal, rotated by the angle of a bend [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return c * outwards - s * normal, c * normal + s * outwards


def _between(run: SensingRun, face: Feature, place: FloatArray, normal: FloatArray, along: FloatArray) -> Motion:
    """Move the hand over the bend, rotated half towards the other face, if the sensed points leave enough clearance."""
    back = rise(run, face)
    if not back.reached:
        return back
    hand, T = run.hand, run.robot.sensed.T_world_hand
    target = facing(hand, place, normal, along, run.standoff + HOVER, T)
    if not fits(run, run.seen(), path(T, target, hand.front, 12)):
        return back
    return run.does(go_to(run.robot, target, run.rules))


INSET = 0.02
"""Distance inside of the expected edge at which the search for its face starts [m]."""

OFFSETS = (0.0, 0.012, -0.012, 0.024, -0.024, 0.006, -0.006)
"""Positions of the crossings along the edge, relative to the first crossing [m]."""

ENOUGH, PLACES = 3, 5
"""Sufficient numbers of crossings, and of positions on the edge that verify each other. A crossing gives two positions
if both sensors cross. With fewer positions, one on another edge just past the corner may remain undetected."""

_MOST_ASKEW = math.radians(15.0)
"""Angle to the edge's normal above which a crossing only serves to find the direction of the edge [rad]."""

_IN_FACE = 30.0
"""Largest squared Mahalanobis distance of an edge from its face, by height and slope; less than one edge in a million
exceeds it by chance."""

_BEYOND = 0.01
"""Smallest distance by which a crossing goes beyond the edge [m]."""


def sense_edge(
    robot: Robot,
    guess: EdgeGuess,
    *,
    standoff: float,
    rules: Rules,
    label: str = "edge",
    errors: RobotPreset | str | None = None,
) -> Acquired:
    """Acquire a straight edge; the face is acquired with it (:attr:`Acquired.others`).

    If the surface ends, the edge is a fit to crossings. If it only bends, by 12 degrees or more, the hand also acquires
    the face beyond, and the edge is the intersection of both planes.

    Args:
        robot: robot with the hand in front of the face, within the range of its beams.
        guess: approximate position of the edge and of its face.
        standoff: distance of the hand's front from the face [m], at least 1.25 times the clearance of the rules.
        rules: limits of the motions.
        label: label of the readings and the feature; the face's is ``<label> face``, and ``<label> other face``.
        errors: error model of the reported poses, for the covariance.

    Raises:
        InputError: The stand-off is too small for the clearance of the rules.
    """
    run = SensingRun(robot, standoff, rules, errors)
    status, finding, face = acquire_plane(run, guess.face(INSET), f"{label} face")
    if face is None:
        return finish("edge", run, status, StepFailed("face of the edge", finding), None)
    run.others.append(face)
    status, finding, feature = acquire_edge(run, face, guess, label)
    return finish("edge", run, status, finding, feature)


def acquire_edge(run: SensingRun, face: Feature, guess: EdgeGuess, label: str) -> Attempt:
    """Acquire the edge within a running acquisition, with the hand over the face.

    Args:
        run: running acquisition.
        face: sensed face of the edge.
        guess: approximate position of the edge.
        label: label of the edge.
    """
    normal = face.T_world_feature[:3, 2]
    along = guess.direction - (guess.direction @ normal) * normal
    if np.linalg.norm(along) < 0.2:
        return "unclear", EdgeAlongFace(), None
    found = find_edge(run, face, along / np.linalg.norm(along), guess.point)
    if isinstance(found, Motion):
        return failed(found)
    if not found.events:
        return acquire_crease(run, face, found.outwards, found.creases, label)
    attempt: Attempt = ("unclear", EdgeAtOnePlace(), None)
    # if the two sensors crossed two different edges, each sensor searches for its own one beside the position
    for sensors in (run.hand.frontal, *((i,) for i in run.hand.frontal)):
        mine = [e for e in found.events if e.sensor in sensors]
        if len(sensors) == 1 and mine:
            mine += cross_beside(run, face, found, sensors[0])
        line = line_through(run.hand, mine)
        if line is not None:
            attempt = _cross_again(run, face, line, found, mine, label)
            if attempt[0] != "unclear":
                return attempt
    return attempt


def _cross_again(
    run: SensingRun, face: Feature, line: Line, found: FoundEdge, events: list[EdgeEvent], label: str
) -> Attempt:
    """Cross the edge at right angles to the known line at several positions, and fit the edge."""
    point, along, outwards = _squared(face, line, found.outwards)
    kept = list(events) if outwards @ found.outwards > math.cos(_MOST_ASKEW) else []
    inset = run.standoff * 0.3 + 0.006
    search = Search(inset + _BEYOND, inset + 0.012, _BEYOND)
    middle = point + ((found.front - point) @ along) * along - inset * outwards
    places = [middle + offset * along for offset in OFFSETS]
    needed = np.stack([pose_over(run, face, place, along) for place in places[:ENOUGH]])
    if not nearly_known(run, needed):
        scan_above(run, face, needed)
    last: Finding | None = None
    total = len(events)
    for number, place in enumerate(places):
        known = number >= ENOUGH and count_places(run.hand, kept, along) >= PLACES
        if known and agreeing(run.hand, kept, along, outwards, total)[1] is None:
            break
        crossing = cross_at(run, face, place, along, outwards, search)
        kept += on_line(run.hand, crossing.events, line)
        total += len(crossing.events)
        last = None if crossing.motion.reached else crossing.motion.finding
    kept, doubts = agreeing(run.hand, kept, along, outwards, total)
    if doubts is not None:
        return "unclear", doubts if last is None else AfterMotion(doubts, last), None
    readings = labelled_readings(run.hand, kept, label, "edge")
    feature, why = fitted_feature(readings, label, run.hand.rig, run.errors)
    if feature is not None and (off := _off_face(face, feature)):
        return "unclear", off, None
    if feature is None or why:
        return "unclear", NotOneFeature("edge", why), None
    spots = np.array([place_of(run.hand, e) for e in kept])
    if other := against(run, face, feature, spots, outwards):
        return "unclear", other, None
    run.readings.append(readings)
    return "acquired", ReadingsTaken(len(kept)), feature


def _off_face(face: Feature, edge: Feature) -> EdgeOffFace | None:
    """Return that an edge is not in its face, or None.

    Over a narrow bevel the ranges grow too little to be off the face, so that the sensors cross its far end.
    """
    found = relate_all([face, edge]).column("edge_plane_coplanarity")
    off = found.value[0]
    if float(off @ np.linalg.solve(found.covariance[0], off)) < _IN_FACE:
        return None
    return EdgeOffFace(float(off[0]))


def _squared(face: Feature, line: Line, outwards: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a line projected into the face as point and direction, and the direction out of the face across it."""
    normal, (point, along) = face.T_world_feature[:3, 2], line
    along = along - (along @ normal) * normal
    along = along / np.linalg.norm(along)
    out = np.cross(along, normal)
    return (point, along, out) if out @ outwards > 0 else (point, -along, -out)
