"""An edge: its face first, then crossings of it, there and back, at several places; fit."""

from __future__ import annotations

import math

import numpy as np

from tanteo.acquisition.acquired import Acquired, Attempt, failed
from tanteo.acquisition.cloud import Cloud, over
from tanteo.acquisition.ideas import EdgeIdea
from tanteo.acquisition.patch import all_seen
from tanteo.acquisition.plane import HOVER, LOOKS, acquire_plane
from tanteo.acquisition.record import edge_readings, fitted_feature
from tanteo.acquisition.session import Session, back_off, finish
from tanteo.acquisition.ways import facing, feet, fits, moved, path, swing
from tanteo.features import Feature
from tanteo.hand import Robot
from tanteo.motion import Crossing, EdgeEvent, Rules, approach, cross_edge, go_to, look
from tanteo.motion.result import Motion
from tanteo.sensors import RobotPreset
from tanteo.typing import FloatArray, Transforms, Vectors

INSET = 0.02
"""The face of an edge is looked for this far inside of where the edge should be [m]."""

REACH = 0.05
"""An edge is searched for so much farther than where it should be [m]."""

OFFSETS = (0.0, 0.012, -0.012)
"""Where along the edge it is crossed, from where it was met first [m]."""

ELSEWHERE = (0.0, 0.012, -0.012, 0.024, -0.024, 0.036, -0.036)
"""Where along the edge the search for it may begin, from where the face was scanned [m]."""

ENOUGH = 0.02
"""A search should have room for so much farther than where the edge should be [m]."""

_SHIFT = 0.010
"""Along the line of the sensors, for a second crossing where only one of them has met the edge [m]."""

_MOST_ASKEW = math.radians(15.0)
"""Crossings at a greater angle to the edge's normal only serve to find its direction."""

_SAME = 0.004
"""Events farther than this from the line of the others are of another edge [m]."""

_PLACES = 3
"""Places along an edge that its events come from."""

_STEP = 0.005
"""A way is looked at for room in such steps [m]."""

_FEWEST = 4
"""Events that make an edge."""


def sense_edge(
    robot: Robot,
    idea: EdgeIdea,
    *,
    standoff: float,
    rules: Rules,
    label: str = "edge",
    errors: RobotPreset | str | None = None,
) -> Acquired:
    """Acquire a straight edge at which a face drops off; the face is acquired with it (:attr:`Acquired.others`).

    Args:
        robot: The hand, some way before the face, so that its beams reach it.
        idea: About where the edge is, and its face.
        standoff: Of the hand's front over the face [m]; 1.25 clearances of the rules or more.
        rules: What to keep to.
        label: Of the readings and the feature; the face's is ``<label> face``.
        errors: Of the robot's poses, for the covariance.

    Raises:
        InputError: A stand-off too near to the clearance of the rules.
    """
    session = Session(robot, standoff, rules, errors)
    status, message, face = acquire_plane(session, idea.face(INSET), f"{label} face")
    if face is None:
        return finish("edge", session, status, f"the face of the edge: {message}", None)
    session.others.append(face)
    status, message, feature = acquire_edge(session, face, idea, label)
    return finish("edge", session, status, message, feature)


def acquire_edge(session: Session, face: Feature, idea: EdgeIdea, label: str) -> Attempt:
    """The same within a session that stands over the face."""
    normal = face.T_world_feature[:3, 2]
    along = idea.direction - (idea.direction @ normal) * normal
    if np.linalg.norm(along) < 0.2:
        return "unclear", "the edge should run across the face that was found, not along it", None
    along = along / np.linalg.norm(along)
    found = _find(session, face, along, idea.point)
    if isinstance(found, Motion):
        return failed(found)
    front, outwards, reach, events = found
    attempt: Attempt = ("unclear", "the sensors met the edge at one place only", None)
    # the two sensors may have met two edges: then each of them looks for its own beside the place
    for sensors in (session.hand.frontal, *((i,) for i in session.hand.frontal)):
        mine = [e for e in events if e.sensor in sensors]
        if len(sensors) == 1 and mine:
            mine += _beside(session, face, (front, along, outwards), reach, sensors[0])
        line = _line(session, mine) if mine else None
        if line is not None:
            attempt = _cross_again(session, face, line, (front, outwards), mine, label)
            if attempt[0] != "unclear":
                return attempt
    return attempt


