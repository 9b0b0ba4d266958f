"""Crossings of an edge: where the hand stands beside it, how far it may go, and how it crosses."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from tanteo.acquisition.plane import HOVER, LOOKS
from tanteo.acquisition.run import SensingRun, back_off
from tanteo.acquisition.seen import Cloud, over
from tanteo.acquisition.ways import facing, fits, fitting, look_around, moved, nearly_known
from tanteo.features import Feature
from tanteo.hand import Body
from tanteo.motion import Crossing, Motion, cross_edge, go_to, path
from tanteo.typing import FloatArray, Transforms, Vectors

_STEP = 0.002
"""A way is looked at for room in such steps [m]."""

_TIP, _ALMOST = 0.02, 0.95
"""On a crossing, which is slow, almost all has to be known that the ends of the fingers take, so far back [m]: they are
what meets things that rise beyond the edge."""

_FARTHER = 0.03
"""So much more of a crossing is looked at where the surface goes on to the end of what is known [m]."""

_LOOKS = 2
"""Looks at one place, at most."""


@dataclass(frozen=True, slots=True)
class Search:
    """How far a crossing goes.

    Attributes:
        least: All should be seen free for so far [m].
        reach: At most, until a sensor has crossed [m].
        spread: And on from there, for the other one [m].
    """

    least: float
    reach: float
    spread: float


def front_of(run: SensingRun) -> FloatArray:
    """The middle between the frontal sensors ``(3,)`` [m]."""
    T = run.robot.sensed.T_world_hand
    return np.asarray(T[:3, :3] @ run.hand.front + T[:3, 3])


def raised(run: SensingRun, face: Feature) -> Cloud:
    """What stands out of the face: the hand stays over it."""
    T = face.T_world_feature
    return over(run.seen(), T[:3, 3], T[:3, 2])


def pose_over(run: SensingRun, face: Feature, place: Vectors, along: FloatArray) -> Transforms:
    """The pose at the stand-off over the foot of a place."""
    origin, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    foot = place - ((place - origin) @ normal) * normal
    return facing(run.hand, foot, normal, along, run.standoff, run.robot.sensed.T_world_hand)


def free_way(run: SensingRun, cloud: Cloud, T: Transforms, outwards: Vectors, farthest: float) -> float:
    """How far what was met leaves room from a pose, at most so far; negative if it may not even be there [m]."""
    free = fitting(run, cloud, _way(T, outwards, farthest))
    return _STEP * float(len(free) if free.all() else np.argmin(free)) - _STEP


def stand(run: SensingRun, face: Feature, place: Vectors, along: FloatArray) -> Motion:
    """At the stand-off over the foot of a place on the face, square to it, the pair along a line.

    The way leads along the face where what was seen leaves room for it, else over the hover height, where it
    looks if need be.
    """
    cloud, T = raised(run, face), run.robot.sensed.T_world_hand
    down = pose_over(run, face, place, along)
    if not fits(run, cloud, down[None]):
        return Motion("stand", "limit", "there is no room for the hand at the edge", ())
    way = path(T, down, run.hand.front, 12)
    if not (fits(run, cloud, way) and nearly_known(run, way)):
        way = path(moved(down, HOVER * face.T_world_feature[:3, 2]), down, run.hand.front, 12)
        there = look_over(run, face, way[::-1])
        if not there.reached:
            return there
        if not nearly_known(run, way):
            return Motion("stand", "limit", "not all was seen around the hand's place at the edge", ())
    return run.does(go_to(run.robot, down, run.rules))


def look_over(run: SensingRun, face: Feature, needed: Transforms, *, crossing: bool = False) -> Motion:
    """To over the first of some poses that has room, and looks until all is known that the fingers take at them."""
    back = rise(run, face)
    if not back.reached:
        return back
    cloud, now = raised(run, face), run.robot.sensed.T_world_hand
    above = moved(needed, HOVER * face.T_world_feature[:3, 2])
    places = above[fitting(run, cloud, above)]
    there = next((T for T in places if fits(run, cloud, path(now, T, run.hand.front, 12))), None)
    if there is None:
        return Motion("look", "limit", "there is no room for the hand over the edge", ())
    last = run.does(go_to(run.robot, there, run.rules))
    for tilt, spacing in LOOKS[1 : 1 + _LOOKS]:
        if not last.reached or (all(_crossable(run, needed)) if crossing else nearly_known(run, needed)):
            break
        last = look_around(run, tilt, spacing)
    return last


def rise(run: SensingRun, face: Feature) -> Motion:
    """Back to the hover height over the face, or as high as it is."""
    T = face.T_world_feature
    missing = run.standoff + HOVER - float((front_of(run) - T[:3, 3]) @ T[:3, 2])
    return back_off(run, max(missing, 0.0))


def known_way(run: SensingRun, T: Transforms, outwards: Vectors, farthest: float) -> float:
    """How far from a pose enough was seen free for a crossing, at most so far [m]."""
    return _STEP * (sum(1 for _ in takewhile(bool, _crossable(run, _way(T, outwards, farthest)))) - 1)


def _crossable(run: SensingRun, way: Transforms) -> Iterator[bool]:
    """Pose by pose, whether almost all is known around the ends of the fingers."""
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
    """Stand over the foot of a place on the face and cross from there as far as all was seen free; else look again."""
    least = search.least
    for number in range(_LOOKS + 1):
        last = stand(run, face, place, along)
        if not last.reached:
            return Crossing(last, ())
        T = run.robot.sensed.T_world_hand
        free = free_way(run, raised(run, face), T, outwards, search.reach + search.spread)
        seen = known_way(run, T, outwards, free)
        if seen >= min(free, least) or number == _LOOKS:
            crossing = _cross(run, outwards, min(free, seen), search)
            if crossing.motion.status != "limit" or seen >= min(free, search.reach) or number == _LOOKS:
                break
            least = seen + _FARTHER
        look_over(run, face, _way(T, outwards, min(free, least))[::-1], crossing=True)
    return crossing


def _cross(run: SensingRun, outwards: Vectors, farthest: float, search: Search) -> Crossing:
    """A crossing from where the hand is, no farther than there is room."""
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
        why = f"there is known room for {1e3 * max(farthest, 0.0):.3g} mm only, and the surface does not end there"
        return replace(crossing, motion=replace(crossing.motion, status="limit", message=why))
    return crossing
