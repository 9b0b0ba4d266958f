"""Crossings of an edge: pose of the hand before the edge, free distance beyond it, and the crossing itself."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from tanteo.features import Feature
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.hand.acquisition.plane import HOVER, SCANS
from tanteo.hand.acquisition.run import SensingRun, back_off
from tanteo.hand.acquisition.seen import Cloud, over
from tanteo.hand.acquisition.ways import facing, fits, fitting, moved, nearly_known, scan_surroundings
from tanteo.hand.motion.crossing import Crossing, cross_edge
from tanteo.hand.motion.steering import Motion
from tanteo.hand.motion.travelling import go_to, path
from tanteo.hand.robot import Body
from tanteo.words.findings import NoSpace, NotAllSeen, SpaceEnds

_STEP = 0.002
"""Distance between two poses of a path that are checked for collisions [m]."""

_TIP, _ALMOST = 0.02, 0.95
"""Length of the finger tips [m], and the fraction of their volume that must have been sensed as free for a crossing.
The tips are what would hit an obstacle beyond the edge, and a crossing is slow."""

_FARTHER = 0.03
"""Additional distance that is scanned if the surface continues to the end of the known space [m]."""

_SCANS = 2
"""Largest number of scans at one position."""


@dataclass(frozen=True, slots=True)
class Search:
    """Distances of a crossing.

    Attributes:
        least: distance that should be known to be free before the crossing [m].
        reach: largest distance until the first sensor has crossed [m].
        spread: largest further distance for the other sensor [m].
    """

    least: float
    reach: float
    spread: float


def front_of(run: SensingRun) -> FloatArray:
    """Return the midpoint of the frontal sensors ``(3,)``, world frame [m]."""
    T = run.robot.sensed.T_world_hand
    return np.asarray(T[:3, :3] @ run.hand.front + T[:3, 3])


def raised(run: SensingRun, face: Feature) -> Cloud:
    """Return the sensed points that stand out of the face."""
    T = face.T_world_feature
    return over(run.seen(), T[:3, 3], T[:3, 2])


def pose_over(run: SensingRun, face: Feature, place: Vectors, along: FloatArray) -> Transforms:
    """Return the hand pose at the stand-off above the projection of a position onto the face."""
    origin, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    foot = place - ((place - origin) @ normal) * normal
    return facing(run.hand, foot, normal, along, run.standoff, run.robot.sensed.T_world_hand)


def free_way(run: SensingRun, cloud: Cloud, T: Transforms, outwards: Vectors, farthest: float) -> float:
    """Return the free distance from a pose [m], at most ``farthest``; negative if the pose itself collides."""
    free = fitting(run, cloud, _way(T, outwards, farthest))
    return _STEP * float(len(free) if free.all() else np.argmin(free)) - _STEP


def stand(run: SensingRun, face: Feature, place: Vectors, along: FloatArray) -> Motion:
    """Move to the stand-off above a position on the face, square to it, with the sensor pair along a direction.

    The path follows the face if it is free. Otherwise it goes over the hover height, with a scan if needed.
    """
    cloud, T = raised(run, face), run.robot.sensed.T_world_hand
    down = pose_over(run, face, place, along)
    if not fits(run, cloud, down[None]):
        return Motion("stand", "limit", NoSpace("at the edge"), ())
    way = path(T, down, run.hand.front, 12)
    if not (fits(run, cloud, way) and nearly_known(run, way)):
        way = path(moved(down, HOVER * face.T_world_feature[:3, 2]), down, run.hand.front, 12)
        there = scan_above(run, face, way[::-1])
        if not there.reached:
            return there
        if not nearly_known(run, way):
            return Motion("stand", "limit", NotAllSeen("at the edge"), ())
    return run.does(go_to(run.robot, down, run.rules))


def scan_above(run: SensingRun, face: Feature, needed: Transforms, *, crossing: bool = False) -> Motion:
    """Move above the first free pose and scan until the space of the fingers at all poses is known."""
    back = rise(run, face)
    if not back.reached:
        return back
    cloud, now = raised(run, face), run.robot.sensed.T_world_hand
    above = moved(needed, HOVER * face.T_world_feature[:3, 2])
    places = above[fitting(run, cloud, above)]
    there = next((T for T in places if fits(run, cloud, path(now, T, run.hand.front, 12))), None)
    if there is None:
        return Motion("look", "limit", NoSpace("over the edge"), ())
    last = run.does(go_to(run.robot, there, run.rules))
    for tilt, spacing in SCANS[1 : 1 + _SCANS]:
        if not last.reached or (all(_crossable(run, needed)) if crossing else nearly_known(run, needed)):
            break
        last = scan_surroundings(run, tilt, spacing)
    return last


def rise(run: SensingRun, face: Feature) -> Motion:
    """Retreat to the hover height above the face, or stay if the hand is higher."""
    T = face.T_world_feature
    missing = run.standoff + HOVER - float((front_of(run) - T[:3, 3]) @ T[:3, 2])
    return back_off(run, max(missing, 0.0))


def known_way(run: SensingRun, T: Transforms, outwards: Vectors, farthest: float) -> float:
    """Return the distance from a pose that is known to be free for a crossing [m], at most ``farthest``."""
    return _STEP * (sum(1 for _ in takewhile(bool, _crossable(run, _way(T, outwards, farthest)))) - 1)


def _crossable(run: SensingRun, way: Transforms) -> Iterator[bool]:
    """Yield for each pose whether almost all space of the finger tips is known to be free."""
    body = run.hand.body
    fronts = body.centres[:, 2] + body.radii
    ends = ~body.blind & (fronts > fronts[~body.blind].max() - _TIP)
    shares = run.known().shares(Body(body.centres[ends], body.radii[ends]), way, 0.0)
    return (share >= _ALMOST for share in shares)


def _way(T: Transforms, outwards: Vectors, farthest: float) -> Transforms:
    return moved(T, np.arange(1 + math.ceil(max(farthest, 0.0) / _STEP))[:, None] * _STEP * outwards)


def cross_at(
    run: SensingRun, face: Feature, place: Vectors, along: FloatArray, outwards: Vectors, search: Search
) -> Crossing:
    """Cross an edge from above a position on the face, within known free space; scan again if that is too short."""
    least = search.least
    for number in range(_SCANS + 1):
        last = stand(run, face, place, along)
        if not last.reached:
            return Crossing(last, ())
        T = run.robot.sensed.T_world_hand
        free = free_way(run, raised(run, face), T, outwards, search.reach + search.spread)
        seen = known_way(run, T, outwards, free)
        if seen >= min(free, least) or number == _SCANS:
            crossing = _cross(run, outwards, min(free, seen), search)
            if crossing.motion.status != "limit" or seen >= min(free, search.reach) or number == _SCANS:
                break
            least = seen + _FARTHER
        scan_above(run, face, _way(T, outwards, min(free, least))[::-1], crossing=True)
    return crossing


def _cross(run: SensingRun, outwards: Vectors, farthest: float, search: Search) -> Crossing:
    """Cross from the current pose, at most as far as the space is free."""
    T = run.robot.sensed.T_world_hand
    crossing = cross_edge(
        run.robot,
        T[:3, :3].T @ outwards,
        max(min(search.reach, farthest), 0.0),
        run.standoff,
        run.rules,
        spread=max(min(search.spread, farthest), 0.0),
    )
    run.does(crossing.motion)
    if crossing.motion.status == "nothing" and farthest < search.reach:
        return replace(crossing, motion=replace(crossing.motion, status="limit", finding=SpaceEnds(farthest)))
    return crossing