def _find(
    session: Session, face: Feature, along: FloatArray, wanted: FloatArray
) -> tuple[FloatArray, FloatArray, float, tuple[EdgeEvent, ...]] | Motion:
    """Outwards until the edge is met, with the pair along where it should run."""
    normal = face.T_world_feature[:3, 2]
    outwards = np.cross(along, normal)
    front = _front(session)
    needed = max(float((wanted - front) @ outwards), 0.0)
    reach = needed + REACH
    cloud, places = _raised(session, face), [front + shift * along for shift in ELSEWHERE]
    free = [_free(session, cloud, _over(session, face, p, along), outwards, reach) for p in places]
    enough = [k for k, f in enumerate(free) if f >= needed + ENOUGH]
    stood = stand(session, face, places[enough[0] if enough else int(np.argmax(free))], along, 0.0 * outwards)
    if not stood.reached:
        return stood
    front = _front(session)
    crossing = _cross(session, face, outwards, reach, 2 * session.hand.baseline)
    events = crossing.events
    if not crossing.motion.reached:
        return crossing.motion
    return front, outwards, reach, events


def _beside(
    session: Session, face: Feature, known: tuple[FloatArray, FloatArray, FloatArray], reach: float, sensor: int
) -> list[EdgeEvent]:
    """Two more crossings by one sensor, to both sides of the first."""
    front, along, outwards = known
    events: list[EdgeEvent] = []
    for shift in (_SHIFT, -_SHIFT):
        if stand(session, face, front + shift * along, along, 0.0 * outwards).reached:
            again = _cross(session, face, outwards, reach, 2 * session.hand.baseline)
            events += [e for e in again.events if e.sensor == sensor]
    return events


def _cross_again(
    session: Session,
    face: Feature,
    line: tuple[FloatArray, FloatArray],
    first: tuple[FloatArray, FloatArray],
    events: list[EdgeEvent],
    label: str,
) -> Attempt:
    """Crossings square to the line that is known by now, at several places along it; fit."""
    normal, (point, along) = face.T_world_feature[:3, 2], line
    along = along - (along @ normal) * normal
    along = along / np.linalg.norm(along)
    outwards = np.cross(along, normal)
    if outwards @ first[1] < 0:
        along, outwards = -along, -outwards
    kept = list(events) if outwards @ first[1] > math.cos(_MOST_ASKEW) else []
    inset = session.standoff * 0.3 + 0.006
    last: Motion | None = None
    middle = point + ((first[0] - point) @ along) * along
    places = [middle + offset * along - inset * outwards for offset in OFFSETS]
    looked = _look_there(session, face, np.array(places), along)
    if looked is not None and not looked.reached:
        return failed(looked)
    for place in places:
        way = (inset + 0.01) * outwards
        last = stand(session, face, place, along, way)
        if not last.reached:
            continue
        crossing = _cross(session, face, outwards, inset + 0.012, 0.010)
        last = crossing.motion
        kept += [e for e in crossing.events if _distance(session, e, line) < _SAME]
    if len(kept) < _FEWEST or not _along_a_line(session, kept, along):
        why = "" if last is None or last.reached else f": {last.message}"
        return "unclear", f"the edge was met {len(kept)} times, at too few places{why}", None
    readings = edge_readings(session.hand, kept, label)
    feature, why = fitted_feature(readings, label, session.hand.rig, session.errors)
    if feature is None or why:
        return "unclear", f"what was crossed is not one edge: {why}", None
    session.readings.append(readings)
    return "acquired", f"{len(kept)} crossings", feature


def stand(session: Session, face: Feature, place: Vectors, along: FloatArray, outwards: Vectors) -> Motion:
    """At the stand-off over a place of the face, square to it, the pair along a line.

    The way leads along the face where what was seen leaves room for it, else over the hover height.

    Args:
        session: The acquisition.
        face: As sensed.
        place: In the world ``(3,)`` [m]; its foot on the face counts.
        along: For the pair ``(3,)``.
        outwards: How far the crossing from there will go at least ``(3,)`` [m]; there has to be room for that, too.
    """
    hand, T, cloud = session.hand, session.robot.sensed.T_world_hand, _raised(session, face)
    normal = face.T_world_feature[:3, 2]
    down = _over(session, face, place, along)
    if not fits(session, cloud, np.stack([down, moved(down, outwards)])):
        return Motion("stand", "limit", "there is no room for the hand at the edge", ())
    if fits(session, cloud, path(T, down, hand.front, 12)):
        return session.does(go_to(session.robot, down, session.rules))
    back = back_off(session, HOVER)
    if not back.reached:
        return back
    over = session.does(go_to(session.robot, moved(down, HOVER * normal), session.rules))
    if not over.reached:
        return over
    return session.does(approach(session.robot, session.standoff, session.rules, reach=2 * HOVER))


