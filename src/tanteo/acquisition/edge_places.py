"""Where the hand stands over a face beside its edge, how far it may go from there, and crossings as far as that."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from tanteo.acquisition.cloud import Cloud, over
from tanteo.acquisition.plane import HOVER, LOOKS
from tanteo.acquisition.session import Session, back_off
from tanteo.acquisition.ways import facing, fits, fitting, look_around, moved, nearly_known, path
from tanteo.features import Feature
from tanteo.hand import Body
from tanteo.motion import Crossing, Motion, cross_edge, go_to
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


def front_of(session: Session) -> FloatArray:
    """The middle between the frontal sensors ``(3,)`` [m]."""
    T = session.robot.sensed.T_world_hand
    return np.asarray(T[:3, :3] @ session.hand.front + T[:3, 3])


def raised(session: Session, face: Feature) -> Cloud:
    """What stands out of the face: the hand stays over it."""
    T = face.T_world_feature
    return over(session.seen(), T[:3, 3], T[:3, 2])


def pose_over(session: Session, face: Feature, place: Vectors, along: FloatArray) -> Transforms:
    """The pose at the stand-off over the foot of a place."""
    origin, normal = face.T_world_feature[:3, 3], face.T_world_feature[:3, 2]
    foot = place - ((place - origin) @ normal) * normal
    return facing(session.hand, foot, normal, along, session.standoff, session.robot.sensed.T_world_hand)


def free_way(session: Session, cloud: Cloud, T: Transforms, outwards: Vectors, most: float) -> float:
    """How far what was met leaves room from a pose, at most so far; negative if it may not even be there [m]."""
    free = fitting(session, cloud, _way(T, outwards, most))
    return _STEP * float(len(free) if free.all() else np.argmin(free)) - _STEP


def stand(session: Session, face: Feature, place: Vectors, along: FloatArray) -> Motion:
    """At the stand-off over a place of the face, square to it, the pair along a line.

    The way leads along the face where what was seen leaves room for it, else over the hover height, where it
    looks if need be.

    Args:
        session: The acquisition.
        face: As sensed.
        place: In the world ``(3,)`` [m]; its foot on the face counts.
        along: For the pair ``(3,)``.
    """
    cloud, T = raised(session, face), session.robot.sensed.T_world_hand
    down = pose_over(session, face, place, along)
    if not fits(session, cloud, down[None]):
        return Motion("stand", "limit", "there is no room for the hand at the edge", ())
    way = path(T, down, session.hand.front, 12)
    if not (fits(session, cloud, way) and nearly_known(session, way)):
        way = path(moved(down, HOVER * face.T_world_feature[:3, 2]), down, session.hand.front, 12)
        there = look_over(session, face, way[::-1])
        if not there.reached:
            return there
        if not nearly_known(session, way):
            return Motion("stand", "limit", "not all was seen around the hand's place at the edge", ())
    return session.does(go_to(session.robot, down, session.rules))


def look_over(session: Session, face: Feature, needed: Transforms, *, crossing: bool = False) -> Motion:
    """To over the first of some poses that has room, and looks until all is known that the fingers take at them."""
    back = rise(session, face)
    if not back.reached:
        return back
    cloud, now = raised(session, face), session.robot.sensed.T_world_hand
    above = moved(needed, HOVER * face.T_world_feature[:3, 2])
    places = above[fitting(session, cloud, above)]
    there = next((T for T in places if fits(session, cloud, path(now, T, session.hand.front, 12))), None)
    if there is None:
        return Motion("look", "limit", "there is no room for the hand over the edge", ())
    last = session.does(go_to(session.robot, there, session.rules))
    for tilt, spacing in LOOKS[1 : 1 + _LOOKS]:
        if not last.reached or (all(_crossable(session, needed)) if crossing else nearly_known(session, needed)):
            break
        last = look_around(session, tilt, spacing)
    return last


def rise(session: Session, face: Feature) -> Motion:
    """Back to the hover height over the face, or as high as it is."""
    T = face.T_world_feature
    missing = session.standoff + HOVER - float((front_of(session) - T[:3, 3]) @ T[:3, 2])
    return back_off(session, max(missing, 0.0))


def known_way(session: Session, T: Transforms, outwards: Vectors, most: float) -> float:
    """How far from a pose enough was seen free for a crossing, at most so far [m]."""
    return _STEP * (sum(1 for _ in takewhile(bool, _crossable(session, _way(T, outwards, most)))) - 1)


def _crossable(session: Session, way: Transforms) -> Iterator[bool]:
    """Pose by pose, whether almost all is known around the ends of the fingers."""
    body = session.hand.body
    fronts = body.centres[:, 2] + body.radii
    ends = ~body.blind & (fronts > fronts[~body.blind].max() - _TIP)
    shares = session.known().shares(Body(body.centres[ends], body.radii[ends]), way, 0.0)
    return (share >= _ALMOST for share in shares)


def _way(T: Transforms, outwards: Vectors, most: float) -> Transforms:
    return moved(T, np.arange(1 + math.ceil(max(most, 0.0) / _STEP))[:, None] * _STEP * outwards)


def cross_at(
    session: Session, face: Feature, place: Vectors, along: FloatArray, outwards: Vectors, search: Search
) -> Crossing:
    """Stand over a place and cross from there, as far as all was seen free; look over it if that is too near.

    Args:
        session: The acquisition.
        face: As sensed.
        place: Where to stand, in the world ``(3,)`` [m]; its foot on the face counts.
        along: For the pair ``(3,)``.
        outwards: Way out of the face ``(3,)``, unit.
        search: How far.
    """
    least = search.least
    for number in range(_LOOKS + 1):
        last = stand(session, face, place, along)
        if not last.reached:
            return Crossing(last, ())
        T = session.robot.sensed.T_world_hand
        free = free_way(session, raised(session, face), T, outwards, search.reach + search.spread)
        seen = known_way(session, T, outwards, free)
        if seen >= min(free, least) or number == _LOOKS:
            crossing = _cross(session, outwards, min(free, seen), search)
            if crossing.motion.status != "limit" or seen >= min(free, search.reach) or number == _LOOKS:
                break
            least = seen + _FARTHER
        look_over(session, face, _way(T, outwards, min(free, least))[::-1], crossing=True)
    return crossing


def _cross(session: Session, outwards: Vectors, farthest: float, search: Search) -> Crossing:
    """A crossing from where the hand is, no farther than there is room."""
    T = session.robot.sensed.T_world_hand
    crossing = cross_edge(
        session.robot,
        T[:3, :3].T @ outwards,
        max(min(search.reach, farthest), 0.0),
        session.standoff,
        session.rules,
        spread=max(min(search.spread, farthest), 0.0),
    )
    session.does(crossing.motion)
    if crossing.motion.status == "nothing" and farthest < search.reach:
        why = f"there is known room for {1e3 * max(farthest, 0.0):.3g} mm only, and the surface does not end there"
        return replace(crossing, motion=replace(crossing.motion, status="limit", message=why))
    return crossing
