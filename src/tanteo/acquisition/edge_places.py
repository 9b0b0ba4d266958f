"""Where the hand stands over a face beside its edge, how far it may go from there, and crossings as far as that."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tanteo.acquisition.cloud import Cloud, over
from tanteo.acquisition.plane import HOVER, LOOKS
from tanteo.acquisition.session import Session, back_off
from tanteo.acquisition.ways import facing, fits, fitting, known, look_around, moved, path
from tanteo.features import Feature
from tanteo.motion import Crossing, Motion, cross_edge, go_to
from tanteo.typing import FloatArray, Transforms, Vectors

_STEP = 0.002
"""A way is looked at for room in such steps [m]."""

_LOOKS = 2
"""Looks at one place, at most."""


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
    steps = np.arange(1 + math.ceil(most / _STEP)) * _STEP
    free = fitting(session, cloud, moved(T, steps[:, None] * outwards))
    return float(steps[-1] if free.all() else steps[np.argmin(free)] - _STEP)


def stand(session: Session, face: Feature, place: Vectors, along: FloatArray, outwards: Vectors) -> Motion:
    """At the stand-off over a place of the face, square to it, the pair along a line.

    The way leads along the face where what was seen leaves room for it, else over the hover height, where it
    looks if need be.

    Args:
        session: The acquisition.
        face: As sensed.
        place: In the world ``(3,)`` [m]; its foot on the face counts.
        along: For the pair ``(3,)``.
        outwards: How far the crossing from there will go at least ``(3,)`` [m]; there has to be room for that, too.
    """
    cloud, T = raised(session, face), session.robot.sensed.T_world_hand
    down = pose_over(session, face, place, along)
    if not fits(session, cloud, np.stack([down, moved(down, outwards)])):
        return Motion("stand", "limit", "there is no room for the hand at the edge", ())
    way = path(T, down, session.hand.front, 12)
    if not (fits(session, cloud, way) and known(session, way)):
        way = path(moved(down, HOVER * face.T_world_feature[:3, 2]), down, session.hand.front, 12)
        there = look_over(session, face, way[::-1])
        if not there.reached:
            return there
        if not known(session, way):
            return Motion("stand", "limit", "not all was seen around the hand's place at the edge", ())
    return session.does(go_to(session.robot, down, session.rules))


def look_over(session: Session, face: Feature, needed: Transforms) -> Motion:
    """To over the first of some poses, and looks from there until all is known that the fingers will take at them."""
    back = rise(session, face)
    if not back.reached:
        return back
    above = moved(needed[0], HOVER * face.T_world_feature[:3, 2])
    if not fits(session, raised(session, face), path(session.robot.sensed.T_world_hand, above, session.hand.front, 12)):
        return Motion("look", "limit", "there is no room for the hand over the edge", ())
    there = session.does(go_to(session.robot, above, session.rules))
    for tilt, spacing in LOOKS[1 : 1 + _LOOKS]:
        if not there.reached or known(session, needed):
            break
        there = look_around(session, tilt, spacing)
    return there


def rise(session: Session, face: Feature) -> Motion:
    """Back to the hover height over the face, or as high as it is."""
    T = face.T_world_feature
    missing = session.standoff + HOVER - float((front_of(session) - T[:3, 3]) @ T[:3, 2])
    return back_off(session, max(missing, 0.0))


def cross(session: Session, face: Feature, outwards: Vectors, reach: float, spread: float) -> Crossing:
    """A crossing as far as what was seen leaves room for it."""
    T, cloud = session.robot.sensed.T_world_hand, raised(session, face)
    farthest = free_way(session, cloud, T, outwards, reach + spread)
    crossing = cross_edge(
        session.robot,
        T[:3, :3].T @ outwards,
        max(min(reach, farthest), 0.0),
        session.standoff,
        session.rules,
        spread=max(min(spread, farthest), 0.0),
    )
    session.does(crossing.motion)
    if crossing.motion.status == "nothing" and farthest < reach:
        why = f"there is room for {1e3 * max(farthest, 0.0):.3g} mm only, and the surface does not end there"
        return replace(crossing, motion=replace(crossing.motion, status="limit", message=why))
    return crossing
