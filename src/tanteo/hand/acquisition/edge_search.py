"""Search for an edge: move outwards over the face from several positions until the sensors cross it."""

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
"""Distance of the search beyond the expected edge [m]."""

_ELSEWHERE = (0.012, -0.012, 0.024, -0.024, 0.036, -0.036)
"""Positions along the edge at which the search may begin, relative to the scan of the face [m]."""

_ENOUGH = 0.01
"""Distance beyond the expected edge that should be known to be free [m]."""

_PLACES = 3
"""Number of positions that are tried if the sensors are not over the face or lose it."""

_SHIFT = 0.010
"""Offset along the line of the sensors for a second crossing if only one sensor crossed the edge [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class FoundEdge:
    """First crossing of an edge.

    Attributes:
        front: position of the hand's front at the start of the crossing ``(3,)`` [m].
        along: unit direction of the sensor pair ``(3,)``.
        outwards: unit direction of the crossing ``(3,)``.
        search: distances of the crossing.
        events: events of all sensors that crossed.
        creases: bends under the sensors where the surface does not end.
    """

    front: FloatArray
    along: FloatArray
    outwards: FloatArray
    search: Search
    events: tuple[EdgeEvent, ...]
    creases: tuple[Crease, ...]


def find_edge(run: SensingRun, face: Feature, along: FloatArray, wanted: FloatArray) -> FoundEdge | Motion:
    """Move outwards over a face until the sensors cross an edge or a bend.

    Args:
        run: running acquisition.
        face: sensed face.
        along: expected direction of the edge ``(3,)``, unit.
        wanted: expected point of the edge ``(3,)`` [m].

    Returns:
        The first crossing, or the motion that failed.
    """
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
    """Return start positions for the search, those with the largest free distance first."""
    front, along, outwards = known
    T, cloud = run.robot.sensed.T_world_hand, raised(run, face)
    # there may be a slot between the two sensors; each of them has measured the face below it
    feet = [T[:3, :3] @ run.hand.origins[sensor] + T[:3, 3] for sensor in run.hand.frontal]
    places = [front, *feet, *(front + shift * along for shift in _ELSEWHERE)]
    free = [free_way(run, cloud, pose_over(run, face, p, along), outwards, search.reach) for p in places]
    order = sorted(range(len(places)), key=lambda k: -min(free[k], search.least))
    return [places[k] for k in order][:_PLACES]


def cross_beside(run: SensingRun, face: Feature, found: FoundEdge, sensor: int) -> list[EdgeEvent]:
    """Cross an edge twice more with one sensor, on both sides of the first crossing; return its events.

    Args:
        run: running acquisition.
        face: sensed face.
        found: first crossing.
        sensor: index of the sensor.
    """
    events: list[EdgeEvent] = []
    for shift in (_SHIFT, -_SHIFT):
        place = found.front + shift * found.along
        again = cross_at(run, face, place, found.along, found.outwards, found.search)
        events += [e for e in again.events if e.sensor == sensor]
    return events
