"""The edge that a hand looks for: outwards from one place or another until it is met."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.features import Feature
from tanteo.geometry.typing import FloatArray
from tanteo.hand.acquisition.crossings import Search, cross_at, free_way, front_of, pose_over, raised
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.motion.crossing import EdgeEvent
from tanteo.hand.motion.steering import Motion
from tanteo.hand.motion.track import Crease
from tanteo.words.findings import NotUnderSensors

_REACH = 0.05
"""An edge is searched for so much farther than where it should be [m]."""

_ELSEWHERE = (0.012, -0.012, 0.024, -0.024, 0.036, -0.036)
"""Where along the edge the search for it may begin, from where the face was scanned [m]."""

_ENOUGH = 0.01
"""A search should have room, and all be seen, for so much farther than where the edge should be [m]."""

_PLACES = 3
"""So many of them are tried, where the sensors are not over the face or lose it."""

_SHIFT = 0.010
"""Along the line of the sensors, for a second crossing where only one of them has met the edge [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class FoundEdge:
    """An edge that was met.

    Attributes:
        front: Where the hand's front began the crossing ``(3,)`` [m].
        along: Of the pair ``(3,)``, unit.
        outwards: Of the crossing ``(3,)``, unit.
        search: How far it went.
        events: Of all sensors that crossed.
        creases: Of those below which the surface bent away instead.
    """

    front: FloatArray
    along: FloatArray
    outwards: FloatArray
    search: Search
    events: tuple[EdgeEvent, ...]
    creases: tuple[Crease, ...]


def find_edge(run: SensingRun, face: Feature, along: FloatArray, wanted: FloatArray) -> FoundEdge | Motion:
    """Outwards until an edge or a crease is met, the pair along where it should run; else the motion that failed."""
    outwards = np.cross(along, face.T_world_feature[:3, 2])
    front = front_of(run)
    needed = max(float((wanted - front) @ outwards), 0.0)
    reach = needed + _REACH
    last = Motion("search", "lost", NotUnderSensors(both=False), ())
    search = Search(needed + _ENOUGH, reach, 2 * run.hand.baseline)
    for place in _places(run, face, (front, along, outwards), search):
        crossing = cross_at(run, face, place, along, outwards, search)
        if crossing.motion.reached or crossing.creases:
            return FoundEdge(front_of(run), along, outwards, search, crossing.events, crossing.creases)
        last = crossing.motion
        if last.status not in ("lost", "limit"):
            break
    return last


def _places(
    run: SensingRun, face: Feature, known: tuple[FloatArray, FloatArray, FloatArray], search: Search
) -> list[FloatArray]:
    """Beside the front: the places from which there is room for enough first, then those with most room."""
    front, along, outwards = known
    T, cloud = run.robot.sensed.T_world_hand, raised(run, face)
    # between the two sensors there may be a slot: below each of them the face was felt
    feet = [T[:3, :3] @ run.hand.origins[sensor] + T[:3, 3] for sensor in run.hand.frontal]
    places = [front, *feet, *(front + shift * along for shift in _ELSEWHERE)]
    free = [free_way(run, cloud, pose_over(run, face, p, along), outwards, search.reach) for p in places]
    order = sorted(range(len(places)), key=lambda k: -min(free[k], search.least))
    return [places[k] for k in order][:_PLACES]


def cross_beside(run: SensingRun, face: Feature, found: FoundEdge, sensor: int) -> list[EdgeEvent]:
    """Two more crossings by one sensor, to both sides of the first."""
    events: list[EdgeEvent] = []
    for shift in (_SHIFT, -_SHIFT):
        place = found.front + shift * found.along
        again = cross_at(run, face, place, found.along, found.outwards, found.search)
        events += [e for e in again.events if e.sensor == sensor]
    return events
