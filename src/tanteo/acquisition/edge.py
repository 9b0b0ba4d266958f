"""An edge: its face first, then crossings of it, there and back, at several places; fit."""

from __future__ import annotations

import math

import numpy as np

from tanteo.acquisition.acquired import Acquired, Attempt, failed
from tanteo.acquisition.edge_bend import acquire_bend
from tanteo.acquisition.edge_places import Search, cross_at, look_over, pose_over
from tanteo.acquisition.edge_search import Found, cross_beside, find_edge
from tanteo.acquisition.edge_sides import against
from tanteo.acquisition.events import Line, agreeing, count_places, line_through, on_line, place_of
from tanteo.acquisition.guesses import EdgeGuess
from tanteo.acquisition.plane import acquire_plane
from tanteo.acquisition.record import edge_readings, fitted_feature
from tanteo.acquisition.session import Session, finish
from tanteo.acquisition.ways import nearly_known
from tanteo.constraints import relate_all
from tanteo.features import Feature
from tanteo.hand import Robot
from tanteo.motion import EdgeEvent, Motion, Rules
from tanteo.sensors import RobotPreset
from tanteo.typing import FloatArray

INSET = 0.02
"""The face of an edge is looked for this far inside of where the edge should be [m]."""

OFFSETS = (0.0, 0.012, -0.012, 0.024, -0.024, 0.006, -0.006)
"""Where along the edge it is crossed, from where it was met first [m]."""

ENOUGH, MET = 3, 5
"""So many crossings are enough if they met the edge at so many places that control each other, two a crossing where
both sensors meet it: of fewer places one that is on another edge, just past the corner, may pass."""

_MOST_ASKEW = math.radians(15.0)
"""Crossings at a greater angle to the edge's normal only serve to find its direction."""

_IN_FACE = 30.0
"""Squared distance of an edge from its face, by height and rise in their covariance, beyond which it is not in it; less
than one edge of a million is beyond by chance."""

_BEYOND = 0.01
"""A crossing goes this far over the edge, at least [m]."""


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

    Where the face drops off, the edge is made of crossings. Where it only bends, by 12 degrees or more, the face beyond
    is acquired as well, and the edge is where both planes meet.

    Args:
        robot: The hand, some way before the face, so that its beams reach it.
        guess: About where the edge is, and its face.
        standoff: Of the hand's front over the face [m]; 1.25 clearances of the rules or more.
        rules: What to keep to.
        label: Of the readings and the feature; the face's is ``<label> face``, and ``<label> other face``.
        errors: Of the robot's poses, for the covariance.

    Raises:
        InputError: A stand-off too near to the clearance of the rules.
    """
    session = Session(robot, standoff, rules, errors)
    status, message, face = acquire_plane(session, guess.face(INSET), f"{label} face")
    if face is None:
        return finish("edge", session, status, f"the face of the edge: {message}", None)
    session.others.append(face)
    status, message, feature = acquire_edge(session, face, guess, label)
    return finish("edge", session, status, message, feature)


def acquire_edge(session: Session, face: Feature, guess: EdgeGuess, label: str) -> Attempt:
    """The same within a session that stands over the face."""
    normal = face.T_world_feature[:3, 2]
    along = guess.direction - (guess.direction @ normal) * normal
    if np.linalg.norm(along) < 0.2:
        return "unclear", "the edge should run across the face that was found, not along it", None
    found = find_edge(session, face, along / np.linalg.norm(along), guess.point)
    if isinstance(found, Motion):
        return failed(found)
    if not found.events:
        return acquire_bend(session, face, found.outwards, found.bends, label)
    attempt: Attempt = ("unclear", "the sensors met the edge at one place only", None)
    # the two sensors may have met two edges: then each of them looks for its own beside the place
    for sensors in (session.hand.frontal, *((i,) for i in session.hand.frontal)):
        mine = [e for e in found.events if e.sensor in sensors]
        if len(sensors) == 1 and mine:
            mine += cross_beside(session, face, found, sensors[0])
        line = line_through(session.hand, mine)
        if line is not None:
            attempt = _cross_again(session, face, line, found, mine, label)
            if attempt[0] != "unclear":
                return attempt
    return attempt


def _cross_again(
    session: Session, face: Feature, line: Line, found: Found, events: list[EdgeEvent], label: str
) -> Attempt:
    """Crossings square to the line that is known by now, at several places along it; fit."""
    point, along, outwards = _squared(face, line, found.outwards)
    kept = list(events) if outwards @ found.outwards > math.cos(_MOST_ASKEW) else []
    inset = session.standoff * 0.3 + 0.006
    search = Search(inset + _BEYOND, inset + 0.012, _BEYOND)
    middle = point + ((found.front - point) @ along) * along - inset * outwards
    places = [middle + offset * along for offset in OFFSETS]
    needed = np.stack([pose_over(session, face, place, along) for place in places[:ENOUGH]])
    if not nearly_known(session, needed):
        look_over(session, face, needed)
    why, met = "", len(events)
    for number, place in enumerate(places):
        known = number >= ENOUGH and count_places(session.hand, kept, along) >= MET
        if known and not agreeing(session.hand, kept, along, outwards, met)[1]:
            break
        crossing = cross_at(session, face, place, along, outwards, search)
        kept += on_line(session.hand, crossing.events, line)
        met += len(crossing.events)
        why = "" if crossing.motion.reached else f": {crossing.motion.message}"
    kept, doubts = agreeing(session.hand, kept, along, outwards, met)
    if doubts:
        return "unclear", f"{doubts}{why}", None
    readings = edge_readings(session.hand, kept, label)
    feature, why = fitted_feature(readings, label, session.hand.rig, session.errors)
    if feature is not None and (off := _off_face(face, feature)):
        return "unclear", off, None
    if feature is None or why:
        return "unclear", f"what was crossed is not one edge: {why}", None
    spots = np.array([place_of(session.hand, e) for e in kept])
    if other := against(session, face, feature, spots, outwards):
        return "unclear", other, None
    session.readings.append(readings)
    return "acquired", f"{len(kept)} crossings", feature


def _off_face(face: Feature, edge: Feature) -> str:
    """What is to be said of an edge that is not in its face; empty if it is.

    Over a narrow bevel the ranges grow too little to be off the face, so that its far end is what is crossed.
    """
    found = relate_all([face, edge]).column("edge_plane_coplanarity")
    off = found.value[0]
    if float(off @ np.linalg.solve(found.covariance[0], off)) < _IN_FACE:
        return ""
    side = "below" if off[0] < 0 else "above"
    return (
        f"what was crossed is {1e3 * abs(off[0]):.2g} mm {side} the face: the border seems to be bevelled or rounded. "
        "Acquire both faces beside it; their planes meet in the edge"
    )


def _squared(face: Feature, line: Line, outwards: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A line laid into the face, and the way out of the face across it."""
    normal, (point, along) = face.T_world_feature[:3, 2], line
    along = along - (along @ normal) * normal
    along = along / np.linalg.norm(along)
    out = np.cross(along, normal)
    return (point, along, out) if out @ outwards > 0 else (point, -along, -out)
