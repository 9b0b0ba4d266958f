"""The first crossings of an edge: where it is about, and how it runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.acquisition.edge_places import cross, free_way, front_of, pose_over, raised, stand
from tanteo.acquisition.session import Session
from tanteo.features import Feature
from tanteo.motion import Bend, EdgeEvent, Motion
from tanteo.typing import FloatArray

REACH = 0.05
"""An edge is searched for so much farther than where it should be [m]."""

ELSEWHERE = (0.0, 0.012, -0.012, 0.024, -0.024, 0.036, -0.036)
"""Where along the edge the search for it may begin, from where the face was scanned [m]."""

ENOUGH = 0.02
"""A search should have room for so much farther than where the edge should be [m]."""

_SHIFT = 0.010
"""Along the line of the sensors, for a second crossing where only one of them has met the edge [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """An edge that was met.

    Attributes:
        front: Where the hand's front began the crossing ``(3,)`` [m].
        along: Of the pair ``(3,)``, unit.
        outwards: Of the crossing ``(3,)``, unit.
        reach: Of the search [m].
        events: Of all sensors that crossed.
        bends: Of those below which the surface bent away instead.
    """

    front: FloatArray
    along: FloatArray
    outwards: FloatArray
    reach: float
    events: tuple[EdgeEvent, ...]
    bends: tuple[Bend, ...]


def find_edge(session: Session, face: Feature, along: FloatArray, wanted: FloatArray) -> Found | Motion:
    """Outwards until an edge or a bend is met, with the pair along where it should run; else the motion that failed."""
    outwards = np.cross(along, face.T_world_feature[:3, 2])
    front = front_of(session)
    needed = max(float((wanted - front) @ outwards), 0.0)
    reach = needed + REACH
    place = _best_place(session, face, (front, along, outwards), (needed + ENOUGH, reach))
    stood = stand(session, face, place, along, 0.0 * outwards)
    if not stood.reached:
        return stood
    front = front_of(session)
    crossing = cross(session, face, outwards, reach, 2 * session.hand.baseline)
    if not (crossing.motion.reached or crossing.bends):
        return crossing.motion
    return Found(front, along, outwards, reach, crossing.events, crossing.bends)


def _best_place(
    session: Session,
    face: Feature,
    known: tuple[FloatArray, FloatArray, FloatArray],
    least_and_most: tuple[float, float],
) -> FloatArray:
    """The first place beside the front from which there is room for enough, or the one with most room."""
    front, along, outwards = known
    least, most = least_and_most
    cloud, best = raised(session, face), (front, -1.0)
    for shift in ELSEWHERE:
        place = front + shift * along
        free = free_way(session, cloud, pose_over(session, face, place, along), outwards, most)
        if free > best[1]:
            best = (place, free)
        if free >= least:
            break
    return best[0]


def cross_beside(session: Session, face: Feature, found: Found, sensor: int) -> list[EdgeEvent]:
    """Two more crossings by one sensor, to both sides of the first."""
    events: list[EdgeEvent] = []
    for shift in (_SHIFT, -_SHIFT):
        if stand(session, face, found.front + shift * found.along, found.along, 0.0 * found.outwards).reached:
            again = cross(session, face, found.outwards, found.reach, 2 * session.hand.baseline)
            events += [e for e in again.events if e.sensor == sensor]
    return events