def _over(session: Session, face: Feature, place: Vectors, along: FloatArray) -> Transforms:
    """The pose at the stand-off over the foot of a place."""
    origin, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    foot = place - ((place - origin) @ normal) * normal
    return facing(session.hand, foot, normal, along, session.standoff, session.robot.sensed.T_world_hand)


def _free(session: Session, cloud: Cloud, T: Transforms, outwards: Vectors, most: float) -> float:
    """How far the hand may go from a pose, at most so far; negative if it may not even be there [m]."""
    steps = np.arange(1 + math.ceil(most / _STEP)) * _STEP
    for s in steps:
        if not fits(session, cloud, moved(T, s * outwards)[None]):
            return float(s) - _STEP
    return float(steps[-1])


def _raised(session: Session, face: Feature) -> Cloud:
    """What stands out of the face: the hand stays over it."""
    T = face.T_world_feature
    return over(session.seen(), T[:3, 3], T[:3, 2])


def _cross(session: Session, face: Feature, outwards: Vectors, reach: float, spread: float) -> Crossing:
    """A crossing as far as what was seen leaves room for it."""
    T, cloud = session.robot.sensed.T_world_hand, _raised(session, face)
    farthest = _free(session, cloud, T, outwards, reach + spread)
    crossing = cross_edge(
        session.robot,
        T[:3, :3].T @ outwards,
        max(min(reach, farthest), 0.0),
        session.standoff,
        session.rules,
        spread=max(min(spread, farthest), 0.0),
    )
    session.does(crossing.motion)
    return crossing


def _front(session: Session) -> FloatArray:
    T = session.robot.sensed.T_world_hand
    return np.asarray(T[:3, :3] @ session.hand.front + T[:3, 3])


def _place(session: Session, event: EdgeEvent) -> FloatArray:
    """Where an event was, in the world."""
    T = event.T_world_hand
    hand = session.hand
    local = hand.origins[event.sensor] + event.distance * hand.axes[event.sensor]
    return np.asarray(T[:3, :3] @ local + T[:3, 3])


def _line(session: Session, events: list[EdgeEvent]) -> tuple[FloatArray, FloatArray] | None:
    """A point and the direction of the line through events; None if they are all at one place."""
    places = np.array([_place(session, e) for e in events])
    middle = places.mean(axis=0)
    _, size, axes = np.linalg.svd(places - middle)
    if size[0] / math.sqrt(len(places)) < 0.25 * _SHIFT:
        return None
    return middle, axes[0]


def _along_a_line(session: Session, events: list[EdgeEvent], along: FloatArray) -> bool:
    """Whether events are at three places or more: any two are on one line."""
    places = np.sort([_place(session, e) @ along for e in events])
    return 1 + int((np.diff(places) > 0.5 * _SHIFT).sum()) >= _PLACES


def _look_there(session: Session, face: Feature, places: FloatArray, along: FloatArray) -> Motion | None:
    """A look from over the first of some places, unless the face has been seen all around the fingers at them all."""
    T = face.T_world_feature
    origin, normal = T[:3, 3], T[:3, 2]
    poses = np.stack([_over(session, face, p, along) for p in places])
    if all_seen(session.seen(), origin, normal, feet(session.hand, poses)):
        return None
    back = back_off(session, HOVER)
    if not back.reached:
        return back
    over = moved(_over(session, face, places[0], along), HOVER * normal)
    if not fits(session, _raised(session, face), path(session.robot.sensed.T_world_hand, over, session.hand.front, 12)):
        return Motion("look", "limit", "there is no room for the hand over the edge", ())
    there = session.does(go_to(session.robot, over, session.rules))
    if not there.reached:
        return there
    tilt, spacing = LOOKS[1]
    return session.does(look(session.robot, swing(session, tilt), session.rules, spacing=spacing))


def _distance(session: Session, event: EdgeEvent, line: tuple[FloatArray, FloatArray]) -> float:
    away = _place(session, event) - line[0]
    return float(np.linalg.norm(away - (away @ line[1]) * line[1]))
